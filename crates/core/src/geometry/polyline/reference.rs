//! The smooth path along which a planner works.
//!
//! Curvature is piecewise linear over uniform knots, heading its exact integral, and the knots' positions the integral
//! of the heading, so the four fit together everywhere. The curvature follows that of the smoothed vertices, with a
//! small correction towards them, like a driver's, so that integration does not drift away.

use super::smoothing::smoothed;
use crate::error::{Error, Result};
use crate::geometry::{Point, wrap_angle};
use crate::limits::PATH_LENGTH_MAX;
use crate::simd::multiversion;

/// Distance of the knots [m]; adjusted a little so that it divides the length.
const KNOT_SPACING: f64 = 0.5;
/// Tightest bend of a path [1/m]; vertices that ask for more are rounded further.
const CURVATURE_MAX: f64 = 0.5;
/// How fast an offset from the smoothed vertices is corrected [1/m].
const TRACKING_GAIN: f64 = 0.5;
/// Points farther away than this [m] have no projection.
const PROJECTION_REACH: f64 = 20.0;
/// How far beyond an end [m] a foot still counts as the end: rounding.
const END_TOLERANCE: f64 = 1e-6;

/// What a path is at one arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Position, world frame [m].
    pub position: Point,
    /// Heading [rad], without jumps along the path: not wrapped.
    pub theta: f64,
    /// Cosine of `theta`.
    pub cos: f64,
    /// Sine of `theta`.
    pub sin: f64,
    /// Curvature [1/m], positive to the left.
    pub curvature: f64,
    /// Change of curvature by arc length [1/m²].
    pub curvature_rate: f64,
}

impl PathPoint {
    /// Unit vector along the path.
    #[inline]
    pub fn tangent(&self) -> Point {
        Point::new(self.cos, self.sin)
    }

    /// Arc length at lateral offset `d` [m] by arc length of the path: 1 - curvature d.
    #[inline(always)]
    pub fn stretch(&self, d: f64) -> f64 {
        1.0 - self.curvature * d
    }

    /// World position of a point at lateral offset `d` [m], left positive.
    #[inline(always)]
    pub fn offset(&self, d: f64) -> Point {
        self.position + Point::new(-self.sin, self.cos) * d
    }
}

/// One knot; the position is relative to the path's origin, so that no digits are lost far away.
#[derive(Debug, Clone, Copy)]
struct Knot {
    position: Point,
    tangent: Point,
    theta: f64,
    curvature: f64,
}

/// Path with continuous curvature and look-up in constant time.
#[derive(Debug, Clone)]
pub struct ReferencePath {
    origin: Point,
    spacing: f64,
    inverse_spacing: f64,
    /// Of the tightest bend [m].
    tightest_radius: f64,
    knots: Vec<Knot>,
    x: Vec<f64>,
    y: Vec<f64>,
    theta: Vec<f64>,
    curvature: Vec<f64>,
}

impl ReferencePath {
    /// A smooth path near the points: noise and kinks are rounded (see the module `smoothing`), typically by less than
    /// 0.3 m, by more only at kinks of over 25 degrees and in bends tighter than 4 m.
    ///
    /// # Errors
    /// `InvalidInput` if a coordinate is not a number or beyond the limits, fewer than two different points are given, or
    /// they are further apart than [`PATH_LENGTH_MAX`] altogether.
    pub fn through(points: &[Point]) -> Result<Self> {
        let length: f64 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        if length > PATH_LENGTH_MAX {
            return Err(Error::invalid(format!("a path of {length:.0} m is longer than {PATH_LENGTH_MAX:.0} m")));
        }
        let origin = points.first().copied().filter(|point| point.is_finite()).unwrap_or_default();
        let local: Vec<Point> = points.iter().map(|point| *point - origin).collect();
        let target = Target::new(smoothed(&local)?);
        let n = (target.length() / KNOT_SPACING).ceil().max(1.0) as usize;
        let spacing = target.length() / n as f64;
        let knots = target.follow(n, spacing);
        Ok(Self {
            x: knots.iter().map(|knot| origin.x + knot.position.x).collect(),
            y: knots.iter().map(|knot| origin.y + knot.position.y).collect(),
            theta: knots.iter().map(|knot| knot.theta).collect(),
            curvature: knots.iter().map(|knot| knot.curvature).collect(),
            origin,
            spacing,
            inverse_spacing: spacing.recip(),
            tightest_radius: knots.iter().map(|knot| knot.curvature.abs()).fold(0.0, f64::max).recip(),
            knots,
        })
    }

    /// Length [m].
    #[inline]
    pub fn length(&self) -> f64 {
        self.spacing * (self.knots.len() - 1) as f64
    }

    /// At most `n` steps of a length [m] from an arc length on, and no more than one beyond the end: behind it nothing
    /// changes any more.
    pub(crate) fn steps_from(&self, s: f64, step: f64, n: f64) -> usize {
        n.min(((self.length() - s) / step).ceil().max(0.0) + 1.0) as usize
    }

    /// Arc length between knots [m], about 0.5.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// x of the knots [m].
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// y of the knots [m].
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Headings of the knots [rad], not wrapped.
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// Curvatures of the knots [1/m].
    pub fn curvature(&self) -> &[f64] {
        &self.curvature
    }

    /// Positions of the knots.
    pub fn points(&self) -> Vec<Point> {
        self.knots.iter().map(|knot| self.origin + knot.position).collect()
    }

    /// Everything at an arc length [m], clamped to the ends.
    #[inline]
    pub fn at(&self, s: f64) -> PathPoint {
        let mut point = self.local_at(s);
        point.position = self.origin + point.position;
        point
    }

    /// Curvature at an arc length [m], clamped to the ends [1/m].
    #[inline]
    pub(crate) fn curvature_at(&self, s: f64) -> f64 {
        let s = s.clamp(0.0, self.length());
        let i = ((s * self.inverse_spacing) as u32 as usize).min(self.knots.len() - 2);
        let (a, b) = (self.curvature[i], self.curvature[i + 1]);
        a + (b - a) * self.inverse_spacing * (s - i as f64 * self.spacing)
    }

    /// As [`ReferencePath::at`] for several arc lengths at once: writes x, y, heading, its cosine and sine, curvature and its
    /// change, each for all of them.
    pub(crate) fn write_at(&self, s: &[f64], out: [&mut [f64]; 7]) {
        write_points(self, s, out);
    }

    /// `at`, with the position relative to the origin.
    #[inline]
    fn local_at(&self, s: f64) -> PathPoint {
        let s = s.clamp(0.0, self.length());
        let i = ((s * self.inverse_spacing) as usize).min(self.knots.len() - 2);
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        between(a, b, s - i as f64 * self.spacing, (self.spacing, self.inverse_spacing))
    }

    /// Arc length and lateral offset [m] of the nearest foot on the whole path: `at(s).offset(d)` is the point.
    /// `None` if the nearest point is an end without a perpendicular foot, or farther than 20 m.
    pub fn project(&self, point: Point) -> Option<(f64, f64)> {
        let (p, last) = (point - self.origin, self.knots.len() - 1);
        self.foot_in(p, 0, last, self.nearest_knot(p, 0, (0, last))).map(|(s, d, _)| (s, d))
    }

    /// The same among the arc lengths within `window` of `s_hint` [m]: the right branch where a path crosses itself.
    pub fn project_near(&self, point: Point, s_hint: f64, window: f64) -> Option<(f64, f64)> {
        let (p, (from, to)) = (point - self.origin, self.knots_within(s_hint, window));
        let hint = (s_hint * self.inverse_spacing) as usize;
        self.foot_in(p, from, to, self.nearest_knot(p, hint, (from, to))).map(|(s, d, _)| (s, d))
    }

    /// The same for a point whose foot is expected at `s_hint` [m]: from there knots are passed as long as they come
    /// nearer. Arc length and offset [m] of the foot, and what the path is there.
    pub fn project_from(&self, point: Point, s_hint: f64, window: f64) -> Option<(f64, f64, PathPoint)> {
        let (p, (from, to)) = (point - self.origin, self.knots_within(s_hint, window));
        if from >= to {
            return None;
        }
        let hint = (s_hint * self.inverse_spacing).round().clamp(from as f64, to as f64) as usize;
        let (s, d, mut at) = self.foot_in(p, from, to, self.nearest_knot_from(p, hint, (from, to)))?;
        at.position = self.origin + at.position;
        Some((s, d, at))
    }

    /// Whether a foot between two arc lengths [m] can be nearer to a point than a distance [m]; if not, there is none.
    pub fn may_pass(&self, point: Point, distance: f64, from: f64, to: f64) -> bool {
        /// Rounding.
        const SAFETY: f64 = 0.999;
        let (p, last) = (point - self.origin, (self.knots.len() - 1) as f64);
        let index = |s: f64| (s * self.inverse_spacing).clamp(0.0, last);
        let (mut i, to) = (index(from).floor() as usize, index(to).ceil() as usize);
        // A foot is not further from the nearest knot than the spacing, and neither is a knot from the next one.
        let reach = distance + self.spacing;
        while i <= to {
            let away = (p - self.knots[i].position).norm() - reach;
            // Not a number is not far.
            if away.is_nan() || away <= 0.0 {
                return true;
            }
            i += 1 + (away * self.inverse_spacing * SAFETY) as usize;
        }
        false
    }

    /// First and last knot within `window` of an arc length [m].
    fn knots_within(&self, s_hint: f64, window: f64) -> (usize, usize) {
        let last = (self.knots.len() - 1) as f64;
        let from = ((s_hint - window) / self.spacing).floor().clamp(0.0, last);
        let to = ((s_hint + window) / self.spacing).ceil().clamp(0.0, last);
        // NaN becomes 0 and leaves an empty window.
        (from as usize, to as usize)
    }

    /// The knot of the range at which the distance to a point (relative to the origin) stops to decrease, seen from `start`;
    /// the first one of equals.
    fn nearest_knot_from(&self, p: Point, start: usize, (from, to): (usize, usize)) -> usize {
        let squared = |i: usize| (p - self.knots[i].position).norm_squared();
        let (mut nearest, mut least) = (start, squared(start));
        while nearest < to && squared(nearest + 1) < least {
            nearest += 1;
            least = squared(nearest);
        }
        while nearest > from && squared(nearest - 1) <= least {
            nearest -= 1;
            least = squared(nearest);
        }
        nearest
    }

    /// The knot of the range that is nearest to a point (relative to the origin); the first one of equals. `hint` is where
    /// the search begins.
    ///
    /// Within the radius of the tightest bend the squared distance is a convex function of the arc length: a knot that is
    /// nearer than its neighbours is nearer than all that lie within what its distance leaves of that radius. Beyond, no
    /// knot is further from the next one than the spacing, so after a far knot all are skipped that cannot be nearer
    /// than the best.
    fn nearest_knot(&self, p: Point, hint: usize, (from, to): (usize, usize)) -> usize {
        /// Rounding.
        const SAFETY: f64 = 0.999;
        /// Share of the radius that is used.
        const CONVEX: f64 = 0.9;
        const STEPS: usize = 4;
        let squared = |i: usize| (p - self.knots[i].position).norm_squared();
        let mut start = hint.max(from).min(to);
        for _ in 0..STEPS {
            let knot = &self.knots[start];
            let ahead = (p - knot.position).dot(knot.tangent) * self.inverse_spacing;
            // Not a number stays.
            let next = (start as f64 + ahead).round().max(from as f64).min(to as f64) as usize;
            if ahead.is_nan() || next.abs_diff(start) <= 1 {
                break;
            }
            start = next;
        }
        let centre = self.nearest_knot_from(p, start, (from, to));
        let (mut nearest, mut least) = (centre, squared(centre));
        let mut distance = least.sqrt();
        let free = ((CONVEX * self.tightest_radius - distance) * self.inverse_spacing) as usize;
        let (below, above) = (centre.saturating_sub(free), centre.saturating_add(free));
        let mut i = from;
        while i <= to {
            if i >= below && i <= above {
                i = above.saturating_add(1);
                continue;
            }
            let here = squared(i);
            if here < least || (here == least && i < nearest) {
                (least, nearest) = (here, i);
                distance = least.sqrt();
                i += 1;
            } else {
                // Not a number becomes 0.
                i += 1 + ((here.sqrt() - distance) * self.inverse_spacing * SAFETY) as usize;
            }
        }
        nearest
    }

    /// From the nearest knot of a range to the zero of (point - position) . tangent beside it: arc length, offset [m], and
    /// what the path is there. Point and position are relative to the origin.
    fn foot_in(&self, p: Point, from: usize, to: usize, nearest: usize) -> Option<(f64, f64, PathPoint)> {
        if from >= to || !p.is_finite() {
            return None;
        }
        let ahead = |s: f64| {
            let at = self.local_at(s);
            let offset = p - at.position;
            (offset.dot(at.tangent()), at.tangent().cross(offset), at)
        };
        // The point is ahead of the lower end and behind the upper end of the interval with the foot, and the nearest
        // knot is one of both.
        let knot_s = nearest as f64 * self.spacing;
        let mut here = ahead(knot_s);
        let is_ahead = here.0 > 0.0;
        let other = if is_ahead { (nearest + 1).min(to) } else { nearest.saturating_sub(1).max(from) };
        let other_s = other as f64 * self.spacing;
        if other == nearest {
            let (distance_ahead, d, at) = here;
            return (distance_ahead.abs() < END_TOLERANCE && d.abs() <= PROJECTION_REACH).then_some((knot_s, d, at));
        }
        let (mut low, mut high) = if is_ahead { (knot_s, other_s) } else { (other_s, knot_s) };
        let mut s = knot_s;
        for _ in 0..60 {
            let (distance_ahead, offset, at) = here;
            if distance_ahead.abs() < 1e-11 {
                break;
            }
            if distance_ahead > 0.0 {
                low = s;
            } else {
                high = s;
            }
            let slope = 1.0 - at.curvature * offset;
            let newton = s + distance_ahead / slope;
            s = if slope > 0.05 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
            here = ahead(s);
        }
        let (distance_ahead, d, at) = here;
        (distance_ahead.abs() < END_TOLERANCE && d.abs() <= PROJECTION_REACH).then_some((s, d, at))
    }
}

multiversion! {
    fn write_points = points_at, (path: &ReferencePath, s: &[f64], out: [&mut [f64]; 7])
}

#[inline(always)]
fn points_at(path: &ReferencePath, s: &[f64], out: [&mut [f64]; 7]) {
    const LANES: usize = 8;
    let (spacing, inverse_spacing) = (path.spacing, path.inverse_spacing);
    let length = path.length();
    let [x, y, theta, cos, sin, curvature, curvature_rate] = out;
    let mut first = 0;
    while first + LANES <= s.len() {
        // First what has to be looked up one by one, then what can be computed at once.
        let nothing = [0.0; LANES];
        let (mut along, mut headings, mut from, mut to) = (nothing, nothing, [nothing; 5], [nothing; 5]);
        for k in 0..LANES {
            let s = s[first + k].clamp(0.0, length);
            let i = ((s * inverse_spacing) as usize).min(path.knots.len() - 2);
            let (a, b) = (&path.knots[i], &path.knots[i + 1]);
            along[k] = s - i as f64 * spacing;
            headings[k] = a.theta;
            for (knots, knot) in [(&mut from, a), (&mut to, b)] {
                (knots[0][k], knots[1][k]) = (knot.position.x, knot.position.y);
                (knots[2][k], knots[3][k]) = (knot.tangent.x, knot.tangent.y);
                knots[4][k] = knot.curvature;
            }
        }
        let group = first..first + LANES;
        let (x, y) = (&mut x[group.clone()], &mut y[group.clone()]);
        let (theta, cos, sin) = (&mut theta[group.clone()], &mut cos[group.clone()], &mut sin[group.clone()]);
        let (curvature, curvature_rate) = (&mut curvature[group.clone()], &mut curvature_rate[group]);
        for k in 0..LANES {
            let knot = |knots: &[[f64; LANES]; 5]| Knot {
                position: Point::new(knots[0][k], knots[1][k]),
                tangent: Point::new(knots[2][k], knots[3][k]),
                theta: headings[k],
                curvature: knots[4][k],
            };
            let at = between(&knot(&from), &knot(&to), along[k], (spacing, inverse_spacing));
            (x[k], y[k]) = (path.origin.x + at.position.x, path.origin.y + at.position.y);
            (theta[k], cos[k], sin[k]) = (at.theta, at.cos, at.sin);
            (curvature[k], curvature_rate[k]) = (at.curvature, at.curvature_rate);
        }
        first += LANES;
    }
    for i in first..s.len() {
        let at = path.at(s[i]);
        (x[i], y[i], theta[i]) = (at.position.x, at.position.y, at.theta);
        (cos[i], sin[i], curvature[i], curvature_rate[i]) = (at.cos, at.sin, at.curvature, at.curvature_rate);
    }
}

/// The path between two knots at an arc length from the first one [m].
#[inline(always)]
fn between(a: &Knot, b: &Knot, along: f64, (spacing, inverse_spacing): (f64, f64)) -> PathPoint {
    let u = along * inverse_spacing;
    let curvature_rate = (b.curvature - a.curvature) * inverse_spacing;
    let turn = along * (a.curvature + 0.5 * curvature_rate * along);
    let (sin_turn, cos_turn) = sin_cos_small(turn);
    let (u2, u3) = (u * u, u * u * u);
    // Cubic Hermite: knots and tangents are exact, in between it is off by less than 1e-4 m at 0.5 1/m.
    let position = a.position
        + (b.position - a.position) * (3.0 * u2 - 2.0 * u3)
        + (a.tangent * (u3 - 2.0 * u2 + u) + b.tangent * (u3 - u2)) * spacing;
    PathPoint {
        position,
        theta: a.theta + turn,
        cos: a.tangent.x * cos_turn - a.tangent.y * sin_turn,
        sin: a.tangent.y * cos_turn + a.tangent.x * sin_turn,
        curvature: a.curvature + curvature_rate * along,
        curvature_rate,
    }
}

/// Sine and cosine of the turn within one knot spacing, at most 0.25 rad (error below 1e-12).
#[inline(always)]
fn sin_cos_small(angle: f64) -> (f64, f64) {
    /// Taylor coefficients.
    const SIN: [f64; 4] = [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0];
    const COS: [f64; 5] = [-0.5, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40_320.0, -1.0 / 3_628_800.0];
    let a2 = angle * angle;
    let sin = angle + angle * a2 * (SIN[0] + a2 * (SIN[1] + a2 * (SIN[2] + a2 * SIN[3])));
    let cos = 1.0 + a2 * (COS[0] + a2 * (COS[1] + a2 * (COS[2] + a2 * (COS[3] + a2 * COS[4]))));
    (sin, cos)
}

/// The smoothed vertices as a curve over their index: cubic Hermite with central differences.
struct Target {
    points: Vec<Point>,
    slopes: Vec<Point>,
    curvatures: Vec<f64>,
    lengths: Vec<f64>,
}

impl Target {
    fn new(points: Vec<Point>) -> Self {
        let n = points.len();
        let inner = |i: usize| i.clamp(1, n - 2);
        // One parabola through three neighbours; at the ends that of the inner neighbour, evaluated at the end.
        let bend = |i: usize| points[inner(i) + 1] - points[inner(i)] * 2.0 + points[inner(i) - 1];
        let slopes: Vec<Point> = (0..n)
            .map(|i| {
                let middle = (points[inner(i) + 1] - points[inner(i) - 1]) * 0.5;
                middle + bend(i) * (i as f64 - inner(i) as f64)
            })
            .collect();
        let curvatures = (0..n).map(|i| slopes[i].cross(bend(i)) / slopes[i].norm().max(1e-3).powi(3)).collect();
        let mut target = Self { points, slopes, curvatures, lengths: Vec::new() };
        target.lengths = (0..n - 1)
            .map(|i| (target.slopes[i].norm() + 4.0 * target.slope(i, 0.5).norm() + target.slopes[i + 1].norm()) / 6.0)
            .collect();
        target
    }

    fn length(&self) -> f64 {
        self.lengths.iter().sum()
    }

    fn position(&self, i: usize, u: f64) -> Point {
        let (a, b) = (self.points[i], self.points[i + 1]);
        let (u2, u3) = (u * u, u * u * u);
        a + (b - a) * (3.0 * u2 - 2.0 * u3) + self.slopes[i] * (u3 - 2.0 * u2 + u) + self.slopes[i + 1] * (u3 - u2)
    }

    fn slope(&self, i: usize, u: f64) -> Point {
        let (a, b) = (self.points[i], self.points[i + 1]);
        let u2 = u * u;
        (b - a) * (6.0 * (u - u2))
            + self.slopes[i] * (3.0 * u2 - 4.0 * u + 1.0)
            + self.slopes[i + 1] * (3.0 * u2 - 2.0 * u)
    }

    /// Knots of a path that drives along the curve: curvature ahead plus a correction of the present offset.
    fn follow(&self, n: usize, spacing: f64) -> Vec<Knot> {
        let limited = |curvature: f64| curvature.clamp(-CURVATURE_MAX, CURVATURE_MAX);
        let start = self.slopes[0];
        let mut knot = Knot {
            position: self.points[0],
            tangent: start * (1.0 / start.norm()),
            theta: start.angle(),
            curvature: limited(self.curvatures[0]),
        };
        let mut knots = Vec::with_capacity(n + 1);
        knots.push(knot);
        let mut place = TargetPosition { segment: 0, u: 0.0 };
        for _ in 0..n {
            self.move_beside(&mut place, knot.position);
            let slope = self.slope(place.segment, place.u);
            let offset = slope.cross(knot.position - self.position(place.segment, place.u)) / slope.norm();
            let heading_error = wrap_angle(knot.theta - slope.angle());
            let ahead = self.curvature_ahead(place, spacing * slope.norm().recip());
            let correction = TRACKING_GAIN * (TRACKING_GAIN * offset.clamp(-2.0, 2.0) + 2.0 * heading_error);
            knot = next_knot(&knot, limited(ahead - correction), spacing);
            knots.push(knot);
        }
        knots
    }

    /// Moves to the foot of a position that is not far ahead.
    fn move_beside(&self, place: &mut TargetPosition, position: Point) {
        for _ in 0..4 {
            let slope = self.slope(place.segment, place.u);
            let ahead = (position - self.position(place.segment, place.u)).dot(slope) / slope.norm_squared().max(1e-6);
            *place = self.moved(*place, ahead.clamp(-1.0, 2.0));
        }
    }

    /// `place` moved by a number of segments, within the curve.
    fn moved(&self, place: TargetPosition, by: f64) -> TargetPosition {
        let parameter = (place.segment as f64 + place.u + by).clamp(0.0, (self.points.len() - 1) as f64);
        let segment = (parameter as usize).min(self.points.len() - 2);
        TargetPosition { segment, u: parameter - segment as f64 }
    }

    fn curvature_ahead(&self, place: TargetPosition, by: f64) -> f64 {
        let TargetPosition { segment, u } = self.moved(place, by);
        self.curvatures[segment] + u * (self.curvatures[segment + 1] - self.curvatures[segment])
    }
}

/// Position on a `Target`: segment and fraction of it.
#[derive(Clone, Copy)]
struct TargetPosition {
    segment: usize,
    u: f64,
}

/// The knot one spacing further if curvature changes linearly: Gauss-Legendre with three nodes over cos and sin.
fn next_knot(knot: &Knot, curvature: f64, spacing: f64) -> Knot {
    const NODES: [(f64, f64); 3] =
        [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
    let rate = (curvature - knot.curvature) / spacing;
    let theta_at = |along: f64| knot.theta + along * (knot.curvature + 0.5 * rate * along);
    let mut position = knot.position;
    for (node, weight) in NODES {
        position = position + Point::from_angle(theta_at(node * spacing)) * (weight * spacing);
    }
    let theta = theta_at(spacing);
    Knot { position, tangent: Point::from_angle(theta), theta, curvature }
}

#[cfg(test)]
mod tests;
