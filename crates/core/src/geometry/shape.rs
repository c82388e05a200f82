//! Footprints and areas: rectangles, circles, polygons and groups of them, as convex parts in the body frame; and the
//! planner's fast box.

mod convex;
mod oriented_box;
mod polygon;

pub use convex::ConvexPart;
pub(crate) use convex::Placement;
pub use oriented_box::OrientedBox;

use crate::error::{Error, Result};
use crate::geometry::{Aabb, Point, Pose};
use crate::limits::{NUMBER_MAX, is_possible};
use std::sync::Arc;

/// Bodies nearer than this touch [m]; it absorbs the rounding of exact contacts.
const TOUCHING_DISTANCE: f64 = 1e-9;
/// Sides shorter than this are taken to be this long [m]: every part has an inside.
const SIDE_MIN: f64 = 1e-6;
/// Corners of the polygon that stands for a circle in pictures.
const CIRCLE_CORNERS: usize = 32;

/// A body in its body frame (x ahead, y left): the union of convex parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Shared by copies, like the outline.
    parts: Arc<[ConvexPart]>,
    outline: Arc<[Vec<Point>]>,
    bounding_box: Aabb,
    bounding_radius: f64,
}

impl Shape {
    /// Rectangle around the body origin. Lengths [m] of zero are allowed; whether they are possible numbers at all is
    /// up to [`Shape::check`].
    pub fn rectangle(length: f64, width: f64) -> Self {
        Self::rectangle_at(length, width, Point::default(), 0.0)
    }

    /// Rectangle around a point of the body frame, turned by an angle [rad].
    pub fn rectangle_at(length: f64, width: f64, center: Point, orientation: f64) -> Self {
        let raised = |size: f64| if (0.0..SIDE_MIN).contains(&size) { SIDE_MIN } else { size };
        let pose = Pose { position: center, orientation };
        let corners = OrientedBox::new(pose, raised(length), raised(width)).corners().to_vec();
        Self::from_parts(vec![ConvexPart::new(corners.clone(), 0.0)], vec![corners])
    }

    /// Circle around the body origin; radius in [m].
    pub fn circle(radius: f64) -> Self {
        Self::circle_at(radius, Point::default())
    }

    /// Circle around a point of the body frame.
    pub fn circle_at(radius: f64, center: Point) -> Self {
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / CIRCLE_CORNERS as f64;
        let outline = (0..CIRCLE_CORNERS).map(|i| center + Point::from_angle(angle(i)) * radius).collect();
        Self::from_parts(vec![ConvexPart::new(vec![center], radius)], vec![outline])
    }

    /// Any simple polygon, in either direction, closed or not. Repeated vertices and vertices on straight lines are
    /// dropped.
    ///
    /// # Errors
    /// `InvalidInput` if a coordinate is not a number, the vertices enclose no area, or the outline crosses, touches or
    /// folds back onto itself.
    pub fn polygon(vertices: &[Point]) -> Result<Self> {
        let ring = polygon::simple_ring(vertices)?;
        let parts = polygon::convex_parts(&ring)?.into_iter().map(|part| ConvexPart::new(part, 0.0)).collect();
        Ok(Self::from_parts(parts, vec![ring]))
    }

    /// The union of shapes that share one body frame. An empty group is nowhere.
    pub fn group(shapes: Vec<Shape>) -> Self {
        let (mut parts, mut outline) = (Vec::new(), Vec::new());
        for shape in shapes {
            parts.extend_from_slice(&shape.parts);
            outline.extend_from_slice(&shape.outline);
        }
        Self::from_parts(parts, outline)
    }

    fn from_parts(parts: Vec<ConvexPart>, outline: Vec<Vec<Point>>) -> Self {
        let origin = Placement::new(Pose::default());
        let bounding_box = parts.iter().fold(Aabb::EMPTY, |aabb, part| aabb.union(part.aabb(&origin)));
        let bounding_radius = parts.iter().map(|part| part.lever() + part.radius).fold(0.0, f64::max);
        Self { parts: parts.into(), outline: outline.into(), bounding_box, bounding_radius }
    }

    /// Checks that a body can have this shape; for shapes made of numbers from outside.
    ///
    /// # Errors
    /// `InvalidInput` if there is no part, a number is not finite or too large, or a length or radius is negative.
    pub fn check(&self) -> Result<()> {
        if self.parts.is_empty() {
            return Err(Error::invalid("a shape needs at least one part"));
        }
        self.check_numbers()?;
        for part in &*self.parts {
            if part.radius < 0.0 || (part.vertices.len() > 1 && part.doubled_area() <= 0.0) {
                return Err(Error::invalid("a shape has a negative length, width or radius"));
            }
        }
        Ok(())
    }

    /// All sizes and positions are numbers that a body can have.
    ///
    /// # Errors
    /// `InvalidInput` if one is not finite or beyond [`NUMBER_MAX`].
    pub fn check_numbers(&self) -> Result<()> {
        let are_possible =
            |part: &ConvexPart| is_possible(part.radius) && part.vertices.iter().all(|vertex| vertex.is_possible());
        if self.parts.iter().all(are_possible) {
            return Ok(());
        }
        Err(Error::invalid(format!("a shape has a size or position that is not a finite number up to {NUMBER_MAX:e}")))
    }

    /// Convex parts in the body frame; together they are the shape.
    pub fn parts(&self) -> &[ConvexPart] {
        &self.parts
    }

    /// Radius of the smallest circle around the body origin that holds the shape [m].
    pub fn bounding_radius(&self) -> f64 {
        self.bounding_radius
    }

    /// Smallest box along the body axes, body frame.
    pub fn bounding_box(&self) -> Aabb {
        self.bounding_box
    }

    /// Length and width of [`Shape::bounding_box`] [m].
    pub fn extent(&self) -> (f64, f64) {
        let size = self.bounding_box.max - self.bounding_box.min;
        (size.x, size.y)
    }

    /// Closed outlines in the body frame for pictures, last vertex not repeated; circles as polygons.
    pub fn outline(&self) -> Vec<Vec<Point>> {
        self.outline.to_vec()
    }

    /// The same, borrowed.
    pub(crate) fn outlines(&self) -> &[Vec<Point>] {
        &self.outline
    }

    /// Box along the body axes around the shape at a pose; exact for a rectangle along the body axes.
    pub fn oriented_box(&self, pose: Pose) -> OrientedBox {
        self.oriented_box_along(pose.position, Point::from_angle(pose.orientation))
    }

    /// The same at a position, with a unit vector along the body's x axis.
    #[inline]
    pub fn oriented_box_along(&self, position: Point, axis: Point) -> OrientedBox {
        let placement = Placement { axis, position };
        let (length, width) = self.extent();
        OrientedBox {
            center: placement.apply(self.bounding_box.min.lerp(self.bounding_box.max, 0.5)),
            axis: placement.axis,
            half_length: 0.5 * length,
            half_width: 0.5 * width,
        }
    }

    /// Smallest axis-aligned box around the shape at a pose, world frame.
    pub fn aabb(&self, pose: Pose) -> Aabb {
        let placement = Placement::new(pose);
        self.parts.iter().fold(Aabb::EMPTY, |aabb, part| aabb.union(part.aabb(&placement)))
    }

    /// The bodies at their poses share a point; touching counts.
    pub fn overlaps(&self, pose: Pose, other: &Self, other_pose: Pose) -> bool {
        let reach = self.bounding_radius + other.bounding_radius + TOUCHING_DISTANCE;
        if (other_pose.position - pose.position).norm_squared() > reach * reach {
            return false;
        }
        let other_in_self = Placement::new(pose).relative(&Placement::new(other_pose));
        self.parts.iter().any(|part| other.parts.iter().any(|other_part| part.touches(other_part, &other_in_self)))
    }

    /// Distance between the bodies at their poses [m]: 0 if they share a point, infinite if one is empty.
    pub fn distance(&self, pose: Pose, other: &Self, other_pose: Pose) -> f64 {
        let other_in_self = Placement::new(pose).relative(&Placement::new(other_pose));
        let mut nearest = f64::INFINITY;
        for part in &*self.parts {
            for other_part in &*other.parts {
                if part.distance_at_least(other_part, &other_in_self) < nearest {
                    let distance = part.gap(other_part, &other_in_self).map_or(0.0, |gap| gap.distance);
                    nearest = nearest.min(distance);
                }
            }
        }
        nearest
    }

    /// The world point lies in the body at its pose, or on the edge.
    pub fn contains(&self, pose: Pose, point: Point) -> bool {
        /// Rounding [m].
        const MARGIN: f64 = 1e-6;
        let reach = self.bounding_radius + MARGIN;
        (point - pose.position).norm_squared() <= reach * reach && self.contains_in_body(pose.body_from_world(point))
    }

    fn contains_in_body(&self, point: Point) -> bool {
        self.bounding_box.grown(TOUCHING_DISTANCE).contains(point) && self.parts.iter().any(|part| part.contains(point))
    }

    /// Centre of area in the body frame, overlaps of parts counted twice; NaN for an empty shape.
    pub fn centroid(&self) -> Point {
        let (mut area, mut moment) = (0.0, Point::default());
        for part in &*self.parts {
            let first = part.vertices[0];
            let disc = std::f64::consts::PI * part.radius * part.radius;
            area += disc;
            moment = moment + first * disc;
            for pair in part.vertices.windows(2) {
                let triangle = 0.5 * (pair[0] - first).cross(pair[1] - first);
                area += triangle;
                moment = moment + (first + pair[0] + pair[1]) * (triangle / 3.0);
            }
        }
        moment * (1.0 / area)
    }
}

/// A shape that stays where it is: a goal area, a static structure.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedShape {
    /// The shape in its body frame.
    pub shape: Shape,
    /// Where its body frame is.
    pub pose: Pose,
}

impl PlacedShape {
    /// The world point lies inside or on the edge.
    pub fn contains(&self, point: Point) -> bool {
        self.shape.contains(self.pose, point)
    }

    /// Smallest axis-aligned box around it.
    pub fn aabb(&self) -> Aabb {
        self.shape.aabb(self.pose)
    }

    /// Centre of area, world frame.
    pub fn center(&self) -> Point {
        self.pose.world_from_body(self.shape.centroid())
    }
}

/// Seeded random numbers for tests.
#[cfg(test)]
pub(crate) struct Lcg(u64);

#[cfg(test)]
impl Lcg {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number from `low` to `high`.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

#[cfg(test)]
mod tests;
