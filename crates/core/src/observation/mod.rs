//! What a learner or a learned planner observes: numbers from -1 to 1 in the frame of the observer (origin its footprint
//! centre, x ahead, y left). It sees what planners see: present and past, no ids, no plans, no recorded future.

mod crowd;
mod edges;
pub mod layout;
mod partners;
mod path_table;
mod raster;
mod settings;
#[cfg(test)]
mod tests;

use crate::geometry::{Point, wrap_angle};
use crate::road::RoadNetwork;
use crate::route::Route;
use crate::rules::SpeedLimits;
use crate::scenario::Goal;
use crate::simd::multiversion;
use crate::trajectory::{Predictions, State};
use crate::vehicle::Vehicle;
use crate::vehicle::single_track::steering_angle;
pub(crate) use crowd::present_bodies;
pub use crowd::{ObservedBody, bodies, past_steps};
use layout::factors;
pub use path_table::PathTable;
pub use raster::{LAYERS, PIXELS, SIDE, draw};
pub use settings::{AHEAD, Form, ObservationSettings};

/// The path's foot may be this far ahead of or behind the rear axle [m] before the observer counts as beyond its ends.
const FOOT_TOLERANCE: f64 = 0.5;

/// The observing vehicle and its knowledge of itself.
#[derive(Debug, Clone, Copy)]
pub struct Observer<'a> {
    /// Its state.
    pub state: &'a State,
    /// Its parameters.
    pub vehicle: &'a Vehicle,
    /// Its route.
    pub route: &'a Route,
    /// Precomputed information about the route.
    pub table: &'a PathTable,
    /// Speed limits along the path.
    pub(crate) limits: &'a SpeedLimits,
    /// Its goal.
    pub goal: &'a Goal,
    /// The roads.
    pub road: &'a RoadNetwork,
    /// Predictions of others, if any.
    pub predictions: Option<&'a Predictions>,
    /// Arc length of its rear axle on the path [m].
    pub s: f64,
    /// Now.
    pub time_step: i64,
    /// Time between steps [s].
    pub dt: f64,
    /// Last time step of the grace period; `None` if the goal has no end.
    pub last_time_step: Option<i64>,
}

/// Memory of observers; holds no state.
#[derive(Debug, Clone, Default)]
pub struct ObservationMemory {
    partners: Vec<(f64, i64, usize)>,
    edges: Vec<(f64, usize)>,
}

/// Writes rows of numbers one after the other.
struct Writer<'a> {
    out: &'a mut [f32],
}

impl<'a> Writer<'a> {
    /// A row, each number times its factor.
    #[inline(always)]
    fn row<const N: usize>(&mut self, values: [f64; N], factors: &[f64; N]) {
        let out = self.take(N);
        for i in 0..N {
            let scaled = values[i] * factors[i];
            let bounded = if scaled > 1.0 { 1.0 } else { scaled };
            let bounded = if bounded < -1.0 { -1.0 } else { bounded };
            out[i] = if bounded.is_nan() { 0.0 } else { bounded as f32 };
        }
    }

    #[inline(always)]
    fn zeros(&mut self, n: usize) {
        self.take(n).fill(0.0);
    }

    #[inline(always)]
    fn take(&mut self, n: usize) -> &'a mut [f32] {
        let (part, rest) = std::mem::take(&mut self.out).split_at_mut(n);
        self.out = rest;
        part
    }
}

/// 1 or 0.
#[inline(always)]
fn flag(value: bool) -> f64 {
    f64::from(u8::from(value))
}

/// The frame of an observer.
#[derive(Debug, Clone, Copy)]
struct Frame {
    origin: Point,
    axis: Point,
}

impl Frame {
    #[inline(always)]
    fn turn(&self, vector: Point) -> Point {
        Point::new(self.axis.dot(vector), self.axis.cross(vector))
    }

    #[inline(always)]
    fn place(&self, point: Point) -> Point {
        self.turn(point - self.origin)
    }
}

multiversion! {
    /// Writes all blocks. `seen` are those of the bodies that the observer sees, in any order.
    pub fn observe = observe_all, (
        observer: &Observer<'_>,
        bodies: &[ObservedBody],
        seen: &[usize],
        settings: &ObservationSettings,
        memory: &mut ObservationMemory,
        out: &mut [f32],
    )
}

#[inline(always)]
fn observe_all(
    observer: &Observer<'_>,
    bodies: &[ObservedBody],
    seen: &[usize],
    settings: &ObservationSettings,
    memory: &mut ObservationMemory,
    out: &mut [f32],
) {
    let state = observer.state;
    let frame = Frame { origin: Point::new(state.x, state.y), axis: Point::from_angle(state.orientation) };
    let mut writer = Writer { out };
    ego(observer, &frame, &mut writer);
    goal(observer, &frame, &mut writer);
    route(observer, &frame, settings.route, &mut writer);
    let ObservationMemory { partners, edges } = memory;
    partners::nearest(&frame, bodies, seen, settings.partners, partners);
    partners::write(observer, &frame, bodies, settings.partners, partners, &mut writer);
    edges::write(observer, &frame, settings.edges, edges, &mut writer);
    partners::write_predictions(observer, &frame, bodies, settings.predicted(), partners, &mut writer);
}

#[inline(always)]
fn ego(observer: &Observer<'_>, frame: &Frame, out: &mut Writer<'_>) {
    const FACTORS: [f64; 16] = factors(layout::EGO);
    let Observer { state, vehicle, route, table, limits, s, .. } = *observer;
    let axle = frame.origin - frame.axis * vehicle.rear_axle_to_center;
    let at = route.path.at(s);
    let offset = axle - at.position;
    let q = s + vehicle.rear_axle_to_center;
    let beside = route.path.at(q);
    let center_offset = beside.tangent().cross(frame.origin - beside.position);
    let [left, right] = table.at(q);
    let values = [
        state.velocity,
        state.acceleration,
        state.yaw_rate,
        steering_angle(vehicle, state, at.curvature) / vehicle.steering_angle_max,
        at.tangent().cross(offset),
        at.tangent().cross(frame.axis),
        at.tangent().dot(frame.axis),
        at.curvature,
        state.velocity * state.yaw_rate / vehicle.lateral_acceleration_max,
        vehicle.forward_acceleration_max(state.velocity),
        vehicle.length,
        vehicle.width,
        left - center_offset,
        right + center_offset,
        limits.at(q),
        flag(at.tangent().dot(offset).abs() > FOOT_TOLERANCE),
    ];
    out.row(values, &FACTORS);
}

#[inline(always)]
fn goal(observer: &Observer<'_>, frame: &Frame, out: &mut Writer<'_>) {
    const FACTORS: [f64; 12] = factors(layout::GOAL);
    let Observer { state, vehicle, route, table, goal, s, time_step, dt, last_time_step, .. } = *observer;
    let q = s + vehicle.rear_axle_to_center;
    let wanted = &goal.states[table.alternative];
    let along = |to: f64| if to.is_nan() { f64::INFINITY } else { to - q };
    let center = table.goal_center.map_or(Point::default(), |center| frame.place(center));
    let until = |then: i64| (then - time_step) as f64 * dt;
    let (lowest, highest) = wanted.velocity.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let (sin, cos) = wanted
        .orientation
        .map_or((0.0, 0.0), |(low, high)| wrap_angle(low + 0.5 * (high - low) - state.orientation).sin_cos());
    let values = [
        along(route.goal_entry_s),
        along(route.goal_exit_s),
        center.x,
        center.y,
        until(wanted.time_step.0),
        until(wanted.time_step.1),
        until(last_time_step.unwrap_or(wanted.time_step.1)),
        lowest - state.velocity,
        highest - state.velocity,
        sin,
        cos,
        flag(table.goal_center.is_some()),
    ];
    out.row(values, &FACTORS);
}

#[inline(always)]
fn route(observer: &Observer<'_>, frame: &Frame, n: usize, out: &mut Writer<'_>) {
    const FACTORS: [f64; 8] = factors(layout::ROUTE);
    let Observer { vehicle, route, table, s, .. } = *observer;
    let q = s + vehicle.rear_axle_to_center;
    let length = route.path.length();
    let (mut arc_lengths, mut fields) = ([0.0; AHEAD.len()], [[0.0; AHEAD.len()]; 7]);
    for (s, ahead) in arc_lengths.iter_mut().zip(AHEAD) {
        *s = q + ahead;
    }
    let [x, y, theta, cos, sin, curvature, rate] = &mut fields;
    let parts = [x, y, theta, cos, sin, curvature, rate].map(|field| &mut field[..n]);
    route.path.write_at(&arc_lengths[..n], parts);
    let [x, y, _, cos, sin, curvature, _] = &fields;
    for i in 0..n {
        if arc_lengths[i] > length {
            out.zeros(FACTORS.len());
            continue;
        }
        let place = frame.place(Point::new(x[i], y[i]));
        let tangent = Point::new(cos[i], sin[i]);
        let [left, right] = table.at(arc_lengths[i]);
        let (sin, cos) = (frame.axis.cross(tangent), frame.axis.dot(tangent));
        out.row([1.0, place.x, place.y, sin, cos, curvature[i], left, right], &FACTORS);
    }
}
