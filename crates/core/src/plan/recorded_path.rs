//! A recorded drive as a path with a time for every place, continued along the lane beyond its end.

use super::path_motion::RETURN_TIME;
use crate::error::{Error, Result};
use crate::geometry::polyline::ReferencePath;
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::scenario::Scenario;
use crate::trajectory::State;
use crate::vehicle::Vehicle;

/// The path begins this far before the first recorded position [m].
const LEAD_IN: f64 = 20.0;
/// Recorded positions nearer to each other than this add nothing but noise to the path [m].
const POINT_SPACING: f64 = 0.5;
/// The path goes on along the lane for this long [m], ...
const EXTENSION: f64 = 300.0;
/// ... in points this far apart [m].
const EXTENSION_SPACING: f64 = 2.0;
/// The last offset from the lane's centre is given up over `RETURN_TIME` at the last speed, at least this length [m].
const RETURN_LENGTH_MIN: f64 = 20.0;
/// Less than this is no motion [m].
const MOVED: f64 = 2.0;
/// The last position belongs to a lane within this distance [m].
const LANE_TOLERANCE: f64 = 1.5;

/// A recorded trajectory as a path: where the vehicle was when.
#[derive(Debug, Clone)]
pub struct RecordedPath {
    /// Time step of the first state.
    first_time_step: i64,
    /// Recorded states from there on (footprint centre).
    states: Vec<State>,
    /// Smooth path of the rear axle through the recorded positions and beyond.
    path: ReferencePath,
    /// Arc length of the rear axle at every recorded time step [m], not falling.
    s: Vec<f64>,
    /// Its change [m/s].
    velocity: Vec<f64>,
}

impl RecordedPath {
    /// The recording of a participant from a time step on.
    ///
    /// # Errors
    /// `InvalidInput` if there is none.
    pub fn new(scenario: &Scenario, id: i64, first_time_step: i64, vehicle: &Vehicle, planner: &str) -> Result<Self> {
        let recorded = &scenario.obstacles.states;
        let states: Vec<State> = recorded
            .row(id)
            .into_iter()
            .flat_map(|row| (first_time_step..).map_while(move |time_step| recorded.get(row, time_step)))
            .collect();
        if states.is_empty() {
            let when =
                recorded.row(id).map_or(String::new(), |_| format!(" at its start, time step {first_time_step}"));
            return Err(Error::invalid(format!(
                "agent {id} has no recording{when}, which planner {planner} needs: give it another planner"
            )));
        }
        let path = path_through(&states, vehicle, &scenario.road)
            .map_err(|error| Error::invalid(format!("the recording of agent {id} makes no path: {error}")))?;
        let s = arc_lengths(&states, vehicle, &path, scenario.dt);
        let velocity = speeds(&s, scenario.dt);
        Ok(Self { first_time_step, states, path, s, velocity })
    }

    /// Path of the rear axle.
    pub(super) fn path(&self) -> &ReferencePath {
        &self.path
    }

    /// Recorded state at a time step.
    pub(super) fn state(&self, time_step: i64) -> Option<&State> {
        usize::try_from(time_step - self.first_time_step).ok().and_then(|i| self.states.get(i))
    }

    /// Last recorded time step.
    pub(super) fn last_time_step(&self) -> i64 {
        self.first_time_step + self.states.len() as i64 - 1
    }

    /// Speed with which it goes on beyond its end [m/s].
    pub(super) fn last_velocity(&self) -> f64 {
        self.velocity[self.velocity.len() - 1]
    }

    /// Number of time steps since the first one, as a position in the tables.
    pub(super) fn clock(&self, time_step: i64) -> f64 {
        (time_step - self.first_time_step) as f64
    }

    /// Latest time (as a position in the tables) at which the recording is not beyond an arc length; infinite beyond
    /// the end.
    pub(super) fn latest_clock(&self, s: f64) -> f64 {
        let after = self.s.partition_point(|recorded| *recorded <= s);
        if after == self.s.len() {
            return f64::INFINITY;
        }
        if after == 0 {
            return 0.0;
        }
        let (a, b) = (self.s[after - 1], self.s[after]);
        (after - 1) as f64 + (s - a) / (b - a)
    }

    /// Arc length at a time [m]; beyond the end it goes on with the last speed.
    pub(super) fn s_at(&self, clock: f64, dt: f64) -> f64 {
        let last = (self.s.len() - 1) as f64;
        interpolated(&self.s, clock) + self.last_velocity() * (clock - last).max(0.0) * dt
    }

    /// It moves on after a time (a position in the tables).
    pub(super) fn drives_on(&self, clock: f64) -> bool {
        self.s[self.s.len() - 1] > interpolated(&self.s, clock) + MOVED
    }

    /// Speed at a time [m/s].
    pub(super) fn velocity_at(&self, clock: f64) -> f64 {
        interpolated(&self.velocity, clock)
    }
}

fn interpolated(values: &[f64], at: f64) -> f64 {
    let at = at.clamp(0.0, (values.len() - 1) as f64);
    let i = at as usize;
    let next = values[(i + 1).min(values.len() - 1)];
    values[i] + (next - values[i]) * (at - i as f64)
}

fn rear_axle(state: &State, vehicle: &Vehicle) -> Point {
    vehicle.rear_axle_from_center(state.pose())
}

/// Lead-in, recorded positions that make progress, continuation along the lane.
fn path_through(states: &[State], vehicle: &Vehicle, road: &RoadNetwork) -> Result<ReferencePath> {
    let (first, last) = (&states[0], &states[states.len() - 1]);
    let start = rear_axle(first, vehicle);
    let lead_in = (1..=4).rev().map(|i| start - Point::from_angle(first.orientation) * (LEAD_IN * f64::from(i) / 4.0));
    let mut points: Vec<Point> = lead_in.collect();
    points.push(start);
    for state in states {
        let point = rear_axle(state, vehicle);
        let step = point - points[points.len() - 1];
        if step.norm() >= POINT_SPACING && step.dot(Point::from_angle(state.orientation)) > 0.5 * step.norm() {
            points.push(point);
        }
    }
    let end = Pose { position: points[points.len() - 1], orientation: last.orientation };
    extend(&mut points, end, last.velocity, road);
    ReferencePath::through(&points)
}

/// Continues along the lane at the pose, straight on where there is none.
fn extend(points: &mut Vec<Point>, end: Pose, velocity: f64, road: &RoadNetwork) {
    let n = (EXTENSION / EXTENSION_SPACING) as usize;
    let along = (1..=n).map(|i| i as f64 * EXTENSION_SPACING);
    let lane = road.matching(end, LANE_TOLERANCE, std::f64::consts::FRAC_PI_3).into_iter().next();
    let Some(lane) = lane else {
        points.extend(along.map(|distance| end.position + Point::from_angle(end.orientation) * distance));
        return;
    };
    let chain = road.paths_from(lane.lanelet, lane.s, EXTENSION, 1).remove(0);
    let length = (velocity * RETURN_TIME).max(RETURN_LENGTH_MIN);
    for distance in along {
        let u = (distance / length).min(1.0);
        let fade = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0));
        points.push(road.chain_pose(&chain, lane.s, distance, lane.d * fade).0.position);
    }
}

/// Arc lengths of the recorded rear axles, never backwards.
fn arc_lengths(states: &[State], vehicle: &Vehicle, path: &ReferencePath, dt: f64) -> Vec<f64> {
    let mut s = LEAD_IN;
    let mut last = rear_axle(&states[0], vehicle);
    let mut arc_lengths = Vec::with_capacity(states.len());
    for state in states {
        let point = rear_axle(state, vehicle);
        let moved = point.distance(last);
        let window = 3.0 + moved + state.velocity.abs() * dt;
        if let Some((foot, _)) = path.project_near(point, s + moved, window) {
            s = s.max(foot);
        }
        arc_lengths.push(s);
        last = point;
    }
    arc_lengths
}

/// Central differences, smoothed over three steps; not negative.
fn speeds(s: &[f64], dt: f64) -> Vec<f64> {
    let n = s.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let difference = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
        (s[b] - s[a]) / ((b - a) as f64 * dt)
    };
    (0..n)
        .map(|i| match (i.checked_sub(1), i + 1 < n) {
            (Some(before), true) => 0.25 * difference(before) + 0.5 * difference(i) + 0.25 * difference(i + 1),
            _ => difference(i),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Shape;
    use crate::road::testing::straight_road;
    use crate::scenario::Obstacles;
    use crate::trajectory::States;
    use crate::vehicle::ParticipantKind;
    use std::sync::Arc;

    /// A car on the right one of two lanes along x, at x = 20 m at first, with a speed per time step.
    fn recorded_path(velocities: &[f64], noise: f64) -> Result<RecordedPath> {
        let mut states = States::absent(vec![7], 3, velocities.len());
        let mut x = 20.0;
        for (step, velocity) in velocities.iter().enumerate() {
            let y = if step % 2 == 0 { noise } else { -noise };
            states.set(0, step, &State { x, y, velocity: *velocity, ..State::default() });
            x += velocity * 0.1;
        }
        let obstacles = Obstacles {
            kind: vec![ParticipantKind::Car],
            shape: vec![Shape::rectangle(4.5, 1.8)],
            is_static: vec![false],
            states,
        };
        let scenario = Scenario::new(0.1, Arc::new(straight_road(2)), obstacles)?;
        RecordedPath::new(&scenario, 7, 3, &Vehicle::BMW_320I, "recorded")
    }

    #[test]
    fn places_have_the_latest_time_at_which_the_recording_was_there() {
        // 1 m per step for ten steps, ten steps of standing, 1 m per step again.
        let velocities = [[10.0; 10], [0.0; 10], [10.0; 10]].concat();
        let recorded_path = recorded_path(&velocities, 0.0).expect("a recorded_path");
        let start = recorded_path.s_at(0.0, 0.1);
        for (clock, distance) in [(0.0, 0.0), (5.5, 5.5), (10.0, 10.0), (15.0, 10.0), (20.0, 10.0), (25.0, 15.0)] {
            assert!((recorded_path.s_at(clock, 0.1) - start - distance).abs() < 1e-6, "{clock}");
        }
        // Where it stood: when it left.
        assert!((recorded_path.latest_clock(start + 10.0 + 1e-6) - 20.0).abs() < 1e-4);
        assert!((recorded_path.latest_clock(start + 4.0) - 4.0).abs() < 1e-4);
        assert_eq!(recorded_path.latest_clock(start + 30.0), f64::INFINITY);
        assert!(recorded_path.drives_on(15.0) && !recorded_path.drives_on(29.0));
        assert_eq!((recorded_path.velocity_at(15.0), recorded_path.last_time_step()), (0.0, 32));
        assert!((recorded_path.velocity_at(5.0) - 10.0).abs() < 1e-6);
    }

    #[test]
    fn beyond_its_end_the_track_goes_on_with_its_last_speed_along_the_lane() {
        let recorded_path = recorded_path(&[10.0; 20], 0.0).expect("a recorded_path");
        assert!((recorded_path.s_at(29.0, 0.1) - recorded_path.s_at(19.0, 0.1) - 10.0).abs() < 1e-6);
        assert!(recorded_path.path().length() > 250.0);
        assert!(recorded_path.path().at(recorded_path.path().length()).position.y.abs() < 0.01);
    }

    #[test]
    fn noise_of_a_standing_recording_makes_no_path() {
        let recorded_path = recorded_path(&[0.0; 30], 0.05).expect("a recorded_path");
        assert_eq!(recorded_path.velocity_at(10.0), 0.0);
        let path = recorded_path.path();
        assert!((0..200).all(|i| path.at(f64::from(i)).theta.abs() < 0.02));
    }

    #[test]
    fn who_is_not_recorded_has_no_track() {
        let scenario = Scenario::new(0.1, Arc::new(straight_road(1)), Obstacles::default()).expect("a scenario");
        let error =
            RecordedPath::new(&scenario, 5, 0, &Vehicle::BMW_320I, "velocity_adjusting").expect_err("no recording");
        assert_eq!(
            error.to_string(),
            "agent 5 has no recording, which planner velocity_adjusting needs: give it another planner"
        );
    }
}
