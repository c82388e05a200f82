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
pub(super) struct Foot {
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

    /// Middle and half width of the directions that the curve takes [rad].
    pub(super) fn directions(&self) -> (f64, f64) {
        self.directions
    }

    /// The nearest foot at which the tangent is at right angles to the way to the point; `None` beyond the ends and
    /// farther away than `reach` [m].
    pub(super) fn project(&self, point: Point, reach: f64) -> Option<Foot> {
        let mut best: Option<Foot> = None;
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
    fn foot(&self, i: usize, point: Point, ahead: f64) -> Foot {
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
        Foot {
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
}
