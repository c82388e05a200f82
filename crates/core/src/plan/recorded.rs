//! Replaying the recording.

use super::car_following::integrate;
use super::frame::Start;
use super::idm::RETURN_TIME;
use super::track::Track;
use super::{PlanRequest, PlanResult, Scratch, path_motion, planned, refused};
use crate::trajectory::Trajectory;

/// The recorded states themselves; beyond the last one along the lane with the last speed.
pub(super) fn plan(request: &PlanRequest, track: &Track, scratch: &mut Scratch) -> PlanResult {
    let n_points = request.predictions.n_steps + 1;
    let mut points = Vec::with_capacity(n_points);
    points.push(request.state);
    points.extend((1..n_points as i64).map_while(|i| track.state(request.time_step + i)));
    if points.len() < n_points {
        // From the last recorded state, or from here if that is past.
        let from = PlanRequest { state: points[points.len() - 1], ..*request };
        let start = match Start::on(track.path(), f64::NAN, &from.state, request.vehicle, false) {
            Ok(start) => start,
            Err(reason) => return refused(request, scratch, &format!("the agent {reason}")),
        };
        let missing = n_points - points.len() + 1;
        integrate((start.s, start.velocity), missing, request.dt, &mut scratch.motions, |_, _, _| 0.0);
        match path_motion::trajectory(&from, track.path(), &start, &scratch.motions, RETURN_TIME) {
            Some(rest) => points.extend_from_slice(&rest.points[1..]),
            None => return refused(request, scratch, "its lane bends too tightly where it is"),
        }
    }
    planned(Trajectory { points })
}
