//! Who goes first where a participant begins to occupy the path later: what a driver expects of one that joins or crosses.
//!
//! It goes by motions alone. What the rules of the road say is the ledger's matter (`right_of_way`), whose barriers hold
//! beside it; without rules, and among vehicles that do not obey, there is nothing else.

use super::super::PlanRequest;
use super::super::car_following::PathMotion;
use super::PathOccupancy;
use super::path_interval::{Ego, PathInterval};
use crate::conduct::{STATIONARY_SPEED, could_stop};
use crate::geometry::{Point, wrap_angle};

/// The vehicle goes first if it has left the stretch by this distance [m] when the other comes.
const CLEARANCE: f64 = 1.0;
/// Entries that are nearer in time than this are at the same time [s].
const SAME_TIME: f64 = 0.5;
/// The other can be expected to wait if that takes no more than this deceleration [m/s²].
const COURTESY: f64 = 2.0;

/// A participant that will join the path does so ahead of the vehicle if both keep their present speeds.
pub(super) fn is_joined_ahead(
    ego: &Ego,
    occupancy: &PathOccupancy,
    intervals: &[PathInterval],
    free: &[PathMotion],
    dt: f64,
) -> bool {
    let interval = &intervals[occupancy.first];
    let middle = 0.5 * (interval.low + interval.high);
    let clear = free[occupancy.first].s + ego.to_rear > interval.high + CLEARANCE;
    let at_present_speed = ego.s + ego.middle() + ego.velocity * occupancy.first as f64 * dt;
    !clear && middle >= at_present_speed
}

/// The crossing participant is a vehicle that stands, and the vehicle could not stop comfortably before it.
pub(super) fn goes_before_standing(request: &PlanRequest, ego: &Ego, occupancy: &PathOccupancy) -> bool {
    let other = &request.others[occupancy.other];
    let stands = other.kind.is_on_the_road() && other.velocity.abs() < STATIONARY_SPEED;
    stands && !could_stop(ego.velocity, occupancy.entry - ego.s - ego.to_front)
}

/// The vehicle waits for a crossing participant, unless it will have passed by then, can no longer stop, or the other
/// has to wait.
pub(super) fn must_wait(
    request: &PlanRequest,
    ego: &Ego,
    occupancy: &PathOccupancy,
    intervals: &[PathInterval],
    free: &[PathMotion],
    dt: f64,
) -> bool {
    let passes_first =
        (occupancy.first..=occupancy.last).all(|point| free[point].s + ego.to_rear > intervals[point].high + CLEARANCE);
    let distance = occupancy.entry - ego.s - ego.to_front;
    // False for a stretch that the front has entered, too.
    let can_stop = ego.velocity * ego.velocity <= 2.0 * request.vehicle.acceleration_max * distance;
    if passes_first || !can_stop {
        return false;
    }
    let other = &request.others[occupancy.other];
    // Both at their present speeds, as others see them: so both agents agree about the order.
    let (own_time, other_time) = (distance / ego.velocity.max(1e-3), occupancy.first as f64 * dt);
    if other.velocity.abs() > 2.0 * COURTESY * other_time {
        return true;
    }
    if (own_time - other_time).abs() > SAME_TIME {
        return own_time > other_time;
    }
    !has_priority(request, ego, occupancy)
}

/// Order of simultaneous arrivals: straight on before turning, otherwise priority to the right.
fn has_priority(request: &PlanRequest, ego: &Ego, occupancy: &PathOccupancy) -> bool {
    /// Turns that differ by less are alike [rad]: headings of predictions are that inexact.
    const SAME_TURN: f64 = 0.2;
    let (other, predictions) = (&request.others[occupancy.other], request.predictions);
    let k = predictions.offset(other.row, occupancy.mode) + occupancy.first - 1;
    let (here, there) = (ego.path.at(ego.s), ego.path.at(occupancy.entry));
    let own_turn = (there.theta - here.theta).abs();
    let other_turn = wrap_angle(predictions.orientation[k] - other.pose.orientation).abs();
    if (own_turn - other_turn).abs() > SAME_TURN {
        return own_turn < other_turn;
    }
    // It comes from the left if it heads to the right across the path.
    there.tangent().cross(Point::from_angle(predictions.orientation[k])) < 0.0
}
