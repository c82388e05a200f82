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
use crate::trajectory::{Predictions, State};
use crate::vehicle::Vehicle;
use crate::vehicle::single_track::steering_angle;
pub use crowd::{ObservedBody, bodies, past_steps};
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
    pub limits: &'a SpeedLimits,
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

/// Writes numbers one after the other.
struct Writer<'a> {
    out: &'a mut [f32],
    next: usize,
}

impl Writer<'_> {
    #[inline(always)]
    fn put(&mut self, value: f64, scale: f64) {
        let scaled = (value / scale).clamp(-1.0, 1.0);
        self.out[self.next] = if scaled.is_nan() { 0.0 } else { scaled as f32 };
        self.next += 1;
    }

    #[inline(always)]
    fn flag(&mut self, value: bool) {
        self.put(f64::from(u8::from(value)), 1.0);
    }

    /// Sine and cosine of the angle between two unit vectors.
    #[inline(always)]
    fn turn(&mut self, from: Point, to: Point) {
        self.put(from.cross(to), 1.0);
        self.put(from.dot(to), 1.0);
    }

    fn zeros(&mut self, n: usize) {
        self.out[self.next..self.next + n].fill(0.0);
        self.next += n;
    }
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

/// Writes all blocks. `seen` are the participants that the observer sees, in any order.
pub fn observe<'a>(
    observer: &Observer<'_>,
    seen: impl Iterator<Item = &'a ObservedBody> + Clone,
    settings: &ObservationSettings,
    memory: &mut ObservationMemory,
    out: &mut [f32],
) {
    let state = observer.state;
    let frame = Frame { origin: Point::new(state.x, state.y), axis: Point::from_angle(state.orientation) };
    let mut writer = Writer { out, next: 0 };
    ego(observer, &frame, &mut writer);
    goal(observer, &frame, &mut writer);
    route(observer, &frame, settings.route, &mut writer);
    partners::nearest(&frame, seen.clone(), settings.partners, &mut memory.partners);
    partners::write(observer, &frame, seen.clone(), settings.partners, &memory.partners, &mut writer);
    edges::write(observer, &frame, settings.edges, &mut memory.edges, &mut writer);
    partners::write_predictions(observer, &frame, seen, settings.predicted(), &memory.partners, &mut writer);
}

fn ego(observer: &Observer<'_>, frame: &Frame, out: &mut Writer<'_>) {
    let Observer { state, vehicle, route, table, limits, s, .. } = *observer;
    let axle = frame.origin - frame.axis * vehicle.rear_axle_to_center;
    let at = route.path.at(s);
    let offset = axle - at.position;
    let q = s + vehicle.rear_axle_to_center;
    let beside = route.path.at(q);
    let center_offset = beside.tangent().cross(frame.origin - beside.position);
    let [left, right] = table.at(q);
    out.put(state.velocity, 40.0);
    out.put(state.acceleration, 10.0);
    out.put(state.yaw_rate, 1.0);
    out.put(steering_angle(vehicle, state, at.curvature), vehicle.steering_angle_max);
    out.put(at.tangent().cross(offset), 10.0);
    out.turn(at.tangent(), frame.axis);
    out.put(at.curvature, 0.2);
    out.put(state.velocity * state.yaw_rate, vehicle.lateral_acceleration_max);
    out.put(vehicle.forward_acceleration_max(state.velocity), 12.0);
    out.put(vehicle.length, 20.0);
    out.put(vehicle.width, 4.0);
    out.put(left - center_offset, 10.0);
    out.put(right + center_offset, 10.0);
    out.put(limits.at(q), 40.0);
    out.flag(at.tangent().dot(offset).abs() > FOOT_TOLERANCE);
}

fn goal(observer: &Observer<'_>, frame: &Frame, out: &mut Writer<'_>) {
    let Observer { state, vehicle, route, table, goal, s, time_step, dt, last_time_step, .. } = *observer;
    let q = s + vehicle.rear_axle_to_center;
    let wanted = &goal.states[table.alternative];
    let along = |to: f64| if to.is_nan() { f64::INFINITY } else { to - q };
    out.put(along(route.goal_entry_s), 200.0);
    out.put(along(route.goal_exit_s), 200.0);
    let center = table.goal_center.map_or(Point::default(), |center| frame.place(center));
    out.put(center.x, 200.0);
    out.put(center.y, 200.0);
    for then in [wanted.time_step.0, wanted.time_step.1, last_time_step.unwrap_or(wanted.time_step.1)] {
        out.put((then - time_step) as f64 * dt, 20.0);
    }
    let (lowest, highest) = wanted.velocity.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    out.put(lowest - state.velocity, 40.0);
    out.put(highest - state.velocity, 40.0);
    match wanted.orientation {
        Some((low, high)) => {
            let (sin, cos) = wrap_angle(low + 0.5 * (high - low) - state.orientation).sin_cos();
            out.put(sin, 1.0);
            out.put(cos, 1.0);
        }
        None => out.zeros(2),
    }
    out.flag(table.goal_center.is_some());
}

fn route(observer: &Observer<'_>, frame: &Frame, n: usize, out: &mut Writer<'_>) {
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
            out.zeros(8);
            continue;
        }
        let place = frame.place(Point::new(x[i], y[i]));
        let [left, right] = table.at(arc_lengths[i]);
        out.flag(true);
        out.put(place.x, 100.0);
        out.put(place.y, 100.0);
        out.turn(frame.axis, Point::new(cos[i], sin[i]));
        out.put(curvature[i], 0.2);
        out.put(left, 10.0);
        out.put(right, 10.0);
    }
}
