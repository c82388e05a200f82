//! The line that a driver takes within a lane: of least curvature, so that bends are cut as far as the lane has room.
//!
//! Offsets o of the rear axle from the path minimise the integral of the squared curvature and of o² (so that the line is
//! the middle of the lane where the road is straight) between bounds that keep the footprint in the lane: a quadratic
//! programme as for racing lines (Heilmeier et al., Vehicle System Dynamics 58, 2020, doi 10.1080/00423114.2019.1631455),
//! solved by alternating directions with one factorisation of a band of five diagonals.

use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::road::RoadNetwork;
use crate::route::Route;
use crate::vehicle::Vehicle;

/// Knots of the path per knot of the line.
const STRIDE: usize = 2;
/// Weight of an offset against the curvature [1/m⁴]: the line returns to the middle over a way of about its fourth root.
const RETURN: f64 = 1e-5;
/// Weight with which the bounds draw [1/m⁴], about that of bends of 20 m, and over-relaxation: they decide how fast the line
/// is found.
const PENALTY: f64 = 0.01;
const OVER: f64 = 1.6;
/// Room kept to the edge of the lane [m].
const EDGE: f64 = 0.3;
/// The nearest point of a bound is searched so far ahead and behind [m].
const BOUND_REACH: f64 = 6.0;
/// Offset where the path is in no lane, or changes lanes [m].
const UNKNOWN: f64 = 0.1;
/// Largest offset [m].
const OFFSET_MAX: f64 = 0.7;
/// Steps of the method, and how often the way along the line is worked out anew.
const STEPS: usize = 60;
const ROUNDS: usize = 3;
/// A line inside of a bend is no shorter than this share of the path.
const SHARE_MIN: f64 = 0.4;

/// The line beside a path.
#[derive(Debug, Clone)]
pub struct DrivingLine {
    /// Knots per arc length of the path [1/m].
    density: f64,
    knots: Vec<LinePoint>,
}

/// A point of the line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::plan) struct LinePoint {
    /// Offset from the path [m], left positive.
    pub(in crate::plan) offset: f64,
    /// Heading against that of the path [rad].
    pub(in crate::plan) heading: f64,
    /// Curvature [1/m].
    pub(in crate::plan) curvature: f64,
}

impl DrivingLine {
    /// Along a route; where the lane changes, it is the path.
    pub(in crate::plan) fn of(route: &Route, vehicle: &Vehicle, road: &RoadNetwork) -> Self {
        Self::within(&route.path, vehicle, |s| {
            let piece = route.pieces.iter().find(|piece| piece.holds(s) && !piece.is_cut())?;
            let lanelet = &road.lanelets()[piece.lanelet];
            Some(lanelet.bounds_at((s - piece.start) / (piece.end - piece.start) * lanelet.length))
        })
    }

    /// For a vehicle in a lane whose left and right bound are those at arc lengths of the path.
    pub(in crate::plan) fn within(
        path: &ReferencePath,
        vehicle: &Vehicle,
        bounds: impl Fn(f64) -> Option<(Point, Point)>,
    ) -> Self {
        let spacing = STRIDE as f64 * path.spacing();
        let at: Vec<_> = (0..path.theta().len()).step_by(STRIDE).map(|i| path.at(i as f64 * path.spacing())).collect();
        let centers: Vec<Point> = at.iter().map(|point| point.position).collect();
        let normals: Vec<Point> = at.iter().map(|point| point.tangent().left()).collect();
        let n = at.len();
        let bounds: Vec<_> = (0..n).map(|i| bounds(i as f64 * spacing)).collect();
        let half = 0.5 * vehicle.width + EDGE;
        let reach = (BOUND_REACH / spacing).ceil() as usize;
        let room: Vec<(f64, f64)> = (0..n)
            .map(|i| {
                if bounds[i].is_none() {
                    return (half + UNKNOWN, half + UNKNOWN);
                }
                let near = bounds[i.saturating_sub(reach)..(i + reach + 1).min(n)].iter().flatten();
                (
                    distance(centers[i], normals[i], near.clone().map(|bound| bound.0)),
                    distance(centers[i], -normals[i], near.map(|bound| bound.1)),
                )
            })
            .collect();
        let to_front = vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let body = (to_front / spacing).round() as usize;
        let limits: Vec<(f64, f64)> = (0..n)
            .map(|k| {
                let (mut low, mut high) = (-OFFSET_MAX, OFFSET_MAX);
                for i in k.saturating_sub(body)..=k {
                    // With the rear axle at i the body reaches up to k, straight: it swings out of the bend.
                    let swing = (centers[k] - centers[i]).dot(normals[i]);
                    high = high.min(room[k].0 - half + swing);
                    low = low.max(half - room[k].1 + swing);
                }
                (low.min(0.0), high.max(0.0))
            })
            .collect();
        let (mut offsets, mut within, mut price) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut curvature = Vec::new();
        for _ in 0..ROUNDS {
            let stretch: Vec<f64> = (0..n).map(|i| (1.0 - at[i].curvature * offsets[i]).max(SHARE_MIN)).collect();
            let bend = Bend::new(&centers, &normals, &stretch, spacing);
            offsets = bend.least(&limits, &mut within, &mut price);
            curvature = bend.curvature(&offsets);
        }
        let knots = (0..n)
            .map(|i| {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
                let slope = (offsets[b] - offsets[a]) / ((b - a).max(1) as f64 * spacing);
                let stretch = (1.0 - at[i].curvature * offsets[i]).max(SHARE_MIN);
                LinePoint { offset: offsets[i], heading: slope.atan2(stretch), curvature: curvature[i] }
            })
            .collect();
        Self { density: 1.0 / spacing, knots }
    }

    /// At an arc length of the path [m]; beyond its ends the line goes straight on beside it.
    pub(in crate::plan) fn at(&self, s: f64) -> LinePoint {
        let Some((a, b, share)) = self.around(s) else {
            let end = if s > 0.0 { self.knots.last() } else { self.knots.first() };
            return LinePoint { offset: end.map_or(0.0, |knot| knot.offset), ..LinePoint::default() };
        };
        LinePoint {
            offset: a.offset + (b.offset - a.offset) * share,
            heading: a.heading + (b.heading - a.heading) * share,
            curvature: a.curvature + (b.curvature - a.curvature) * share,
        }
    }

    /// Curvature at an arc length of the path [1/m], as `at`.
    pub(in crate::plan) fn curvature_at(&self, s: f64) -> f64 {
        self.around(s).map_or(0.0, |(a, b, share)| a.curvature + (b.curvature - a.curvature) * share)
    }

    /// The knots before and behind an arc length [m], and how far it is between them; `None` beyond the ends.
    fn around(&self, s: f64) -> Option<(&LinePoint, &LinePoint, f64)> {
        let along = s * self.density;
        // Negative ones become 0.
        let i = along as usize;
        let pair = self.knots.get(i..i + 2).filter(|_| along >= 0.0)?;
        Some((&pair[0], &pair[1], along - i as f64))
    }
}

/// Distance of a point from a bound on its side [m], negative beyond the bound.
fn distance(from: Point, side: Point, bound: impl Iterator<Item = Point>) -> f64 {
    let points: Vec<Point> = bound.collect();
    let nearest = |a: Point, b: Point| {
        let along = b - a;
        let share = ((from - a).dot(along) / along.dot(along).max(1e-9)).clamp(0.0, 1.0);
        a + along * share - from
    };
    let found = points.windows(2).map(|pair| nearest(pair[0], pair[1]));
    let found = found.chain(points.first().map(|point| *point - from));
    let offset = found.min_by(|a, b| a.dot(*a).total_cmp(&b.dot(*b))).expect("a bound has a point");
    offset.dot(offset).sqrt().copysign(offset.dot(side))
}

/// The curvature of a line at each inner knot: constant + before, here, behind times the offsets there.
struct Bend {
    rows: Vec<[f64; 4]>,
}

impl Bend {
    fn new(centers: &[Point], normals: &[Point], stretch: &[f64], spacing: f64) -> Self {
        let inner = |i: usize| {
            let normal = normals[i];
            let way = (spacing * stretch[i]).powi(2);
            let constant = (centers[i - 1] - centers[i] * 2.0 + centers[i + 1]).dot(normal);
            [constant / way, normals[i - 1].dot(normal) / way, -2.0 / way, normals[i + 1].dot(normal) / way]
        };
        let n = centers.len();
        let mut rows: Vec<[f64; 4]> = (0..n).map(|i| if i == 0 || i + 1 >= n { [0.0; 4] } else { inner(i) }).collect();
        if n > 2 {
            // Beyond its ends the path bends on, and the line beside it: otherwise it would be straight there at any price.
            let ([constant, a, b, c], [last, d, e, f]) = (rows[1], rows[n - 2]);
            (rows[0], rows[n - 1]) = ([constant, 0.0, a + b, c], [last, d, e + f, 0.0]);
        }
        Self { rows }
    }

    fn curvature(&self, offsets: &[f64]) -> Vec<f64> {
        let n = offsets.len();
        (0..n)
            .map(|i| {
                let [constant, a, b, c] = self.rows[i];
                constant + a * offsets[i.saturating_sub(1)] + b * offsets[i] + c * offsets[(i + 1).min(n - 1)]
            })
            .collect()
    }

    /// The offsets of least curvature between limits [m], by the alternating direction method of multipliers (Boyd et al.,
    /// Foundations and Trends in Machine Learning 3, 2011, section 5.2), with what they are within the limits and the prices
    /// of that, which go on from the last call.
    fn least(&self, limits: &[(f64, f64)], within: &mut [f64], price: &mut [f64]) -> Vec<f64> {
        let n = self.rows.len();
        // The normal equations: the diagonal and two beside it.
        let mut band = vec![[RETURN + PENALTY, 0.0, 0.0]; n];
        let mut bend = vec![0.0; n];
        for (i, &[constant, a, b, c]) in self.rows.iter().enumerate() {
            for (k, value) in [(i.wrapping_sub(1), a), (i, b), (i + 1, c)] {
                if let Some(diagonal) = band.get_mut(k) {
                    diagonal[0] += value * value;
                    bend[k] -= value * constant;
                }
            }
            if i > 0 {
                band[i - 1][1] += a * b;
                band[i - 1][2] += a * c;
            }
            band[i][1] += b * c;
        }
        let factors = factors(band);
        let mut offsets = vec![0.0; n];
        for _ in 0..STEPS {
            for (((offset, bend), within), price) in offsets.iter_mut().zip(&bend).zip(&*within).zip(&*price) {
                *offset = bend + PENALTY * (within - price);
            }
            solve(&factors, &mut offsets);
            for (((offset, (low, high)), within), price) in
                offsets.iter().zip(limits).zip(&mut *within).zip(&mut *price)
            {
                let free = OVER * offset + (1.0 - OVER) * *within + *price;
                *within = free.clamp(*low, *high);
                *price = free - *within;
            }
        }
        offsets
    }
}

/// Cholesky's factors L D Lᵀ of a symmetric positive definite matrix with two diagonals beside the main one: D, and the two
/// diagonals below that of L.
fn factors(mut band: Vec<[f64; 3]>) -> Vec<[f64; 3]> {
    let n = band.len();
    for i in 0..n {
        let [pivot, one, two] = band[i];
        band[i] = [pivot, one / pivot, two / pivot];
        if i + 1 < n {
            band[i + 1][0] -= one / pivot * one;
            band[i + 1][1] -= one / pivot * two;
        }
        if i + 2 < n {
            band[i + 2][0] -= two / pivot * two;
        }
    }
    band
}

/// Solves the equations with these factors in place. The last two values stay in registers: each waits for them.
fn solve(factors: &[[f64; 3]], right: &mut [f64]) {
    // What the row before, and the one before that, take away from the next value: the farther one first.
    let (mut before, mut far) = ((0.0, [0.0; 3]), (0.0, [0.0; 3]));
    for (value, factor) in right.iter_mut().zip(factors) {
        *value -= far.1[2] * far.0;
        *value -= before.1[1] * before.0;
        (far, before) = (before, (*value, *factor));
    }
    let (mut next, mut after) = (0.0, 0.0);
    for (value, [pivot, one, two]) in right.iter_mut().zip(factors).rev() {
        *value = *value / pivot - one * next - two * after;
        (after, next) = (next, *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::wrap_angle;
    use crate::road::testing::{arc, straight};

    /// A quarter of a circle of radius 20 m between straights, with a lane of a width [m].
    fn bend(width: f64) -> (ReferencePath, DrivingLine) {
        let mut center = straight((0.0, 0.0), (60.0, 0.0));
        center.extend(arc((60.0, 20.0), 20.0, -std::f64::consts::FRAC_PI_2, 0.0).into_iter().skip(1));
        center.extend(straight((80.0, 20.0), (80.0, 100.0)).into_iter().skip(1));
        let path = ReferencePath::through(&center).expect("a path");
        let vehicle = Vehicle::of_type(2).expect("a car");
        let line = DrivingLine::within(&path, &vehicle, |s| {
            let at = path.at(s);
            Some((at.offset(0.5 * width), at.offset(-0.5 * width)))
        });
        (path, line)
    }

    #[test]
    fn a_bend_is_cut_as_far_as_the_lane_has_room_for_the_vehicle() {
        let (path, line) = bend(3.1);
        let middle = 60.0 + 0.25 * std::f64::consts::PI * 20.0;
        // 1.55 m to the edge, less half the car's width of 1.61 m and 0.3 m; before the bend it drives outside.
        let apex = line.at(middle).offset;
        assert!((apex - 0.445).abs() < 0.03, "{apex} m");
        assert!(line.at(50.0).offset < -0.2, "{} m", line.at(50.0).offset);
        let inside = |s: &f64| line.at(*s).offset.abs() < 0.48;
        assert!((0..300).map(|i| 0.5 * f64::from(i)).all(|s| inside(&s)));
        // The way in and out is gentler than the path, which bends by 1/20 from 60 m on.
        let bends = |at: &dyn Fn(f64) -> f64| (0..300).map(|i| at(0.5 * f64::from(i)).powi(2) * 0.5).sum::<f64>();
        let (own, path) = (bends(&|s| line.at(s).curvature), bends(&|s| path.curvature_at(s)));
        assert!(own < 0.9 * path, "{own} against {path} 1/m");
    }

    #[test]
    fn where_the_lane_is_as_wide_as_the_vehicle_the_line_is_its_middle() {
        let (path, line) = bend(1.9);
        for s in (0..300).map(|i| 0.5 * f64::from(i)) {
            assert!(line.at(s).offset.abs() < 0.03, "{} m at {s} m", line.at(s).offset);
        }
        assert!((line.at(75.0).curvature - path.curvature_at(75.0)).abs() < 0.005);
    }

    #[test]
    fn a_path_that_ends_in_a_bend_is_cut_up_to_its_end() {
        let path = ReferencePath::through(&arc((0.0, 0.0), 18.5, 0.0, 3.9)).expect("a path");
        let vehicle = Vehicle::of_type(2).expect("a car");
        let line = DrivingLine::within(&path, &vehicle, |s| {
            let at = path.at(s);
            Some((at.offset(1.75), at.offset(-1.75)))
        });
        // 1.75 m to the edge, less half the car's width and 0.3 m.
        for s in (0..70).map(f64::from) {
            let point = line.at(s);
            assert!((point.offset - 0.645).abs() < 0.02 && point.heading.abs() < 0.01, "{point:?} at {s} m");
        }
        let beyond = line.at(path.length() + 5.0);
        assert!((beyond.offset - 0.645).abs() < 0.02 && beyond.curvature == 0.0, "{beyond:?}");
    }

    #[test]
    fn heading_and_curvature_are_those_of_the_offsets() {
        let (path, line) = bend(3.5);
        let at = |s: f64| path.at(s).offset(line.at(s).offset);
        for s in [45.0, 58.0, 66.0, 75.0, 90.0, 110.0] {
            let (a, b) = (at(s - 0.5), at(s + 0.5));
            let heading = (b - a).dot(path.at(s).tangent().left()).atan2((b - a).dot(path.at(s).tangent()));
            assert!((heading - line.at(s).heading).abs() < 0.01, "{s} m: {heading} rad, {:?}", line.at(s));
            let turn = wrap_angle(
                (path.at(s + 1.0).theta + line.at(s + 1.0).heading)
                    - (path.at(s - 1.0).theta + line.at(s - 1.0).heading),
            );
            let curvature = turn / at(s - 1.0).distance(at(s + 1.0));
            assert!((curvature - line.at(s).curvature).abs() < 0.006, "{s} m: {curvature} 1/m, {:?}", line.at(s));
        }
    }
}
