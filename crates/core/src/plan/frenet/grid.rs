//! The samples: motions along the path (profiles) times lateral end offsets.
//!
//! A profile is a function s(t); there is one for every end time and end speed, for every stop target, and two that brake.
//! An end offset is a lateral position d. Profiles that stay above `low_velocity` use lateral polynomials of time, which they share
//! with all profiles of the same end time; the others use polynomials of arc length, which stay well defined at standstill.

use super::super::frame::{FrenetPoint, Start};
use super::super::polynomial::{Braking, Polynomial};
use super::Problem;
use super::feasibility::{Limits, Rejection};
use super::lateral::{LateralPoint, LateralTables, turning_length};
use super::profiles::{Family, LongitudinalProfile, ProfilePoint};
use super::settings::FrenetSettings;
use crate::barrier::Barrier;
use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;

/// Lateral polynomials of arc length extend over at least this distance [m]: a creeping agent plans further ahead than
/// it gets within the horizon, so its path does not depend on how far it gets.
pub(super) const ARC_MIN: f64 = 5.0;
/// Slow agents return to the path so gently that the wheels turn fast enough at this share of the speed that they have
/// or want: on a shorter way they could not become faster, on a longer one they would stay beside the path.
const TURNING_SPEED: f64 = 0.8;
/// Speeds above minus this [m/s] count as 0.
pub(super) const ROUNDING: f64 = 1e-3;
/// A speed below that for polynomials of time by no more than this [m/s] is rounded.
const LOW_VELOCITY_ROUNDING: f64 = 1e-7;
/// Decelerations of the braking profiles as fractions of the largest one.
const BRAKING: [f64; 2] = [0.45, 0.9];
/// End times of stops, as multiples of the time scale of the stop.
const STOP_TIMES: [f64; 4] = [1.25, 1.6, 2.0, 2.4];

/// All samples of one plan, numbered profile by profile, end offset by end offset; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct SampleGrid {
    pub(super) n_points: usize,
    /// End positions [m], ascending.
    pub(super) end_offsets: Vec<f64>,
    pub(super) profiles: Vec<LongitudinalProfile>,
    pub(super) lateral: LateralTables,
    /// Least arc length of lateral polynomials of arc length [m].
    arc_min: f64,
    /// When the points are [s].
    times: Vec<f64>,
    /// (profiles, points)
    motions: Vec<ProfilePoint>,
    /// Of the end time at hand.
    family: Vec<Family>,
}

impl SampleGrid {
    /// All motions along the path, and all lateral motions.
    pub(super) fn generate(&mut self, problem: &Problem) {
        let Problem { start, targets, limits, settings, .. } = problem;
        self.n_points = limits.n_points;
        self.times.clear();
        self.times.extend((0..self.n_points).map(|i| i as f64 * limits.dt));
        self.profiles.clear();
        self.motions.clear();
        self.lateral.clear(self.n_points, targets.offset);
        self.arc_min = arc_min(problem);
        end_offsets(settings, start.d, &mut self.end_offsets);
        insert(&mut self.end_offsets, 0.0);
        insert(&mut self.end_offsets, targets.offset);
        let mut velocities = end_velocities(start, targets.velocity, limits, settings);
        // No sample accelerates beyond the limit, not even to get out of another one's way.
        let most = targets.limit.max(targets.velocity).max(start.s_dot);
        velocities.retain(|velocity| *velocity <= most + 1e-6);
        for end_time in end_times(settings) {
            self.push_family(problem, end_time, &velocities);
        }
        let from = [start.s, start.s_dot, start.s_ddot];
        for target in targets.stops.iter().flatten() {
            for factor in STOP_TIMES {
                let end_time = (factor * stop_time_scale(target - start.s, start.s_dot)).max(settings.t_min);
                let s = Polynomial::to_rest(from, *target, end_time);
                let at = |time: f64| ProfilePoint::keeping_velocity(&s, (end_time, 0.0), time);
                self.motions.extend(self.times.iter().map(|time| at(*time)));
                let jerk = s.squared_jerk(end_time.min(limits.horizon())).sqrt();
                self.push_alone(problem, end_time, jerk, s.at(end_time)[0] - start.s);
            }
        }
        for fraction in BRAKING {
            let braking = Braking::new(start.s_dot, start.s_ddot, fraction * limits.acceleration_max);
            let at = |time: f64| {
                let [distance, s_dot, s_ddot, jerk] = braking.at(time);
                ProfilePoint { s: start.s + distance, s_dot, s_ddot, jerk }
            };
            self.motions.extend(self.times.iter().map(|time| at(*time)));
            let (end_time, jerk) = (braking.stop_time(), braking.squared_jerk(limits.horizon()).sqrt());
            self.push_alone(problem, end_time, jerk, braking.at(end_time)[0]);
        }
    }

    /// Adds the profiles that reach the speeds at a time.
    fn push_family(&mut self, problem: &Problem, end_time: f64, velocities: &[f64]) {
        let Problem { start, targets, limits, settings, .. } = problem;
        let from = [start.s, start.s_dot, start.s_ddot];
        let shared = self.lateral.push_over_time(beside(start), end_time, &self.times, &self.end_offsets);
        self.family.clear();
        self.family.extend(Family::along(from, end_time, &self.times));
        for end_velocity in velocities.iter().copied() {
            let s = Polynomial::to_slope(from, end_velocity, end_time);
            let first = self.motions.len();
            for (family, time) in self.family.iter().zip(&self.times) {
                let jerk = if *time < end_time + 1e-9 { s.at(*time)[3] } else { 0.0 };
                self.motions.push(family.member(end_velocity, jerk));
            }
            let is_slow = |point: &ProfilePoint| point.s_dot < settings.low_velocity - LOW_VELOCITY_ROUNDING;
            let is_over_arc = start.velocity < settings.low_velocity || self.motions[first..].iter().any(is_slow);
            // Where it is at the end is where it gets at most, if it never goes backwards; that is looked at below.
            let place = |time: f64| s.at(end_time.min(time))[0] + end_velocity * (time - end_time.min(time));
            let is_beyond = |one: &Barrier| place(one.until.min(limits.horizon())) > one.s;
            let checked = self.check_last(problem);
            let rejection = if targets.barriers.iter().any(is_beyond) { Rejection::StopLine } else { checked };
            let profile = LongitudinalProfile {
                end_time,
                end_velocity,
                jerk: s.squared_jerk(end_time.min(limits.horizon())).sqrt(),
                is_over_arc,
                table: shared,
                rejection,
            };
            self.push(problem, profile, s.at(end_time)[0] - start.s);
        }
    }

    /// Adds a profile that ends at rest and whose motion was written last.
    fn push_alone(&mut self, problem: &Problem, end_time: f64, jerk: f64, distance: f64) {
        let rejection = self.check_last(problem);
        let profile = LongitudinalProfile { end_time, end_velocity: 0.0, jerk, is_over_arc: true, table: 0, rejection };
        self.push(problem, profile, distance);
    }

    /// Adds a profile whose motion was written last, with its lateral motions if they are its own: polynomials of arc length
    /// over the distance that it has made at its end.
    ///
    /// An agent that stands turns its wheels before it drives off: the second derivative of its offset is free.
    fn push(&mut self, problem: &Problem, profile: LongitudinalProfile, distance: f64) {
        let Problem { start, limits, .. } = problem;
        let mut table = profile.table;
        if profile.is_over_arc {
            let from = [start.d, start.d_prime, start.d_prime2];
            let motion = &self.motions[self.motions.len() - self.n_points..];
            let beside = (start.s, &self.end_offsets[..]);
            let is_free = start.steers_freely();
            let length = distance.max(self.arc_min);
            table = self.lateral.push_over_arc(from, is_free, length, (motion, limits.dt), beside);
        }
        self.profiles.push(LongitudinalProfile { table, ..profile });
    }

    /// Checks the motion that was written last, and makes its speeds non-negative.
    fn check_last(&mut self, problem: &Problem) -> Rejection {
        let (limits, barriers) = (&problem.limits, &problem.targets.barriers);
        let on_path = 0.0..=problem.request.route.path.length();
        let first = self.motions.len() - self.n_points;
        let mut points = self.motions[first..].iter().zip(&self.times).enumerate();
        let found = points.find_map(|(i, (point, time))| {
            let of_limits = limits.check_along_path(point.s_dot.max(0.0), point.s_ddot, i);
            if point.s_dot < -ROUNDING {
                Some(Rejection::NegativeSpeed)
            } else if of_limits != Rejection::Admissible {
                Some(of_limits)
            } else if barriers.iter().any(|one| point.s > one.s && *time < one.until) {
                Some(Rejection::StopLine)
            } else {
                (!on_path.contains(&point.s)).then_some(Rejection::LeftPath)
            }
        });
        for point in &mut self.motions[first..] {
            point.s_dot = if point.s_dot > 0.0 { point.s_dot } else { 0.0 };
        }
        found.unwrap_or(Rejection::Admissible)
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.profiles.len() * self.end_offsets.len()
    }

    /// Profile and end offset of a sample.
    pub(super) fn cell(&self, sample: usize) -> (usize, f64) {
        let n_offsets = self.end_offsets.len();
        (sample / n_offsets, self.end_offsets[sample % n_offsets])
    }

    /// Motion of a profile at all points.
    pub(super) fn motion(&self, profile: usize) -> &[ProfilePoint] {
        &self.motions[profile * self.n_points..][..self.n_points]
    }

    /// Lateral motions of a profile at all points.
    pub(super) fn beside(&self, profile: usize) -> &[LateralPoint] {
        self.lateral.points(self.profiles[profile].table)
    }

    /// A circle that holds the rear axles of all admissible samples at a point: its centre and radius [m]. All places on a
    /// stretch of the path are within half of its length of its middle.
    pub(super) fn reach(&self, i: usize, path: &ReferencePath) -> (Point, f64) {
        let admissible = |profile: &usize| self.profiles[*profile].rejection == Rejection::Admissible;
        let places = (0..self.profiles.len()).filter(admissible).map(|profile| self.motion(profile)[i].s);
        let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (s.min(low), s.max(high)));
        let outer = [self.end_offsets[0], self.end_offsets[self.end_offsets.len() - 1]];
        (path.at(0.5 * (low + high)).position, 0.5 * (high - low) + self.lateral.widest(i, outer))
    }

    /// Arc length, and place in the frame of the path, of a sample at a point.
    pub(super) fn at(&self, sample: usize, i: usize) -> (f64, FrenetPoint) {
        let (profile, end_offset) = self.cell(sample);
        let ProfilePoint { s, s_dot, s_ddot, .. } = self.motion(profile)[i];
        let [d, mut d_prime, mut d_prime2] = self.beside(profile)[i].to(end_offset);
        if !self.profiles[profile].is_over_arc {
            let per_speed = 1.0 / s_dot;
            d_prime *= per_speed;
            d_prime2 = (d_prime2 - d_prime * s_ddot) * (per_speed * per_speed);
        }
        (s, FrenetPoint { s_dot, s_ddot, d, d_prime, d_prime2 })
    }
}

/// Offset and its derivatives by time.
fn beside(start: &Start) -> [f64; 3] {
    let s_dot = start.s_dot;
    [start.d, s_dot * start.d_prime, start.s_ddot * start.d_prime + s_dot * s_dot * start.d_prime2]
}

/// Least arc length of lateral polynomials of arc length [m].
fn arc_min(problem: &Problem) -> f64 {
    let Problem { start, targets, limits, settings, .. } = problem;
    if start.velocity >= settings.low_velocity {
        return ARC_MIN;
    }
    let velocity = TURNING_SPEED * start.velocity.max(targets.velocity);
    let from = [start.d - targets.offset, start.d_prime, start.d_prime2];
    turning_length(from, limits.curvature_rate() / velocity, ARC_MIN)
}

/// 1.1 s, 1.4 s, ... and the horizon; the steps depend on the level.
fn end_times(settings: &FrenetSettings) -> impl Iterator<Item = f64> {
    /// By level [s]; 0.3 s is that of the published planner.
    const STEPS: [f64; 5] = [1.0, 0.5, 0.3, 0.2, 0.2];
    let FrenetSettings { t_min, horizon, level, .. } = *settings;
    let times = (0..).map(move |k| t_min + f64::from(k) * STEPS[level.min(4)]);
    times.take_while(move |time| *time < horizon - 1e-6).chain([horizon])
}

/// Lateral end positions, closer to each other near the path, and one more; ascending: 0, 0.19, 0.75, 1.69 and 3 m to
/// both sides at level 2. Where the road is narrow, some decimetres decide.
fn end_offsets(settings: &FrenetSettings, extra: f64, out: &mut Vec<f64>) {
    let n = 1_i32 << settings.level;
    let share = |i: i32| f64::from(i) / f64::from(n);
    out.clear();
    out.extend((-n..=n).map(|i| settings.d_max * share(i) * share(i).abs()));
    insert(out, extra);
}

/// Keeps the order; a value that is already there is not added.
fn insert(values: &mut Vec<f64>, value: f64) {
    let position = values.partition_point(|v| *v < value);
    let is_new = values.iter().all(|v| (v - value).abs() > 1e-6);
    if is_new {
        values.insert(position, value);
    }
}

/// Evenly from standstill or the hardest braking to a brisk acceleration; the present speed; and the desired speed in the
/// place of the inner grid value next to it.
fn end_velocities(start: &Start, desired: f64, limits: &Limits, settings: &FrenetSettings) -> Vec<f64> {
    let low = (start.velocity - settings.horizon * limits.acceleration_max).max(0.0);
    let high = (start.velocity + settings.horizon * limits.acceleration_max / 6.0)
        .min(limits.velocity_max.max(start.velocity));
    let n = 2_usize << settings.level;
    let mut out: Vec<f64> = (0..=n).map(|i| low + (high - low) * i as f64 / n as f64).collect();
    let is_new = (desired - start.s_dot).abs() > 1e-6;
    if is_new && desired > low && desired < high {
        let nearest = ((desired - low) / (high - low) * n as f64).round() as usize;
        out[nearest.clamp(1, n - 1)] = desired;
    }
    insert(&mut out, start.s_dot);
    out
}

/// Natural time of a stop: distance over speed, or for a slow agent that of a gentle move from rest to rest.
fn stop_time_scale(distance: f64, s_dot: f64) -> f64 {
    /// Largest acceleration of that move [m/s²].
    const GENTLE: f64 = 1.5;
    // A quintic from rest to rest reaches 5.77 distance / time² in acceleration.
    let from_rest = (5.77 * distance / GENTLE).sqrt() / STOP_TIMES[1];
    if s_dot > 0.0 { (distance / s_dot).min(from_rest) } else { from_rest }
}

#[cfg(test)]
mod tests {
    use super::super::tests::random_drive;
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn no_admissible_sample_is_out_of_reach() {
        let (mut random, mut samples, mut n_points) = (Lcg::new(31), SampleGrid::default(), 0);
        for _ in 0..60 {
            let settings = FrenetSettings { d_max: random.within(0.5, 8.0), ..FrenetSettings::default() };
            random_drive(&mut random).with_request(|request| {
                let Ok(problem) = Problem::new(request, &settings) else { return };
                samples.generate(&problem);
                let path = &request.route.path;
                for i in 0..samples.n_points {
                    let (center, radius) = samples.reach(i, path);
                    for sample in 0..samples.len() {
                        if samples.profiles[samples.cell(sample).0].rejection == Rejection::Admissible {
                            let (s, frenet) = samples.at(sample, i);
                            let distance = path.at(s).offset(frenet.d).distance(center);
                            assert!(distance <= radius + 0.01, "{distance} of {radius} m");
                            n_points += 1;
                        }
                    }
                }
            });
        }
        assert!(n_points > 100_000, "{n_points}");
    }

    #[test]
    fn profiles_over_time_stay_above_the_low_velocity() {
        let (mut random, mut samples, mut n_over_arc) = (Lcg::new(17), SampleGrid::default(), 0);
        for _ in 0..60 {
            let settings = FrenetSettings::default();
            random_drive(&mut random).with_request(|request| {
                let Ok(problem) = Problem::new(request, &settings) else { return };
                samples.generate(&problem);
                for (index, profile) in samples.profiles.iter().enumerate() {
                    let slowest = samples.motion(index).iter().map(|point| point.s_dot).fold(f64::INFINITY, f64::min);
                    assert!(slowest >= 0.0 && (profile.is_over_arc || slowest > 2.0 - 1e-6), "{slowest} m/s");
                    n_over_arc += usize::from(profile.is_over_arc);
                }
            });
        }
        assert!(n_over_arc > 500, "{n_over_arc}");
    }
}
