//! The samples: motions along the path (rows) times end positions beside it (lanes).
//!
//! A row is a function s(t); there is one for every end time and end speed, for every stop target, and two that brake.
//! A lane is an end position d. Rows that stay above `low_velocity` use lateral polynomials of time, which they share
//! with all rows of the same end time; the others use polynomials of arc length, which stay well defined at standstill.

use super::super::frame::Start;
use super::super::polynomial::{Braking, Polynomial};
use super::desired::Desired;
use super::feasibility::{Limits, Rejection};
use super::settings::FrenetSettings;
use crate::geometry::polyline::{PathPoint, ReferencePath};

/// Lateral polynomials of arc length extend over at least this distance [m]: a creeping agent plans further ahead than
/// it gets within the horizon, so its path does not depend on how far it gets.
const ARC_MIN: f64 = 5.0;
/// Speeds above minus this [m/s] count as 0.
const ROUNDING: f64 = 1e-3;
/// Decelerations of the braking rows as fractions of the largest one.
const BRAKING: [f64; 2] = [0.45, 0.9];
/// End times of stops, as multiples of the time scale of the stop.
const STOP_TIMES: [f64; 4] = [1.25, 1.6, 2.0, 2.4];

/// Arc length and its derivatives by time at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Motion {
    pub(super) s: f64,
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
    pub(super) jerk: f64,
}

/// Which lateral polynomials a row uses: of time, shared by all rows of an end time, or of arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lateral {
    pub(super) table: usize,
    pub(super) is_over_arc: bool,
}

/// One point of a quintic that comes to rest at the end position `lane`. The quintic is linear in its end value: value
/// and two derivatives are `home + lane step`, where `home` ends at 0 and `step` goes from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LateralPoint {
    pub(super) home: [f64; 3],
    pub(super) step: [f64; 3],
}

impl LateralPoint {
    /// Once the quintic has arrived.
    const ARRIVED: Self = Self { home: [0.0; 3], step: [1.0, 0.0, 0.0] };

    /// Offset and two derivatives.
    #[inline]
    pub(super) fn at(&self, lane: f64) -> [f64; 3] {
        [0, 1, 2].map(|k| self.home[k] + lane * self.step[k])
    }
}

/// One motion along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    /// When the motion ends [s]; from then on the speed is constant.
    pub(super) end_time: f64,
    /// Speed at the end, along the path [m/s].
    pub(super) end_velocity: f64,
    /// Root of the integral of the squared jerk over the horizon.
    pub(super) jerk: f64,
    pub(super) lateral: Lateral,
    /// Why all its samples are rejected.
    pub(super) rejection: Rejection,
    has_path: bool,
}

impl Row {
    const UNFINISHED: Self = Self {
        end_time: 0.0,
        end_velocity: 0.0,
        jerk: 0.0,
        lateral: Lateral { table: 0, is_over_arc: true },
        rejection: Rejection::Admissible,
        has_path: false,
    };
}

/// Lateral motions, by time or by arc length.
#[derive(Debug, Clone, Default)]
pub(super) struct LateralTables {
    /// (tables, points)
    points: Vec<LateralPoint>,
    /// Root of the integral of the squared lateral jerk over the horizon; (tables, lanes).
    pub(super) jerk: Vec<f64>,
    /// Root of the summed squares of the last half of the offsets; (tables, lanes).
    pub(super) offset: Vec<f64>,
}

impl LateralTables {
    fn clear(&mut self) {
        self.points.clear();
        self.jerk.clear();
        self.offset.clear();
    }

    /// Appends the quantities that are summed over points to the table that was written last.
    fn finish(&mut self, n_points: usize, lanes: &[f64], squared_jerk: impl Fn(f64) -> f64) {
        self.jerk.extend(lanes.iter().map(|lane| squared_jerk(*lane).max(0.0).sqrt()));
        let first = self.offset.len();
        self.offset.resize(first + lanes.len(), 0.0);
        let sums = &mut self.offset[first..];
        for point in &self.points[self.points.len() - n_points / 2..] {
            for (sum, lane) in sums.iter_mut().zip(lanes) {
                let d = point.home[0] + lane * point.step[0];
                *sum += d * d;
            }
        }
        for sum in sums {
            *sum = sum.sqrt();
        }
    }
}

/// What the samples are made from.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    pub(super) start: &'a Start,
    pub(super) desired: &'a Desired,
    pub(super) limits: &'a Limits,
    pub(super) settings: &'a FrenetSettings,
    pub(super) path: &'a ReferencePath,
    /// Also work out the lateral motion of rows that are rejected as a whole, for pictures.
    pub(super) with_rejected: bool,
}

/// All samples of one plan; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Samples {
    pub(super) n_points: usize,
    pub(super) dt: f64,
    /// End positions [m], ascending.
    pub(super) lanes: Vec<f64>,
    pub(super) rows: Vec<Row>,
    /// Largest arc length that a sample has at each point [m].
    pub(super) furthest: Vec<f64>,
    /// (rows, points)
    motions: Vec<Motion>,
    /// (rows, points), valid for rows that were looked at.
    path: Vec<PathPoint>,
    pub(super) lateral: LateralTables,
    end_times: Vec<f64>,
    velocities: Vec<f64>,
}

impl Samples {
    /// Fills in everything but the path points.
    pub(super) fn generate(&mut self, inputs: &Inputs) {
        let Inputs { start, desired, limits, settings, path, .. } = *inputs;
        self.dt = limits.dt;
        self.n_points = limits.n_points;
        for buffer in [&mut self.lanes, &mut self.end_times, &mut self.velocities] {
            buffer.clear();
        }
        self.rows.clear();
        self.motions.clear();
        self.furthest.clear();
        self.furthest.resize(self.n_points, start.s);
        self.lateral.clear();
        end_times(settings, &mut self.end_times);
        grid(-settings.d_max, settings.d_max, settings.level, start.d, &mut self.lanes);
        end_velocities(start, desired.velocity, limits, settings, &mut self.velocities);
        let from = [start.s, start.s_dot, start.s_ddot];
        for t in 0..self.end_times.len() {
            let end_time = self.end_times[t];
            let table = self.write_over_time(start, end_time);
            for v in 0..self.velocities.len() {
                let end_velocity = self.velocities[v];
                let s = Polynomial::to_slope(from, end_velocity, end_time);
                self.push_polynomial(&s, (end_time, end_velocity), Some(table), inputs);
            }
        }
        for target in desired.stop_targets.iter().flatten() {
            for factor in STOP_TIMES {
                let end_time = (factor * stop_time_scale(target - start.s, start.s_dot)).max(settings.t_min);
                self.push_polynomial(&Polynomial::to_rest(from, *target, end_time), (end_time, 0.0), None, inputs);
            }
        }
        for fraction in BRAKING {
            self.push_braking(&Braking::new(start.s_dot, start.s_ddot, fraction * limits.acceleration_max), inputs);
        }
        self.path.resize(self.motions.len(), path.at(start.s));
    }

    fn push_polynomial(
        &mut self,
        s: &Polynomial,
        (end_time, end_velocity): (f64, f64),
        time_table: Option<usize>,
        inputs: &Inputs,
    ) {
        let end = s.at(end_time)[0];
        self.motions.extend((0..self.n_points).map(|i| {
            let t = i as f64 * inputs.limits.dt;
            if t < end_time + 1e-9 {
                let [s, s_dot, s_ddot, jerk] = s.at(t);
                Motion { s, s_dot, s_ddot, jerk }
            } else {
                Motion { s: end + end_velocity * (t - end_time), s_dot: end_velocity, s_ddot: 0.0, jerk: 0.0 }
            }
        }));
        let jerk = s.squared_jerk(end_time.min(inputs.limits.horizon())).sqrt();
        let row = Row { end_time, end_velocity, jerk, ..Row::UNFINISHED };
        self.finish_row(row, end - inputs.start.s, time_table, inputs);
    }

    fn push_braking(&mut self, braking: &Braking, inputs: &Inputs) {
        self.motions.extend((0..self.n_points).map(|i| {
            let [distance, s_dot, s_ddot, jerk] = braking.at(i as f64 * inputs.limits.dt);
            Motion { s: inputs.start.s + distance, s_dot, s_ddot, jerk }
        }));
        let jerk = braking.squared_jerk(inputs.limits.horizon()).sqrt();
        let row = Row { end_time: braking.stop_time(), jerk, ..Row::UNFINISHED };
        self.finish_row(row, braking.at(braking.stop_time())[0], None, inputs);
    }

    /// Checks the motion that was written last and gives it its lateral polynomials.
    fn finish_row(&mut self, mut row: Row, distance: f64, time_table: Option<usize>, inputs: &Inputs) {
        let Inputs { start, limits, settings, path, with_rejected, .. } = *inputs;
        let first = self.rows.len() * self.n_points;
        let mut slowest = start.velocity;
        for (i, motion) in self.motions[first..].iter_mut().enumerate() {
            if motion.s_dot < -ROUNDING {
                row.rejection = row.rejection.or(Rejection::NegativeSpeed);
            }
            motion.s_dot = motion.s_dot.max(0.0);
            slowest = slowest.min(motion.s_dot);
            row.rejection = row.rejection.or(limits.check_along_path(motion.s_dot, motion.s_ddot, i));
            if !(0.0..=path.length()).contains(&motion.s) {
                row.rejection = row.rejection.or(Rejection::LeftPath);
            }
        }
        if row.rejection == Rejection::Admissible {
            for (furthest, motion) in self.furthest.iter_mut().zip(&self.motions[first..]) {
                *furthest = furthest.max(motion.s);
            }
        }
        row.lateral = match time_table {
            Some(table) if slowest >= settings.low_velocity => Lateral { table, is_over_arc: false },
            _ if with_rejected || row.rejection == Rejection::Admissible => {
                Lateral { table: self.write_over_arc(start, distance.max(ARC_MIN), first), is_over_arc: true }
            }
            _ => row.lateral,
        };
        self.rows.push(row);
    }

    fn write_over_time(&mut self, start: &Start, end_time: f64) -> usize {
        let s_dot = start.s_dot;
        let from = [start.d, s_dot * start.d_prime, start.s_ddot * start.d_prime + s_dot * s_dot * start.d_prime2];
        let home = Polynomial::to_rest(from, 0.0, end_time);
        let step = Polynomial::to_rest([0.0; 3], 1.0, end_time);
        let dt = self.dt;
        self.lateral.points.extend((0..self.n_points).map(|i| {
            let t = i as f64 * dt;
            if t < end_time + 1e-9 { joined(&home.at(t), &step.at(t)) } else { LateralPoint::ARRIVED }
        }));
        let jerk = |lane: f64| Polynomial::to_rest(from, lane, end_time).squared_jerk(end_time);
        self.lateral.finish(self.n_points, &self.lanes, jerk);
        self.lateral.points.len() / self.n_points - 1
    }

    /// The lateral jerk is d''' s_dot³ + 3 d'' s_dot s_ddot + d' s_dddot, integrated by the trapezoidal rule; linear in
    /// the end position like d itself. An agent that stands turns its wheels before it drives off: its second derivative
    /// is free.
    fn write_over_arc(&mut self, start: &Start, length: f64, first: usize) -> usize {
        let polynomial = |[d, d_1, d_2]: [f64; 3], end: f64| {
            if start.steers_freely() {
                Polynomial::to_rest_from_free([d, d_1], end, length)
            } else {
                Polynomial::to_rest([d, d_1, d_2], end, length)
            }
        };
        let home = polynomial([start.d, start.d_prime, start.d_prime2], 0.0);
        let step = polynomial([0.0; 3], 1.0);
        let (mut constant, mut linear, mut square) = (0.0, 0.0, 0.0);
        for (i, motion) in self.motions[first..].iter().enumerate() {
            let along = motion.s - start.s;
            if along >= length {
                self.lateral.points.push(LateralPoint::ARRIVED);
                continue;
            }
            let (a, b) = (home.at(along), step.at(along));
            self.lateral.points.push(joined(&a, &b));
            let Motion { s_dot, s_ddot, jerk, .. } = *motion;
            let by_time = |d: [f64; 4]| (d[3] * s_dot * s_dot + 3.0 * d[2] * s_ddot) * s_dot + d[1] * jerk;
            let (a, b) = (by_time(a), by_time(b));
            let weight = if i == 0 || i + 1 == self.n_points { 0.5 * self.dt } else { self.dt };
            constant += weight * a * a;
            linear += weight * 2.0 * a * b;
            square += weight * b * b;
        }
        self.lateral.finish(self.n_points, &self.lanes, |lane| constant + lane * (linear + lane * square));
        self.lateral.points.len() / self.n_points - 1
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.rows.len() * self.lanes.len()
    }

    /// Motion of a row at all points.
    pub(super) fn motions(&self, row: usize) -> &[Motion] {
        &self.motions[row * self.n_points..][..self.n_points]
    }

    /// Path points of a row; looked up when the row is first needed.
    pub(super) fn load_path(&mut self, row: usize, path: &ReferencePath) {
        if !std::mem::replace(&mut self.rows[row].has_path, true) {
            let range = row * self.n_points..(row + 1) * self.n_points;
            for (point, motion) in self.path[range.clone()].iter_mut().zip(&self.motions[range]) {
                *point = path.at(motion.s);
            }
        }
    }

    /// Path points of a row after `load_path`.
    pub(super) fn path(&self, row: usize) -> &[PathPoint] {
        &self.path[row * self.n_points..][..self.n_points]
    }

    /// Lateral motion of a row at all points.
    pub(super) fn lateral_points(&self, row: usize) -> &[LateralPoint] {
        &self.lateral.points[self.rows[row].lateral.table * self.n_points..][..self.n_points]
    }
}

/// The two parts of a lateral point.
#[inline]
fn joined(home: &[f64; 4], step: &[f64; 4]) -> LateralPoint {
    LateralPoint { home: [home[0], home[1], home[2]], step: [step[0], step[1], step[2]] }
}

/// 1.1 s, 1.4 s, ... and the horizon; the steps depend on the level.
fn end_times(settings: &FrenetSettings, out: &mut Vec<f64>) {
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
    const GENTLE: f64 = 1.5;
    // A quintic from rest to rest reaches 5.77 distance / time² in acceleration.
    let from_rest = (5.77 * distance / GENTLE).sqrt() / STOP_TIMES[1];
    if s_dot > 0.0 { (distance / s_dot).min(from_rest) } else { from_rest }
}
