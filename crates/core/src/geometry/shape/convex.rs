//! Convex parts: overlap by separating axes, distance by the nearest pair of a vertex and an edge.

use super::{OrientedBox, TOUCHING_DISTANCE};
use crate::geometry::{Aabb, Point, Pose};

/// Convex set in the body frame: a circle (one vertex with a radius) or a polygon (at least three vertices, radius 0).
#[derive(Debug, Clone, PartialEq)]
pub struct ConvexPart {
    /// Corners, counter-clockwise [m].
    pub vertices: Vec<Point>,
    /// Radius of a circle [m]; 0 for a polygon.
    pub radius: f64,
    /// Side `i` runs from vertex `i` to the next one.
    sides: Vec<Side>,
    /// A circle around the part.
    center: Point,
    reach: f64,
    /// Largest distance of a vertex from the body origin: how far it moves per radian of turning.
    lever: f64,
}

/// The half-plane behind a side: points with `normal . point <= offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Side {
    /// Unit vector outwards.
    normal: Point,
    offset: f64,
}

/// A pose with the trigonometry done.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Placement {
    /// Unit vector along the body's x axis.
    pub(crate) axis: Point,
    /// Origin of the body.
    pub(crate) position: Point,
}

impl Placement {
    #[inline]
    pub(crate) fn new(pose: Pose) -> Self {
        Self { axis: Point::from_angle(pose.orientation), position: pose.position }
    }

    #[inline]
    pub(crate) fn apply(&self, point: Point) -> Point {
        self.position + self.turn(point)
    }

    #[inline]
    pub(crate) fn turn(&self, vector: Point) -> Point {
        self.axis * vector.x + self.axis.left() * vector.y
    }

    #[inline]
    pub(crate) fn turn_back(&self, vector: Point) -> Point {
        Point::new(vector.dot(self.axis), self.axis.cross(vector))
    }

    /// `other` as seen from `self`.
    #[inline]
    pub(crate) fn relative(&self, other: &Self) -> Self {
        Self { axis: self.turn_back(other.axis), position: self.turn_back(other.position - self.position) }
    }

    #[inline]
    fn inverse(&self) -> Self {
        Self { axis: Point::new(self.axis.x, -self.axis.y), position: -self.turn_back(self.position) }
    }
}

/// What lies between two parts that are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gap {
    /// Distance [m], positive.
    pub(crate) distance: f64,
    /// Unit vector from the nearest point of the first to the nearest point of the second, frame of the first. Both
    /// parts lie on their sides of the strip of this direction and `distance` width.
    pub(crate) direction: Point,
}

/// The side of one part that separates it best from another one.
struct Separation {
    side: usize,
    /// Vertex of the other part nearest to the side.
    vertex: usize,
    distance: f64,
}

impl ConvexPart {
    /// Smallest box around it along one of its sides, world frame, and whether that is larger than it.
    pub(crate) fn tightest_box(&self, pose: Pose) -> (OrientedBox, bool) {
        let vertices = &self.vertices;
        let to_world = |p: Point| pose.world_from_body(p);
        if vertices.len() < 3 {
            let center = to_world(vertices.first().copied().unwrap_or_default());
            let axis = Point::from_angle(pose.orientation);
            return (OrientedBox { center, axis, half_length: self.radius, half_width: self.radius }, false);
        }
        let triangle = |i: usize| 0.5 * (vertices[i] - vertices[0]).cross(vertices[i + 1] - vertices[0]);
        let area: f64 = (1..vertices.len() - 1).map(triangle).sum();
        let mut best: Option<OrientedBox> = None;
        for i in 0..vertices.len() {
            let side = vertices[(i + 1) % vertices.len()] - vertices[i];
            let axis = side * (1.0 / side.norm());
            let around = Aabb::around(vertices.iter().map(|vertex| Point::new(vertex.dot(axis), axis.cross(*vertex))));
            let half = (around.max - around.min) * 0.5;
            if best.is_none_or(|b| half.x * half.y < b.half_length * b.half_width - 1e-9) {
                let middle = (around.min + around.max) * 0.5;
                let center = to_world(axis * middle.x + axis.left() * middle.y);
                let axis_in_world = to_world(axis) - pose.position;
                best = Some(OrientedBox { center, axis: axis_in_world, half_length: half.x, half_width: half.y });
            }
        }
        let best = best.expect("a polygon has sides");
        (best, 4.0 * best.half_length * best.half_width > 1.02 * area)
    }

    /// A circle from its centre, or a polygon from its corners: counter-clockwise, no two of them equal.
    pub(super) fn new(vertices: Vec<Point>, radius: f64) -> Self {
        let n = vertices.len();
        let side = |i: usize| {
            let along = vertices[(i + 1) % n] - vertices[i];
            let normal = -along.left() * (1.0 / along.norm());
            Side { normal, offset: normal.dot(vertices[i]) }
        };
        let sides = if n > 1 { (0..n).map(side).collect() } else { Vec::new() };
        let around = Aabb::around(vertices.iter().copied());
        let center = around.min.lerp(around.max, 0.5);
        let farthest = |from: Point| vertices.iter().map(|v| v.distance(from)).fold(0.0, f64::max);
        let (reach, lever) = (farthest(center) + radius, farthest(Point::default()));
        Self { vertices, radius, sides, center, reach, lever }
    }

    /// Largest distance of a vertex from the body origin [m]; the disc of a circle does not notice turning.
    pub(crate) fn lever(&self) -> f64 {
        self.lever
    }

    /// The mean of its vertices is the body origin.
    pub(crate) fn is_centered(&self) -> bool {
        let sum = self.vertices.iter().fold(Point::default(), |sum, vertex| sum + *vertex);
        sum.norm_squared() <= TOUCHING_DISTANCE * TOUCHING_DISTANCE
    }

    /// The point (body frame) lies inside or on the edge.
    #[inline]
    pub fn contains(&self, point: Point) -> bool {
        match self.vertices.as_slice() {
            [center] => point.distance(*center) <= self.radius + TOUCHING_DISTANCE,
            _ => self.sides.iter().all(|side| side.normal.dot(point) <= side.offset + TOUCHING_DISTANCE),
        }
    }

    /// Twice the signed area of the polygon [m²].
    pub(super) fn doubled_area(&self) -> f64 {
        super::polygon::doubled_area(&self.vertices)
    }

    /// The parts share a point; the second one is placed in the frame of the first.
    #[inline]
    pub(crate) fn touches(&self, other: &Self, other_in_self: &Placement) -> bool {
        if self.is_far_from(other, other_in_self) {
            return false;
        }
        if self.radius + other.radius > 0.0 {
            return self.gap(other, other_in_self).is_none();
        }
        let is_separated = |separation: Option<Separation>| separation.is_some_and(|s| s.distance > TOUCHING_DISTANCE);
        !is_separated(self.best_side(other, other_in_self))
            && !is_separated(other.best_side(self, &other_in_self.inverse()))
    }

    /// Circles around the parts are apart.
    #[inline]
    fn is_far_from(&self, other: &Self, other_in_self: &Placement) -> bool {
        let reach = self.reach + other.reach + TOUCHING_DISTANCE;
        (other_in_self.apply(other.center) - self.center).norm_squared() > reach * reach
    }

    /// A lower bound of the distance [m] that costs almost nothing; negative if the circles around the parts overlap.
    #[inline]
    pub(crate) fn distance_at_least(&self, other: &Self, other_in_self: &Placement) -> f64 {
        other_in_self.apply(other.center).distance(self.center) - self.reach - other.reach
    }

    /// Distance and direction from one part to the other; `None` if they share a point.
    pub(crate) fn gap(&self, other: &Self, other_in_self: &Placement) -> Option<Gap> {
        let core = self.core_gap(other, other_in_self)?;
        let distance = core.distance - self.radius - other.radius;
        (distance > TOUCHING_DISTANCE).then_some(Gap { distance, ..core })
    }

    /// The gap between the polygons, radii not counted.
    fn core_gap(&self, other: &Self, other_in_self: &Placement) -> Option<Gap> {
        let self_in_other = other_in_self.inverse();
        let mine = self.best_side(other, other_in_self);
        let theirs = other.best_side(self, &self_in_other);
        let distance_of =
            |separation: &Option<Separation>| separation.as_ref().map_or(f64::NEG_INFINITY, |s| s.distance);
        let separated = distance_of(&mine).max(distance_of(&theirs));
        let has_sides = mine.is_some() || theirs.is_some();
        if has_sides && separated <= TOUCHING_DISTANCE {
            return None;
        }
        // No two points are nearer than the separation. If the nearest vertex lies in front of its side, the two points
        // are found; otherwise two corners face each other, and which ones is found by trying.
        if let Some(separation) = mine.filter(|s| s.distance == separated)
            && self.is_in_front(separation.side, other_in_self.apply(other.vertices[separation.vertex]))
        {
            return Some(Gap { distance: separated, direction: self.sides[separation.side].normal });
        }
        if let Some(separation) = theirs.filter(|s| s.distance == separated)
            && other.is_in_front(separation.side, self_in_other.apply(self.vertices[separation.vertex]))
        {
            let direction = -other_in_self.turn(other.sides[separation.side].normal);
            return Some(Gap { distance: separated, direction });
        }
        let mut nearest = Point::new(f64::INFINITY, 0.0);
        let mut consider = |vector: Point| {
            if vector.norm_squared() < nearest.norm_squared() {
                nearest = vector;
            }
        };
        for vertex in &other.vertices {
            self.for_facing_sides(other_in_self.apply(*vertex), &mut consider);
        }
        for vertex in &self.vertices {
            other.for_facing_sides(self_in_other.apply(*vertex), |vector| consider(-other_in_self.turn(vector)));
        }
        let distance = nearest.norm();
        // Two points on each other have no direction; everything else that touches was found above.
        (distance > 0.0).then(|| Gap { distance, direction: nearest * (1.0 / distance) })
    }

    /// The side farthest from the other polygon; `None` for a single vertex.
    #[inline]
    fn best_side(&self, other: &Self, other_in_self: &Placement) -> Option<Separation> {
        let mut best: Option<Separation> = None;
        for (i, side) in self.sides.iter().enumerate() {
            // Turning one normal is cheaper than turning all vertices.
            let normal = other_in_self.turn_back(side.normal);
            let (mut vertex, mut lowest) = (0, f64::INFINITY);
            for (j, candidate) in other.vertices.iter().enumerate() {
                let height = normal.dot(*candidate);
                if height < lowest {
                    (vertex, lowest) = (j, height);
                }
            }
            let distance = lowest + side.normal.dot(other_in_self.position) - side.offset;
            if best.as_ref().is_none_or(|b| distance > b.distance) {
                best = Some(Separation { side: i, vertex, distance });
            }
        }
        best
    }

    /// The foot of the point on the line of the side lies on the side.
    #[inline]
    fn is_in_front(&self, side: usize, point: Point) -> bool {
        let along = self.sides[side].normal.left();
        let end = self.vertices[(side + 1) % self.vertices.len()];
        (point - self.vertices[side]).dot(along) >= 0.0 && (point - end).dot(along) <= 0.0
    }

    /// Calls with the vector from the nearest point of each side that faces the point; of the vertex, if it is the only
    /// one. The nearest point of a convex polygon always lies on a side that faces.
    #[inline]
    fn for_facing_sides(&self, point: Point, mut visit: impl FnMut(Point)) {
        if self.sides.is_empty() {
            visit(point - self.vertices[0]);
        }
        for (i, side) in self.sides.iter().enumerate() {
            if side.normal.dot(point) > side.offset {
                let start = self.vertices[i];
                let along = self.vertices[(i + 1) % self.vertices.len()] - start;
                let fraction = ((point - start).dot(along) / along.norm_squared()).clamp(0.0, 1.0);
                visit(point - start - along * fraction);
            }
        }
    }

    /// Axis-aligned box around the part at a placement.
    pub(crate) fn aabb(&self, placement: &Placement) -> Aabb {
        Aabb::around(self.vertices.iter().map(|vertex| placement.apply(*vertex))).grown(self.radius)
    }
}
