//! Whether a vehicle is on the road: by its body, or by its wheels, with room to swing over the edge.
//!
//! A kerb stops wheels, and the overhang of a body passes above it. So the judge looks at the rectangle from the rear to
//! the front axle, as wide as the body, which may cross an edge by the tolerance of the map, beside bends by more; the
//! body may reach beyond the lanelets by no more than a bound. Contacts always count with the whole body.

use super::edges::Segment;
use super::{RoadNetwork, RoadSettings};
use crate::geometry::shape::{OrientedBox, Shape};
use crate::geometry::{Aabb, Point, Pose, wrap_angle};
use crate::settings::choice;
use crate::vehicle::Vehicle;
use std::f64::consts::FRAC_PI_2;

/// A lane bends where its curvature over 6 m is at least this [1/m].
const BEND_CURVATURE: f64 = 0.08;
/// Edges are parted into pieces of this length [m] when bends are looked for ...
const PIECE_LENGTH: f64 = 1.0;
/// ... but into at most this many, so that the cost follows the number of points and not the metres.
const PIECES_MAX: f64 = 64.0;
/// An edge belongs to lanelets that are within this distance of it [m].
const EDGE_DISTANCE: f64 = 0.05;
/// Spacing of the points on the outline of a body at which its overhang is measured [m], up to `PIECES_MAX` on a side.
const OUTLINE_SPACING: f64 = 0.5;

choice! {
    /// What of a vehicle must stay on the road.
    pub enum RoadJudge {
        /// The rectangle between the axles, and the footprint but for its overhang.
        Wheels = "wheels",
        /// The footprint.
        Body = "body",
    }
}

impl RoadNetwork {
    /// A vehicle of this shape at this pose of its centre is on the road, in the eyes of the judge. `scratch` is overwritten.
    pub fn admits(&self, shape: &Shape, vehicle: &Vehicle, pose: Pose, scratch: &mut Vec<u32>) -> bool {
        self.covers_with(shape, pose, scratch) || {
            let body = OrientedBox::new(pose, vehicle.length, vehicle.width);
            self.admits_wheels(&body, &vehicle.wheels(&body))
        }
    }

    /// The same for a motion from one footprint to the next: what both span.
    pub fn admits_motion(&self, vehicle: &Vehicle, from: &OrientedBox, to: &OrientedBox) -> bool {
        let body = OrientedBox::spanning(from, to);
        self.box_is_covered(&body)
            || (self.settings.judge != RoadJudge::Body
                && self.admits_wheels(&body, &OrientedBox::spanning(&vehicle.wheels(from), &vehicle.wheels(to))))
    }

    /// The same for a footprint that does not move.
    pub fn admits_box(&self, vehicle: &Vehicle, body: &OrientedBox) -> bool {
        self.box_is_covered(body)
            || (self.settings.judge != RoadJudge::Body && self.admits_wheels(body, &vehicle.wheels(body)))
    }

    /// Whatever a body of one convex part covers while it moves straight from one pose to another, turning on the way,
    /// lies on the lanelets: every judge admits it all the way, and nothing of it overhangs. One look instead of many; false
    /// says nothing.
    pub(crate) fn surrounds(&self, shape: &Shape, from: Pose, to: Pose, looks: usize) -> bool {
        /// Rounding [m].
        const MARGIN: f64 = 1e-6;
        let [part] = shape.parts() else { return false };
        let turn = wrap_angle(to.orientation - from.orientation);
        if !part.is_centered() || turn.abs() > FRAC_PI_2 {
            return false;
        }
        // Seen from the straight motion of the body origin, a turning point leaves its chord by the height of the arc.
        let bulge = shape.bounding_radius() * (1.0 - (0.5 * turn).cos());
        let swept = OrientedBox::spanning(&shape.oriented_box(from), &shape.oriented_box(to)).grown(bulge + MARGIN);
        let aabb = swept.aabb();
        self.area.uniform(&aabb).unwrap_or_else(|| {
            let centers = (0..=looks).map(|look| from.position.lerp(to.position, look as f64 / looks as f64));
            let is_clear = !self.area.any_edge_near(&aabb, |_, edge| swept.overlaps_segment(edge.a, edge.b));
            is_clear && { centers }.all(|center| self.is_on_road(center))
        })
    }

    /// The judge by wheels for a body that crosses the edge.
    fn admits_wheels(&self, body: &OrientedBox, wheels: &OrientedBox) -> bool {
        let RoadSettings { judge, turn_tolerance, overhang_max, .. } = self.settings;
        if judge == RoadJudge::Body || !self.is_on_road(wheels.center) {
            return false;
        }
        let (strict, lenient) = (shrunk(wheels, self.settings.gap_tolerance), shrunk(wheels, turn_tolerance));
        let aabb = strict.aabb();
        let leaves = self.area.any_edge_near(&aabb, |i, &Segment { a, b }| {
            Aabb::around([a, b]).overlaps(&aabb)
                && strict.overlaps_segment(a, b)
                && (!self.area.bends[i] || lenient.overlaps_segment(a, b))
        });
        !leaves && outline(&body.corners()).all(|point| self.area.surface.is_within(point, overhang_max))
    }

    /// How far a body reaches beyond the lanelets [m], 0 if it does not: the furthest point of its outline from them, and
    /// at most half of its size. `scratch` is overwritten.
    pub fn overhang(&self, shape: &Shape, pose: Pose, scratch: &mut Vec<u32>) -> f64 {
        let aabb = shape.aabb(pose);
        if self.area.uniform(&aabb) == Some(true) || self.covers_by(shape, pose, &aabb, 0.0, scratch) {
            return 0.0;
        }
        let (most, axis) = (shape.bounding_radius(), Point::from_angle(pose.orientation));
        let mut furthest = 0.0_f64;
        for part in shape.outlines() {
            let corner = |i: usize| pose.position + axis * part[i].x + axis.left() * part[i].y;
            for point in outline_of(part.len(), corner) {
                furthest = self.area.surface.distance_above(furthest, point, most);
            }
        }
        furthest
    }

    /// Parts the edges where a lane beside them begins or ends to bend, and notes which do.
    pub(super) fn find_bends(&mut self) {
        let (mut edges, mut bends) = (Vec::new(), Vec::new());
        let mut near = Vec::new();
        for edge in &self.area.edges {
            let n = (edge.a.distance(edge.b) / PIECE_LENGTH).ceil().clamp(1.0, PIECES_MAX) as usize;
            let at = |i: usize| edge.a.lerp(edge.b, i as f64 / n as f64);
            let bent: Vec<bool> = (0..n).map(|i| self.is_bend(at(i).lerp(at(i + 1), 0.5), &mut near)).collect();
            let mut from = 0;
            for i in 1..=n {
                if i == n || bent[i] != bent[from] {
                    edges.push(Segment { a: at(from), b: at(i) });
                    bends.push(bent[from]);
                    from = i;
                }
            }
        }
        self.area.replace_edges(edges, bends, self.settings.gap_tolerance);
    }

    /// A lane at the point bends.
    fn is_bend(&self, point: Point, near: &mut Vec<usize>) -> bool {
        self.find_lanelets_near(point, EDGE_DISTANCE, near);
        near.iter().any(|&lanelet| {
            let s = self.lanelets[lanelet].center.project(point).s;
            self.curves[lanelet].curvature_at(s).abs() >= BEND_CURVATURE
        })
    }
}

/// Smaller by `margin` [m] on every side.
fn shrunk(of: &OrientedBox, margin: f64) -> OrientedBox {
    OrientedBox {
        half_length: (of.half_length - margin).max(0.0),
        half_width: (of.half_width - margin).max(0.0),
        ..*of
    }
}

/// Points along a closed outline, its corners among them.
fn outline(corners: &[Point]) -> impl Iterator<Item = Point> + '_ {
    outline_of(corners.len(), |i| corners[i])
}

/// The same for `n` corners.
fn outline_of(n: usize, corner: impl Fn(usize) -> Point) -> impl Iterator<Item = Point> {
    (0..n).flat_map(move |i| {
        let (a, b) = (corner(i), corner((i + 1) % n));
        let steps = (a.distance(b) / OUTLINE_SPACING).ceil().clamp(1.0, PIECES_MAX) as usize;
        (0..steps).map(move |k| a.lerp(b, k as f64 / steps as f64))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::LaneletInput;
    use crate::road::testing::{arc, lane, parallel_lanes};
    use std::f64::consts::{FRAC_PI_4, PI};

    /// 4.508 m by 1.610 m; its axles are 1.423 m behind and 1.156 m ahead of its centre.
    const CAR: Vehicle = Vehicle::BMW_320I;
    /// A car that turns off a lane.
    const TURNED: f64 = 0.35;

    fn judged(lanelet: LaneletInput, judge: RoadJudge) -> RoadNetwork {
        RoadNetwork::new(vec![lanelet], RoadSettings { judge, ..RoadSettings::default() }).expect("one lanelet")
    }

    /// From y = -1.75 m to 1.75 m.
    fn straight(judge: RoadJudge) -> RoadNetwork {
        judged(parallel_lanes(1, 200.0).remove(0), judge)
    }

    /// Around the origin, counter-clockwise, from 6.25 m to 9.75 m.
    fn bend(turn_tolerance: f64, overhang_max: f64) -> RoadNetwork {
        let settings = RoadSettings { turn_tolerance, overhang_max, ..RoadSettings::default() };
        RoadNetwork::new(vec![lane(1, &arc((0.0, 0.0), 8.0, -FRAC_PI_2, PI))], settings).expect("one lanelet")
    }

    fn admits(road: &RoadNetwork, pose: Pose) -> bool {
        let still = OrientedBox::new(pose, CAR.length, CAR.width);
        let mut scratch = Vec::new();
        let answer = road.admits(&Shape::rectangle(CAR.length, CAR.width), &CAR, pose, &mut scratch);
        assert_eq!(road.admits_box(&CAR, &still), answer);
        assert_eq!(road.admits_motion(&CAR, &still, &still), answer);
        answer
    }

    fn overhang(road: &RoadNetwork, pose: Pose) -> f64 {
        road.overhang(&Shape::rectangle(CAR.length, CAR.width), pose, &mut Vec::new())
    }

    #[test]
    fn a_body_may_swing_over_the_edge_and_wheels_may_not() {
        // Front left corner and left front wheel: 1.529 m and 1.153 m to the left of the centre.
        let swings = Pose::new(100.0, 0.5, TURNED);
        assert!(admits(&straight(RoadJudge::Wheels), swings) && !admits(&straight(RoadJudge::Body), swings));
        // Within the tolerance of the map of 0.1 m, and beyond it.
        assert!(admits(&straight(RoadJudge::Wheels), Pose { position: Point::new(100.0, 0.68), ..swings }));
        assert!(!admits(&straight(RoadJudge::Wheels), Pose { position: Point::new(100.0, 0.75), ..swings }));
    }

    #[test]
    fn the_overhang_is_the_distance_of_the_furthest_point_from_the_lanelets() {
        for judge in [RoadJudge::Wheels, RoadJudge::Body] {
            let road = straight(judge);
            assert_eq!(overhang(&road, Pose::new(100.0, 0.2, TURNED)), 0.0);
            let found = overhang(&road, Pose::new(100.0, 0.5, TURNED));
            assert!((found - 0.279).abs() < 1e-3, "{found}");
            assert!((overhang(&road, Pose::new(100.0, -1.2, 0.0)) - 0.255).abs() < 1e-9);
        }
    }

    #[test]
    fn wheels_may_cross_an_edge_further_where_the_lane_bends() {
        // The right rear wheel is 9.957 m from the origin, 0.207 m beyond the edge, the right front corner 0.36 m.
        let pose = Pose { position: Point::from_angle(FRAC_PI_4) * 9.05, orientation: FRAC_PI_4 + FRAC_PI_2 };
        assert!(admits(&bend(0.3, 0.8), pose) && !admits(&bend(0.1, 0.8), pose));
        let found = overhang(&bend(0.3, 0.8), pose);
        assert!((found - 0.36).abs() < 0.02, "{found}");
        assert!(admits(&bend(0.3, 0.4), pose) && !admits(&bend(0.3, 0.3), pose));
    }

    #[test]
    fn edges_are_parted_where_a_bend_begins() {
        // 20 m straight on, then a quarter of a circle of 5 m: bends over 6 m from about 20 m on, nowhere before 17 m.
        let mut center: Vec<Point> = vec![Point::new(0.0, 0.0), Point::new(20.0, 0.0)];
        center.extend(arc((20.0, 5.0), 5.0, -FRAC_PI_2, 0.0).into_iter().skip(1));
        let road = judged(lane(1, &center), RoadJudge::Wheels);
        let bent = |x: f64| {
            let mut near = Vec::new();
            road.edges_near(&crate::geometry::Aabb { min: Point::new(x, -2.0), max: Point::new(x, -1.5) }, &mut near);
            near.iter().map(|i| road.area.bends[*i as usize]).collect::<Vec<_>>()
        };
        assert_eq!((bent(5.5), bent(15.5), bent(21.0)), (vec![false], vec![false], vec![true]));
        let length: f64 = road.road_edges().iter().map(|edge| edge.a.distance(edge.b)).sum();
        let whole: f64 =
            judged(lane(1, &center), RoadJudge::Body).road_edges().iter().map(|edge| edge.a.distance(edge.b)).sum();
        assert!((length - whole).abs() < 1e-9);
    }

    #[test]
    fn impossible_lengths_are_refused() {
        for (turn_tolerance, overhang_max) in [(-0.1, 0.8), (0.3, f64::NAN)] {
            let settings = RoadSettings { turn_tolerance, overhang_max, ..RoadSettings::default() };
            assert!(RoadNetwork::new(parallel_lanes(1, 200.0), settings).is_err());
        }
    }
}
