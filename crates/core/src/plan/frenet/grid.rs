//! The samples: motions along the path (profiles) times lateral end offsets.
//!
//! A profile is a function s(t); there is one for every end time and end speed, for every stop target, and two that brake.
//! An end offset is a lateral position d. Profiles that stay above `low_velocity` use lateral polynomials of time, which they share
//! with all profiles of the same end time; the others use polynomials of arc length, which stay well defined at standstill.

use super::super::frame::Start;
use super::super::polynomial::{Braking, Polynomial};
use super::feasibility::{Limits, LongitudinalLimits, Rejection};
use super::lateral::{LateralPoints, LateralTables, LongitudinalMotion, turning_length};
use super::profiles::{LongitudinalProfile, PathPoints, ProfileCurve, ProfilePoints};
use super::settings::FrenetSettings;
use super::targets::Targets;
use super::velocity_keeping_profiles::{CoarseSpeeds, N_MOTION, SIMD_POINTS, VelocityKeepingProfiles};
use crate::barrier::Barriers;
use crate::geometry::polyline::ReferencePath;

/// Lateral polynomials of arc length extend over at least this distance [m]: a creeping agent plans further ahead than
/// it gets within the horizon, so its path does not depend on how far it gets.
pub(super) const ARC_MIN: f64 = 5.0;
/// Slow agents return to the path so gently that the wheels turn fast enough at this share of the speed that they have
/// or want: on a shorter way they could not become faster, on a longer one they would stay beside the path.
const TURNING_SPEED: f64 = 0.8;
/// Speeds above minus this [m/s] count as 0.
pub(super) const ROUNDING: f64 = 1e-3;
/// Motions that stay away from the ends of the path by this are surely on it [m]: speeds that count as 0 may be negative.
const PATH_END: f64 = 0.1;
/// Decelerations of the braking profiles as fractions of the largest one.
const BRAKING: [f64; 2] = [0.45, 0.9];
/// End times of stops, as multiples of the time scale of the stop.
const STOP_TIMES: [f64; 4] = [1.25, 1.6, 2.0, 2.4];

/// What the samples are made from.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub(super) start: &'a Start,
    pub(super) targets: &'a Targets,
    pub(super) limits: &'a Limits,
    pub(super) settings: &'a FrenetSettings,
    pub(super) path: &'a ReferencePath,
}

/// Numbers per point of a profile's path.
const N_PATH: usize = 7;

/// All samples of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct SampleGrid {
    pub(super) n_points: usize,
    /// Points of a profile with padding: a multiple of `SIMD_POINTS`; the last point is repeated.
    pub(super) stride: usize,
    pub(super) dt: f64,
    /// End positions [m], ascending.
    pub(super) end_offsets: Vec<f64>,
    pub(super) profiles: Vec<LongitudinalProfile>,
    /// Least arc length of lateral polynomials of arc length [m].
    pub(super) arc_min: f64,
    /// Largest arc length that a sample has at each point [m], with padding.
    pub(super) furthest: Vec<f64>,
    pub(super) lateral: LateralTables,
    /// Speeds that the motions of families are made of are at most this and their end speed together [m/s].
    pub(super) speed_scale: f64,
    /// When the points are [s], with padding.
    times: Vec<f64>,
    velocity_keeping: VelocityKeepingProfiles,
    /// (profiles that were looked at, arc length and derivatives, points with padding)
    motions: Vec<f64>,
    /// (profiles that were looked at, what is known, points with padding)
    path: Vec<f64>,
    end_times: Vec<f64>,
    velocities: Vec<f64>,
    /// Of the profile at hand.
    along: Vec<f64>,
    jerks: Vec<f64>,
    /// Arc lengths that no sample passes [m], and until when.
    barriers: Barriers,
    /// State of the start, as far as lateral motions need it.
    start: [f64; 4],
    is_free: bool,
}

impl SampleGrid {
    /// All motions along the path, and the shared lateral motions.
    pub(super) fn generate(&mut self, inputs: &Inputs) {
        let Inputs { start, targets, limits, settings, .. } = *inputs;
        self.dt = limits.dt;
        self.n_points = limits.n_points;
        self.stride = limits.n_points.next_multiple_of(SIMD_POINTS);
        for buffer in [&mut self.end_offsets, &mut self.end_times, &mut self.velocities, &mut self.times] {
            buffer.clear();
        }
        self.times.extend((0..self.stride).map(|i| i.min(self.n_points - 1) as f64 * self.dt));
        self.profiles.clear();
        self.velocity_keeping.clear(self.stride);
        self.motions.clear();
        self.path.clear();
        self.furthest.clear();
        self.furthest.resize(self.stride, start.s);
        self.lateral.clear((self.n_points, self.stride), targets.offset);
        self.start = [start.s, start.d, start.d_prime, start.d_prime2];
        self.is_free = start.steers_freely();
        self.arc_min = arc_min(inputs);
        self.barriers = targets.barriers;
        end_times(settings, &mut self.end_times);
        end_offsets(settings, start.d, &mut self.end_offsets);
        insert(&mut self.end_offsets, 0.0);
        insert(&mut self.end_offsets, targets.offset);
        end_velocities(start, targets.velocity, limits, settings, &mut self.velocities);
        // No sample accelerates beyond the limit, not even to get out of another one's way.
        let most = targets.limit.max(targets.velocity).max(start.s_dot);
        self.velocities.retain(|velocity| *velocity <= most + 1e-6);
        let from = [start.s, start.s_dot, start.s_ddot];
        self.speed_scale = start.s_dot.abs() + start.s_ddot.abs() * settings.horizon;
        let along = limits.along_path(ROUNDING, settings.low_velocity);
        let beside = beside(start);
        for t in 0..self.end_times.len() {
            let end_time = self.end_times[t];
            let table = self.lateral.push_over_time(beside, end_time, &self.times, &self.end_offsets);
            let family = self.velocity_keeping.push(from, end_time, &self.times);
            let mut fastest = None;
            for v in 0..self.velocities.len() {
                if self.push_member((family, table), end_time, self.velocities[v], &along, inputs) {
                    fastest = Some(self.velocities[v]);
                }
            }
            if let Some(fastest) = fastest {
                self.velocity_keeping.raise(family, fastest, &mut self.furthest);
            }
        }
        for target in targets.stops.iter().flatten() {
            for factor in STOP_TIMES {
                let end_time = (factor * stop_time_scale(target - start.s, start.s_dot)).max(settings.t_min);
                let s = Polynomial::to_rest(from, *target, end_time);
                self.push_stop(s, end_time, inputs);
            }
        }
        for fraction in BRAKING {
            self.push_braking(Braking::new(start.s_dot, start.s_ddot, fraction * limits.acceleration_max), inputs);
        }
    }

    /// Adds the profile of a family that ends at a speed; says whether it is admissible.
    fn push_member(
        &mut self,
        (family, table): (usize, usize),
        end_time: f64,
        end_velocity: f64,
        along: &LongitudinalLimits,
        inputs: &Inputs,
    ) -> bool {
        let Inputs { start, limits, settings, path, .. } = *inputs;
        let found = self.velocity_keeping.check(family, end_velocity, along);
        let s = Polynomial::to_slope([start.s, start.s_dot, start.s_ddot], end_velocity, end_time);
        let is_slow = found.is_slow || start.velocity < settings.low_velocity;
        self.profiles.push(LongitudinalProfile {
            curve: ProfileCurve::Polynomial(s),
            end_time,
            end_velocity,
            jerk: s.squared_jerk(end_time.min(limits.horizon())).sqrt(),
            is_over_arc: is_slow,
            table: (!is_slow).then_some(table),
            rejection: Rejection::Admissible,
            family: Some(family),
            motion: None,
            path: None,
        });
        // Where it is at the end is where it gets at most, if it never goes backwards; that is looked at below.
        let place = |time: f64| s.at(end_time.min(time))[0] + end_velocity * (time - end_time.min(time));
        if self.barriers.iter().any(|one| place(one.until.min(limits.horizon())) > one.s) {
            self.profiles.last_mut().expect("it was pushed").rejection = Rejection::StopLine;
            return false;
        }
        let stays = start.s >= PATH_END && place(limits.horizon()) <= path.length() - PATH_END;
        if stays && !found.is_doubtful {
            return true;
        }
        self.write_member(self.profiles.len() - 1);
        self.check_last(inputs)
    }

    fn push_stop(&mut self, s: Polynomial, end_time: f64, inputs: &Inputs) {
        let (stride, end, first) = (self.stride, s.at(end_time)[0], self.motions.len());
        let out = push(&mut self.motions, N_MOTION * stride);
        for (i, time) in self.times.iter().enumerate() {
            let [place, speed, acceleration, _] =
                if *time < end_time + 1e-9 { s.at(*time) } else { [end, 0.0, 0.0, 0.0] };
            (out[i], out[stride + i], out[2 * stride + i]) = (place, speed, acceleration);
        }
        let jerk = s.squared_jerk(end_time.min(inputs.limits.horizon())).sqrt();
        self.push_alone(ProfileCurve::Polynomial(s), end_time, jerk, first, inputs);
    }

    fn push_braking(&mut self, braking: Braking, inputs: &Inputs) {
        let (stride, first) = (self.stride, self.motions.len());
        let out = push(&mut self.motions, N_MOTION * stride);
        for (i, time) in self.times.iter().enumerate() {
            let [distance, s_dot, s_ddot, _] = braking.at(*time);
            (out[i], out[stride + i], out[2 * stride + i]) = (inputs.start.s + distance, s_dot, s_ddot);
        }
        let jerk = braking.squared_jerk(inputs.limits.horizon()).sqrt();
        self.push_alone(ProfileCurve::Braking(braking), braking.stop_time(), jerk, first, inputs);
    }

    /// Adds a profile without family that ends at rest and whose motion is written already.
    fn push_alone(&mut self, curve: ProfileCurve, end_time: f64, jerk: f64, motion: usize, inputs: &Inputs) {
        self.profiles.push(LongitudinalProfile {
            curve,
            end_time,
            end_velocity: 0.0,
            jerk,
            is_over_arc: true,
            table: None,
            rejection: Rejection::Admissible,
            family: None,
            motion: Some(motion),
            path: None,
        });
        if self.check_last(inputs) {
            for (furthest, s) in self.furthest.iter_mut().zip(&self.motions[motion..motion + self.stride]) {
                *furthest = furthest.max(*s);
            }
        }
    }

    /// Checks the last profile, whose motion was written last, and makes its speeds non-negative.
    fn check_last(&mut self, inputs: &Inputs) -> bool {
        let Inputs { limits, path, .. } = *inputs;
        let profile = self.profiles.last_mut().expect("a profile");
        let first = self.motions.len() - N_MOTION * self.stride;
        let (s, rest) = self.motions[first..].split_at_mut(self.stride);
        let (s_dot, s_ddot) = rest.split_at_mut(self.stride);
        for i in 0..self.n_points {
            if s_dot[i] < -ROUNDING {
                profile.rejection = Rejection::NegativeSpeed;
            }
            profile.rejection = profile.rejection.or(limits.check_along_path(s_dot[i].max(0.0), s_ddot[i], i));
            if self.barriers.iter().any(|one| s[i] > one.s && self.times[i] < one.until) {
                profile.rejection = profile.rejection.or(Rejection::StopLine);
            }
            if !(0.0..=path.length()).contains(&s[i]) {
                profile.rejection = profile.rejection.or(Rejection::LeftPath);
            }
            if profile.rejection != Rejection::Admissible {
                break;
            }
        }
        not_negative(s_dot);
        profile.rejection == Rejection::Admissible
    }

    /// Writes the motion of a profile of a family.
    fn write_member(&mut self, profile: usize) {
        let LongitudinalProfile { family, end_velocity, .. } = self.profiles[profile];
        self.profiles[profile].motion = Some(self.motions.len());
        let out = push(&mut self.motions, N_MOTION * self.stride);
        self.velocity_keeping.write(family.expect("a family"), end_velocity, out);
    }

    /// Writes the motion of a profile when it is first needed.
    pub(super) fn load_motion(&mut self, profile: usize) {
        if self.profiles[profile].motion.is_none() {
            let first = self.motions.len();
            self.write_member(profile);
            not_negative(&mut self.motions[first + self.stride..first + 2 * self.stride]);
        }
    }

    /// The table of a profile's lateral motion, which is made if it is not there yet.
    ///
    /// An agent that stands turns its wheels before it drives off: the second derivative of its offset is free.
    pub(super) fn lateral_table(&mut self, profile: usize) -> usize {
        if let Some(table) = self.profiles[profile].table {
            return table;
        }
        self.load_motion(profile);
        let LongitudinalProfile { curve, end_time, motion, .. } = self.profiles[profile];
        let [start, d, d_prime, d_prime2] = self.start;
        let (s, rest) = self.motions[motion.expect("it is loaded")..][..N_MOTION * self.stride].split_at(self.stride);
        let (s_dot, s_ddot) = rest.split_at(self.stride);
        self.along.clear();
        self.jerks.clear();
        for (s, time) in s.iter().zip(&self.times) {
            self.along.push(s - start);
            self.jerks.push(match curve {
                ProfileCurve::Polynomial(s) if *time < end_time + 1e-9 => s.at(*time)[3],
                ProfileCurve::Polynomial(_) => 0.0,
                ProfileCurve::Braking(braking) => braking.at(*time)[3],
            });
        }
        let motion = LongitudinalMotion { s: &self.along, s_dot, s_ddot, jerk: &self.jerks };
        let length = self.lateral_length(profile);
        let from = [d, d_prime, d_prime2];
        let table = self.lateral.push_over_arc(from, self.is_free, length, &motion, self.dt, &self.end_offsets);
        self.profiles[profile].table = Some(table);
        table
    }

    /// Arc length over which a lateral polynomial of arc length extends [m].
    fn lateral_length(&self, profile: usize) -> f64 {
        let LongitudinalProfile { curve, end_time, .. } = self.profiles[profile];
        let distance = match curve {
            ProfileCurve::Polynomial(s) => s.at(end_time)[0] - self.start[0],
            ProfileCurve::Braking(braking) => braking.at(end_time)[0],
        };
        distance.max(self.arc_min)
    }

    /// Bounds of a lateral motion that is not made yet, whatever the end offset: of its offset [m] and of its slope.
    ///
    /// A quintic from (d, d', d'') to rest after L is d plus the way to its end times a function that rises from 0 to 1
    /// with a slope of at most 15 / (8 L), plus L d' and L² d'' times functions below 0.2 and 0.018, whose slopes times
    /// L are at most 1 and 0.07. Where d'' is free, the bounds are smaller.
    pub(super) fn lateral_bounds(&self, profile: usize) -> [f64; 2] {
        let [_, d, d_prime, d_prime2] = self.start;
        let length = self.lateral_length(profile);
        let (first, last) = (self.end_offsets[0], self.end_offsets[self.end_offsets.len() - 1]);
        let widest = first.abs().max(last.abs()).max(d.abs());
        let way = (first - d).abs().max((last - d).abs());
        let bend = length * d_prime2.abs();
        [widest + length * (0.2 * d_prime.abs() + 0.018 * bend), 1.875 * way / length + d_prime.abs() + 0.07 * bend]
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.profiles.len() * self.end_offsets.len()
    }

    /// Motion of a profile at all points after `load_motion`.
    pub(super) fn motions(&self, profile: usize) -> ProfilePoints<'_> {
        let first = self.profiles[profile].motion.expect("the motion was written");
        let part = |k: usize| &self.motions[first + k * self.stride..][..self.stride];
        ProfilePoints { s: part(0), s_dot: part(1), s_ddot: part(2) }
    }

    /// Speeds of a profile that belongs to a family, whether it is written or not.
    #[inline]
    pub(super) fn coarse_speeds(&self, profile: usize) -> Option<CoarseSpeeds<'_>> {
        let LongitudinalProfile { family, end_velocity, .. } = &self.profiles[profile];
        family.map(|family| self.velocity_keeping.speeds(family, *end_velocity))
    }

    /// Arc length of a profile at the end of the horizon [m].
    #[inline]
    pub(super) fn last_place(&self, profile: usize) -> f64 {
        let (last, LongitudinalProfile { family, end_velocity, .. }) = (self.n_points - 1, &self.profiles[profile]);
        family.map_or_else(
            || self.motions(profile).s[last],
            |family| self.velocity_keeping.arc_length(family, *end_velocity, last),
        )
    }

    /// Looks up the path points of a profile when they are first needed.
    pub(super) fn load_path(&mut self, profile: usize, path: &ReferencePath) {
        if self.profiles[profile].path.is_some() {
            return;
        }
        self.load_motion(profile);
        let stride = self.stride;
        let s = &self.motions[self.profiles[profile].motion.expect("it is loaded")..][..stride];
        self.profiles[profile].path = Some(self.path.len());
        let mut parts = push(&mut self.path, N_PATH * stride).chunks_exact_mut(stride);
        path.write_at(s, std::array::from_fn(|_| parts.next().expect("room for all of them")));
    }

    /// Path points of a profile after `load_path`.
    pub(super) fn path(&self, profile: usize) -> PathPoints<'_> {
        let first = self.profiles[profile].path.expect("the path was looked up");
        let part = |k: usize| &self.path[first + k * self.stride..][..self.stride];
        PathPoints {
            x: part(0),
            y: part(1),
            theta: part(2),
            cos: part(3),
            sin: part(4),
            curvature: part(5),
            curvature_rate: part(6),
        }
    }

    /// Lateral motion of a profile at all points after `lateral_table`.
    pub(super) fn lateral_points(&self, profile: usize) -> LateralPoints<'_> {
        self.lateral.points(self.profiles[profile].table.expect("the lateral motion is there"))
    }
}

/// Offset and its derivatives by time.
fn beside(start: &Start) -> [f64; 3] {
    let s_dot = start.s_dot;
    [start.d, s_dot * start.d_prime, start.s_ddot * start.d_prime + s_dot * s_dot * start.d_prime2]
}

/// Least arc length of lateral polynomials of arc length [m].
fn arc_min(inputs: &Inputs) -> f64 {
    let Inputs { start, targets, limits, settings, .. } = *inputs;
    if start.velocity >= settings.low_velocity {
        return ARC_MIN;
    }
    let velocity = TURNING_SPEED * start.velocity.max(targets.velocity);
    turning_length(
        [start.d - targets.offset, start.d_prime, start.d_prime2],
        limits.curvature_rate() / velocity,
        ARC_MIN,
    )
}

/// Room for `n` more numbers.
fn push(buffer: &mut Vec<f64>, n: usize) -> &mut [f64] {
    let first = buffer.len();
    buffer.resize(first + n, 0.0);
    &mut buffer[first..]
}

/// Speeds slightly below 0 become 0.
fn not_negative(speeds: &mut [f64]) {
    for speed in speeds {
        *speed = if *speed > 0.0 { *speed } else { 0.0 };
    }
}

/// 1.1 s, 1.4 s, ... and the horizon; the steps depend on the level.
fn end_times(settings: &FrenetSettings, out: &mut Vec<f64>) {
    /// By level [s]; 0.3 s is that of the published planner.
    const STEPS: [f64; 5] = [1.0, 0.5, 0.3, 0.2, 0.2];
    let step = STEPS[settings.level.min(4)];
    out.extend((0..).map(|k| settings.t_min + f64::from(k) * step).take_while(|t| *t < settings.horizon - 1e-6));
    out.push(settings.horizon);
}

/// Evenly spaced values, ends included, and one more; ascending.
fn grid(low: f64, high: f64, level: usize, extra: f64, out: &mut Vec<f64>) {
    let n = 2_usize << level;
    out.extend((0..=n).map(|i| low + (high - low) * i as f64 / n as f64));
    insert(out, extra);
}

/// Lateral end positions, closer to each other near the path, and one more; ascending: 0, 0.19, 0.75, 1.69 and 3 m to
/// both sides at level 2. Where the road is narrow, some decimetres decide.
fn end_offsets(settings: &FrenetSettings, extra: f64, out: &mut Vec<f64>) {
    let n = 1_i32 << settings.level;
    let share = |i: i32| f64::from(i) / f64::from(n);
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

/// From standstill or the hardest braking to a brisk acceleration; the present speed; and the desired speed in the
/// place of the inner grid value next to it.
fn end_velocities(start: &Start, desired: f64, limits: &Limits, settings: &FrenetSettings, out: &mut Vec<f64>) {
    let low = (start.velocity - settings.horizon * limits.acceleration_max).max(0.0);
    let high = (start.velocity + settings.horizon * limits.acceleration_max / 6.0)
        .min(limits.velocity_max.max(start.velocity));
    grid(low, high, settings.level, low, out);
    let inner = out.len() - 1;
    let is_new = (desired - start.s_dot).abs() > 1e-6;
    if is_new && desired > low && desired < high && inner > 1 {
        let nearest = ((desired - low) / (high - low) * inner as f64).round() as usize;
        out[nearest.clamp(1, inner - 1)] = desired;
    }
    insert(out, start.s_dot);
}

/// Natural time of a stop: distance over speed, or for a slow agent that of a gentle move from rest to rest.
fn stop_time_scale(distance: f64, s_dot: f64) -> f64 {
    /// Largest acceleration of that move [m/s²].
    const GENTLE: f64 = 1.5;
    // A quintic from rest to rest reaches 5.77 distance / time² in acceleration.
    let from_rest = (5.77 * distance / GENTLE).sqrt() / STOP_TIMES[1];
    if s_dot > 0.0 { (distance / s_dot).min(from_rest) } else { from_rest }
}
