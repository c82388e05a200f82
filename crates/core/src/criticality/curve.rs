//! Curvilinear coordinates of a chain of centre lines: arc length and offset of points, with tangents that are
//! interpolated between vertices, so that the arc length is continuous across kinks.

use crate::geometry::Point;

/// Vertices nearer to each other than this [m] are one: joints of lanelets are that inexact.
const SAME_VERTEX: f64 = 0.05;
/// A vertex that leads back by less than this [m] is left out: some lanelets start before the end of the one before.
const LEADS_BACK: f64 = 3.0;

/// A polyline with a tangent at every vertex.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    points: Vec<Point>,
    /// Unit vectors: bisectors at inner vertices.
    tangents: Vec<Point>,
    arc_lengths: Vec<f64>,
    /// Middle and half width of the interval that holds the directions of all tangents [rad].
    directions: (f64, f64),
}

/// Where a point is beside a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CurveFoot {
    /// Arc length [m].
    pub s: f64,
    /// Offset [m], left positive.
    pub d: f64,
    /// Unit tangent.
    pub tangent: Point,
}

impl Curve {
    /// From its vertices; `None` if they have no length.
    pub(super) fn new(vertices: impl IntoIterator<Item = Point>) -> Option<Self> {
        let mut points: Vec<Point> = Vec::new();
        for vertex in vertices {
            let leads_on = match points[..] {
                [.., before, last] => {
                    let step = vertex - last;
                    step.dot(last - before) >= 0.0 || step.norm() > LEADS_BACK
                }
                _ => true,
            };
            if leads_on && points.last().is_none_or(|last| last.distance(vertex) > SAME_VERTEX) {
                points.push(vertex);
            }
        }
        if points.len() < 2 {
            return None;
        }
        let unit = |vector: Point| vector * (1.0 / vector.norm());
        let sides: Vec<Point> = points.windows(2).map(|pair| unit(pair[1] - pair[0])).collect();
        let tangent = |i: usize| {
            let (before, after) = (sides[i.saturating_sub(1)], sides[i.min(sides.len() - 1)]);
            let sum = before + after;
            // A curve that turns back on itself has no bisector.
            if sum.norm() > 1e-6 { unit(sum) } else { after }
        };
        let tangents: Vec<Point> = (0..points.len()).map(tangent).collect();
        let mut arc_lengths = vec![0.0];
        for pair in points.windows(2) {
            arc_lengths.push(arc_lengths[arc_lengths.len() - 1] + pair[0].distance(pair[1]));
        }
        let (mut angle, mut low, mut high) = (0.0_f64, 0.0_f64, 0.0_f64);
        for pair in tangents.windows(2) {
            angle += pair[0].cross(pair[1]).atan2(pair[0].dot(pair[1]));
            (low, high) = (low.min(angle), high.max(angle));
        }
        let directions = (tangents[0].angle() + 0.5 * (low + high), 0.5 * (high - low));
        Some(Self { points, tangents, arc_lengths, directions })
    }

    /// Arc length of the last vertex [m].
    pub(super) fn length(&self) -> f64 {
        self.arc_lengths[self.arc_lengths.len() - 1]
    }

    /// Middle and half width of the directions that the curve takes [rad].
    pub(super) fn directions(&self) -> (f64, f64) {
        self.directions
    }

    /// The nearest foot at which the tangent is at right angles to the way to the point; `None` beyond the ends and
    /// farther away than `reach` [m].
    pub(super) fn project(&self, point: Point, reach: f64) -> Option<CurveFoot> {
        let mut best: Option<CurveFoot> = None;
        let mut nearest = reach;
        let mut ahead = (point - self.points[0]).dot(self.tangents[0]);
        for i in 0..self.points.len() - 1 {
            let next = (point - self.points[i + 1]).dot(self.tangents[i + 1]);
            if ahead >= 0.0 && next <= 0.0 {
                let foot = self.foot(i, point, ahead);
                if foot.d.abs() <= nearest {
                    nearest = foot.d.abs();
                    best = Some(foot);
                }
            }
            ahead = next;
        }
        best
    }

    /// The foot on a segment, which has one: `ahead` is positive at its start and not at its end.
    fn foot(&self, i: usize, point: Point, ahead: f64) -> CurveFoot {
        let (side, turn) = (self.points[i + 1] - self.points[i], self.tangents[i + 1] - self.tangents[i]);
        let offset = point - self.points[i];
        // (offset - u * side) . (tangent + u * turn) = 0
        let (a, b, c) = (-side.dot(turn), offset.dot(turn) - side.dot(self.tangents[i]), ahead);
        let fraction = if a.abs() < 1e-12 {
            if b == 0.0 { 0.0 } else { -c / b }
        } else {
            let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
            let q = -0.5 * (b + root.copysign(b));
            let inside = |u: f64| (-1e-9..=1.0 + 1e-9).contains(&u);
            let (first, second) = (q / a, if q == 0.0 { f64::NAN } else { c / q });
            if inside(second) { second } else { first }
        };
        let fraction = fraction.clamp(0.0, 1.0);
        let tangent = self.tangents[i] + turn * fraction;
        let tangent = tangent * (1.0 / tangent.norm());
        let away = offset - side * fraction;
        CurveFoot {
            s: self.arc_lengths[i] + fraction * (self.arc_lengths[i + 1] - self.arc_lengths[i]),
            d: away.norm().copysign(tangent.cross(away)),
            tangent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(spacing: f64) -> Curve {
        let n = (100.0 / spacing) as i32;
        Curve::new((0..=n).map(|i| Point::from_angle(f64::from(i) * spacing / 50.0) * 50.0)).expect("a curve")
    }

    #[test]
    fn arc_lengths_along_a_circle_are_those_of_the_arc() {
        let curve = circle(1.0);
        let at = |angle: f64, radius: f64| {
            curve.project(Point::from_angle(angle) * radius, 100.0).expect("beside the curve")
        };
        for radius in [48.0, 50.0, 52.0] {
            let gap = at(1.0, radius).s - at(0.2, radius).s;
            assert!((gap - 40.0).abs() < 2e-3, "{gap}");
            assert!((at(1.0, radius).d - (50.0 - radius)).abs() < 3e-3);
        }
    }

    #[test]
    fn the_arc_length_is_continuous_across_a_kink() {
        let curve = Curve::new([(0.0, 0.0), (10.0, 0.0), (17.0, 7.0)].map(|(x, y)| Point::new(x, y))).expect("a curve");
        for side in [2.0, -2.0] {
            let mut last: Option<f64> = None;
            for k in 0..4000 {
                let x = 5.0 + f64::from(k) * 0.002;
                let offset = Point::new(0.0, side) + Point::new(x, (x - 10.0).max(0.0));
                let s = curve.project(offset, 50.0).expect("beside the curve").s;
                assert!(last.is_none_or(|last| (0.0..0.02).contains(&(s - last))), "{x}");
                last = Some(s);
            }
        }
    }

    #[test]
    fn lanelets_that_overlap_at_their_joint_do_not_lengthen_the_way() {
        let vertices = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (19.0, 0.1), (21.0, 0.1), (30.0, 0.1)];
        let curve = Curve::new(vertices.map(|(x, y)| Point::new(x, y))).expect("a curve");
        let at = |x: f64| curve.project(Point::new(x, 0.0), 5.0).expect("beside").s;
        assert!((at(25.0) - at(15.0) - 10.0).abs() < 0.02);
    }

    #[test]
    fn there_is_no_foot_beyond_the_ends_or_too_far_away() {
        let curve = Curve::new([Point::new(0.0, 0.0), Point::new(10.0, 0.0)]).expect("a curve");
        for (x, y) in [(-0.1, 0.0), (10.1, 1.0), (5.0, 20.5), (f64::NAN, 0.0)] {
            assert_eq!(curve.project(Point::new(x, y), 20.0), None, "{x} {y}");
        }
        let foot = curve.project(Point::new(4.0, -3.0), 20.0).expect("beside");
        assert_eq!((foot.s, foot.d, foot.tangent), (4.0, -3.0, Point::new(1.0, 0.0)));
        assert!(Curve::new([Point::new(1.0, 1.0), Point::new(1.0, 1.01)]).is_none());
    }

    #[test]
    fn the_interval_of_directions_holds_every_tangent() {
        let (middle, half) = circle(1.0).directions();
        assert!((middle - (0.5 * std::f64::consts::PI + 1.0)).abs() < 0.02 && (half - 1.0).abs() < 0.02);
    }

    fn through(vertices: &[(f64, f64)]) -> Curve {
        Curve::new(vertices.iter().map(|(x, y)| Point::new(*x, *y))).expect("a curve")
    }

    #[test]
    fn at_the_foot_the_tangent_is_at_right_angles_to_the_way_to_the_point() {
        let vertices = [(0.0, 0.0), (10.0, 0.0), (18.0, 6.0), (30.0, 6.0), (30.0, 20.0)];
        let curve = through(&vertices);
        let lengths = [10.0, 10.0, 12.0, 14.0];
        let mut random = crate::geometry::shape::Lcg::new(4);
        let mut sides = [0, 0];
        for _ in 0..2000 {
            let point = Point::new(random.within(0.0, 32.0), random.within(-4.0, 18.0));
            let Some(foot) = curve.project(point, 5.0) else { continue };
            let (mut rest, mut i) = (foot.s, 0);
            while i < 3 && rest > lengths[i] {
                (rest, i) = (rest - lengths[i], i + 1);
            }
            let on_curve = curve.points[i].lerp(curve.points[i + 1], rest / lengths[i]);
            let away = point - on_curve;
            assert!((foot.tangent.norm() - 1.0).abs() < 1e-12 && away.dot(foot.tangent).abs() < 1e-6, "{point:?}");
            assert!((foot.d.abs() - away.norm()).abs() < 1e-6 && foot.d.abs() <= 5.0, "{point:?}");
            assert!(foot.d * foot.tangent.cross(away) >= 0.0, "{point:?}: left is positive");
            sides[usize::from(foot.d > 0.0)] += 1;
        }
        assert!(sides.iter().all(|n| *n > 200), "{sides:?}");
    }

    #[test]
    fn tangents_at_vertices_are_bisectors() {
        let curve = through(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (10.0, 4.0)]);
        let half = 0.5_f64.sqrt();
        let expected = [(1.0, 0.0), (half, half), (0.0, -1.0), (0.0, -1.0)];
        for (found, (x, y)) in curve.tangents.iter().zip(expected) {
            assert!(found.distance(Point::new(x, y)) < 1e-12, "{found:?}: back on itself the side behind counts");
        }
        assert_eq!(curve.arc_lengths, [0.0, 10.0, 20.0, 26.0]);
    }

    #[test]
    fn of_several_feet_the_nearest_counts_and_both_ends_have_one() {
        // There and back, 6 m apart.
        let curve = through(&[(0.0, 0.0), (20.0, 0.0), (20.0, 6.0), (0.0, 6.0)]);
        for (x, y, s, d) in
            [(2.0, 1.0, 2.0, 1.0), (2.0, 5.0, 44.0, 1.0), (2.0, 8.0, 44.0, -2.0), (0.0, -5.0, 0.0, -5.0)]
        {
            let foot = curve.project(Point::new(x, y), 5.0).expect("beside");
            assert!((foot.s - s).abs() < 0.5 && (foot.d - d).abs() < 0.5, "{foot:?} instead of {s} {d}");
        }
        let line = through(&[(0.0, 0.0), (10.0, 0.0)]);
        for (x, y) in [(0.0, 3.0), (10.0, -3.0), (4.0, 3.0)] {
            let foot = line.project(Point::new(x, y), 3.0).expect("exactly beside, exactly within reach");
            assert_eq!((foot.s, foot.d), (x, y));
        }
    }

    #[test]
    fn a_vertex_that_leads_back_a_little_is_left_out_and_one_that_leads_aside_or_far_back_is_not() {
        for (vertices, length) in [
            (vec![(0.0, 0.0), (10.0, 0.0), (7.5, 0.0), (20.0, 0.0)], 20.0),
            (vec![(0.0, 0.0), (10.0, 0.0), (7.0, 0.0), (20.0, 0.0)], 20.0),
            (vec![(0.0, 0.0), (10.0, 0.0), (6.0, 0.0), (6.0, 10.0)], 24.0),
            (vec![(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (20.0, 2.0)], 22.0),
            (vec![(0.0, 0.0), (10.0, 0.0), (10.04, 0.0), (20.0, 0.0)], 20.0),
        ] {
            let curve = through(&vertices);
            assert_eq!(curve.arc_lengths.last(), Some(&length), "{vertices:?}");
        }
        assert_eq!(through(&[(0.0, 0.0), (10.0, 0.0), (10.0, 0.04), (20.0, 0.0)]).points.len(), 3, "one vertex, twice");
    }

    #[test]
    fn directions_are_the_middle_and_half_width_of_what_the_tangents_take() {
        // Sides at 0.2, 1.2, 0.8 rad: tangents at 0.2, 0.7, 1.0, 0.8. Mirrored about 0.2: 0.2, -0.3, -0.6, -0.4.
        for (angles, middle, half) in [([0.2, 1.2, 0.8], 0.6, 0.4), ([0.2, -0.8, -0.4], -0.2, 0.4)] {
            let mut at = Point::new(3.0, 4.0);
            let mut vertices = vec![at];
            for angle in angles {
                at = at + Point::from_angle(angle) * 10.0;
                vertices.push(at);
            }
            let found = Curve::new(vertices).expect("a curve").directions();
            assert!((found.0 - middle).abs() < 1e-9 && (found.1 - half).abs() < 1e-9, "{found:?}");
        }
    }
}
