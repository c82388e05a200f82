//! How fast an agent wants to be for the sake of its goal.

use super::PlanRequest;

/// The plan reaches a new speed after about this time [s]; speeds are desired for then.
pub(super) const LOOK_AHEAD: f64 = 1.0;
/// An agent aims this far into the goal area, at most to its middle [m], ...
const GOAL_DEPTH: f64 = 20.0;
/// ... waits this far before its end [m] ...
const GOAL_END_GAP: f64 = 1.0;
/// ... and arrives this long before the last moment [s], ...
const ARRIVAL_RESERVE: f64 = 1.0;
/// ... or by this share of the time that is left, if that is more: a plan to be just in time ends late.
const ARRIVAL_SHARE: f64 = 0.15;
/// The same share on a road with a speed limit for agents that like to be early: what holds them up later takes time.
const EARLY_SHARE: f64 = 0.45;
/// For that they want to be faster than now by this at most [m/s].
const EARLY_STEP: f64 = 1.0;
/// At most this share of the goal's interval of speeds is left on each side.
const SPEED_RESERVE_SHARE: f64 = 0.15;
/// Agents on a free road arrive no faster than at this share of the goal's interval of speeds.
const GOAL_SPEED_SHARE: f64 = 0.8;

/// Desired speed for the goal alone, and where to wait if the agent is early, for a rear axle at an arc length [m] and a
/// speed [m/s].
///
/// Before the area: the constant speed that, followed by comfortable braking (or accelerating) to the goal's speeds,
/// brings the agent into the area at the middle of the time interval or before its end, whichever is later: shortly
/// before it, or with `free` on a road with a speed limit early enough for what may hold it up on the way. With
/// `free`, at least the agent's free speed, which is the highest of its speed when it entered, the middle of the goal's
/// speeds (an interval that includes standing says nothing) and `cruise_velocity_min`, but slow enough to brake
/// comfortably to the goal's speeds and not to arrive too early; it then leaves as much as `free` of the goal's speeds
/// on each side [m/s]. Too late: on as before, or with `free` as fast as the limit, or at the free speed where no limit
/// is known. In the area: the goal's speed; before the time, slowly enough not to leave it. A goal without a place, or
/// behind the agent: the goal's speed, else the present one.
pub(super) fn desired(
    request: &PlanRequest,
    (s, velocity): (f64, f64),
    deceleration: f64,
    cruise_velocity_min: f64,
    free: Option<f64>,
) -> (f64, Option<f64>) {
    let Some(goal) = request.goal.states.iter().max_by_key(|state| state.time_step.1) else {
        return (velocity, None);
    };
    if let Some(pace) = request.goal.pace {
        return (pace, None);
    }
    let goal_velocity = goal.velocity.map(|(low, high)| (0.5 * (low + high)).max(0.0));
    let onwards = goal_velocity.unwrap_or(velocity.max(cruise_velocity_min));
    let (entry, exit) = (request.route.goal_entry_s, request.route.goal_exit_s);
    let center = s + request.vehicle.rear_axle_to_center;
    // False for goals without a place, too: their arc lengths are NaN.
    let to_come = exit > center && entry.is_finite();
    if goal.areas.is_empty() || !to_come {
        return (onwards, None);
    }
    let until = |time_step: i64| (time_step - request.time_step) as f64 * request.dt;
    let (earliest, latest) = (until(goal.time_step.0), until(goal.time_step.1));
    let is_early = earliest > 0.0;
    let stop = is_early.then_some(exit - GOAL_END_GAP - request.vehicle.rear_axle_to_center);
    if center >= entry {
        let room = (exit - GOAL_END_GAP - center).max(0.0);
        let inside = goal_velocity.unwrap_or(velocity);
        let waiting = if is_early { (room / earliest).min((deceleration * room).sqrt()) } else { inside };
        return (inside.min(waiting), stop);
    }
    let (low, high) = goal.velocity.unwrap_or((0.0, f64::INFINITY));
    let distance = entry.min(exit) - center + GOAL_DEPTH.min(0.5 * (exit - entry));
    let is_free = free.is_some();
    let inner = free.filter(|_| high.is_finite()).map_or(0.0, |most| most.min(SPEED_RESERVE_SHARE * (high - low)));
    let speeds = (if low > 0.0 { low + inner } else { low }, high - inner);
    let arriving_after = |time: f64| cruise_velocity(distance, time, speeds, deceleration);
    let sparing = |share: f64| {
        let reserve = ARRIVAL_RESERVE.max(share * latest);
        arriving_after((0.5 * (earliest + latest)).max(latest - reserve).max(0.5 * latest))
    };
    let needed = sparing(ARRIVAL_SHARE);
    let is_late = latest <= 0.0;
    if !is_free {
        return (if is_late { onwards } else { needed }, stop);
    }
    let middle = goal_velocity.filter(|_| low > 0.0).unwrap_or(0.0);
    let free = request.entry.velocity.max(middle).max(cruise_velocity_min);
    let approach = approach_velocity(distance, low + GOAL_SPEED_SHARE * (high - low), deceleration);
    if is_late {
        let limit = Some(request.rules.way.limits.at(s)).filter(|limit| limit.is_finite());
        let free = free.max(limit.unwrap_or(0.0));
        return (free.min(approach), stop);
    }
    let soonest = earliest + ARRIVAL_RESERVE.min(0.5 * (latest - earliest));
    let not_too_early = if is_early { arriving_after(soonest) } else { f64::INFINITY };
    let is_limited = request.rules.way.limits.at(s).is_finite();
    let early = if is_limited { sparing(EARLY_SHARE).min(velocity + EARLY_STEP) } else { 0.0 };
    (free.min(approach).min(not_too_early).max(needed).max(early), stop)
}

/// Highest speed from which comfortable braking after `LOOK_AHEAD` leads to a speed at most [m/s].
fn approach_velocity(distance: f64, limit: f64, deceleration: f64) -> f64 {
    let lag = deceleration * LOOK_AHEAD;
    ((lag * lag + limit * limit + 2.0 * deceleration * distance).sqrt() - lag).max(limit)
}

/// Speed after `LOOK_AHEAD` of: constant speed, then a constant change `b` [m/s²] to the nearer end of the interval, so
/// that `distance` is covered in `time`.
fn cruise_velocity(distance: f64, time: f64, (low, high): (f64, f64), b: f64) -> f64 {
    let mean = distance / time;
    if mean > high {
        // distance = v time - (v - high)² / (2 b); the smaller root.
        let root = ((high + b * time).powi(2) - high * high - 2.0 * b * distance).max(0.0).sqrt();
        let cruise = high + b * time - root;
        let braking_since = LOOK_AHEAD - (time - (cruise - high) / b);
        return (cruise - b * braking_since.max(0.0)).max(high);
    }
    if mean < low {
        // distance = v time + (low - v)² / (2 b)
        let root = ((low - b * time).powi(2) - low * low + 2.0 * b * distance).max(0.0).sqrt();
        let cruise = (low - b * time + root).max(0.0);
        let driving_since = LOOK_AHEAD - (time - (low - cruise) / b);
        return (cruise + b * driving_since.max(0.0)).min(low);
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cruise_speed_covers_the_distance_in_time() {
        let b = 3.0;
        for (distance, time, low, high, expected) in [
            (100.0, 10.0, 0.0, f64::INFINITY, 10.0),
            (100.0, 10.0, 5.0, 12.0, 10.0),
            // v 10 - v²/6 = 80: 30 - sqrt(900 - 480)
            (80.0, 10.0, 0.0, 0.0, 30.0 - 420_f64.sqrt()),
            // v 10 + (12 - v)²/6 = 80: v² + 36 v - 336 = 0
            (80.0, 10.0, 12.0, 15.0, -18.0 + 660_f64.sqrt()),
        ] {
            let v = cruise_velocity(distance, time, (low, high), b);
            assert!((v - expected).abs() < 1e-9, "{v} for {expected}");
        }
    }

    #[test]
    fn the_desired_speed_falls_along_the_braking_before_the_goal() {
        // 5 m/s is reached 2 s before arrival at rest, on the comfortable braking parabola: 1 s later it is 2 less.
        let v = cruise_velocity(4.0, 2.0, (0.0, 0.0), 2.0);
        assert!((v - 2.0).abs() < 1e-9, "{v}");
    }
}
