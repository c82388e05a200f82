//! Replaying the recording.

use super::car_following::integrate;
use super::frame::Start;
use super::path_motion::RETURN_TIME;
use super::recorded_path::RecordedPath;
use super::{PlanRequest, PlanResult, PlanningMemory, path_motion, refused};
use crate::trajectory::Trajectory;

/// The recorded states themselves; beyond the last one along the lane with the last speed.
pub(super) fn plan(request: &PlanRequest, recorded_path: &RecordedPath, memory: &mut PlanningMemory) -> PlanResult {
    let n_points = request.predictions.n_steps + 1;
    let mut points = Vec::with_capacity(n_points);
    points.push(request.state);
    points.extend((1..n_points as i64).map_while(|i| recorded_path.state(request.time_step + i)));
    if points.len() < n_points {
        // From the last recorded state, or from here if that is past.
        let from = PlanRequest { state: points[points.len() - 1], ..*request };
        let start = match Start::on(recorded_path.path(), f64::NAN, &from.state, request.vehicle, false) {
            Ok(start) => start,
            Err(reason) => return refused(request, &format!("the agent {reason}")),
        };
        let missing = n_points - points.len() + 1;
        integrate((start.s, start.velocity), missing, request.dt, &mut memory.motions, |_, _, _| 0.0);
        match path_motion::trajectory(&from, recorded_path.path(), &start, &memory.motions, RETURN_TIME) {
            Some(rest) => points.extend_from_slice(&rest.points[1..]),
            None => return refused(request, "its lane bends too tightly where it is"),
        }
    }
    PlanResult::planned(Trajectory { points }, f64::NAN)
}
