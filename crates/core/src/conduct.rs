//! How vehicles drive, in numbers that planning, right of way, prediction and judgement share: what counts as standing, and
//! which braking is expected.

/// An agent that is slower than this stands [m/s]: it is told so by its own speed. Ten seconds of it are 1 m.
pub const STANDSTILL_SPEED: f64 = 0.1;

/// Another participant that is slower than this is stationary for its observers [m/s]: its speed is observed, and its
/// heading says nothing about where it goes.
pub const STATIONARY_SPEED: f64 = 0.5;

/// A vehicle that is slower than this holds up the vehicles behind it [m/s].
pub const CRAWLING_SPEED: f64 = 1.0;

/// A vehicle that is slower than this stood, when a run is judged by its states [m/s]: twice the speed at which agents
/// stand by their own measure, so that no agent is judged for a stop that it has made.
pub const JUDGED_STANDSTILL_SPEED: f64 = 0.2;

/// A vehicle that is slower than this has come to rest [m/s]: well below the speed at which agents stand by their own measure,
/// as one that creeps has not come to rest.
pub(crate) const REST_SPEED: f64 = 0.05;

/// A vehicle with this speed along its heading [m/s] reverses: slower motions backwards are standing.
pub fn reverses(velocity: f64) -> bool {
    velocity < -STANDSTILL_SPEED
}

/// Braking that is expected of every vehicle [m/s²]: none has to brake harder for a light that changes, to give way, or for
/// people at a crosswalk. Traffic engineers time yellow lights by 10 ft/s², 3.05 m/s² (Institute of Transportation
/// Engineers). How hard an agent brakes for its own comfort is a setting of its planner, such as `Comfort::deceleration`.
pub const EXPECTED_DECELERATION: f64 = 3.0;

/// A vehicle could stop within a distance [m] from a speed [m/s] by the braking that is expected: a light that changes holds
/// it.
pub fn could_stop(velocity: f64, distance: f64) -> bool {
    velocity * velocity <= 2.0 * EXPECTED_DECELERATION * distance
}

/// Firm braking [m/s²]: a vehicle that would have to brake harder to wait for another one is not expected to, and agents
/// brake so before bends that they come to too fast. It is the safe deceleration of MOBIL (Kesting, Treiber, Helbing,
/// Transportation Research Record 1999, 2007, doi 10.3141/1999-10).
pub(crate) const FIRM_DECELERATION: f64 = 4.0;

/// Acceleration of the earliest entry into a conflict zone that a vehicle is capable of in traffic [m/s²].
pub(crate) const EARLY_ACCELERATION: f64 = 2.0;

/// Acceleration of a late exit out of a conflict zone [m/s²].
pub(crate) const LATE_ACCELERATION: f64 = 1.5;

/// A vehicle behind follows if it heads within 45 degrees of the agent (cosine): further apart their ways part or cross.
pub(crate) const FOLLOWER_COSINE: f64 = 0.7;

/// A vehicle that stands needs so long to start [s], below this speed [m/s].
const REACTION: f64 = 0.3;
const REACTING: f64 = 0.5;

/// Time for a distance [m] from a speed [m/s], with an acceleration [m/s²] up to a largest speed [m/s].
pub(crate) fn travel_time(distance: f64, velocity: f64, largest: f64, acceleration: f64) -> f64 {
    if distance <= 0.0 {
        return 0.0;
    }
    let reaction = if velocity < REACTING { REACTION } else { 0.0 };
    if velocity >= largest {
        return reaction + distance / velocity;
    }
    let ramp = 0.5 * (largest * largest - velocity * velocity) / acceleration;
    if distance <= ramp {
        return reaction + ((velocity * velocity + 2.0 * acceleration * distance).sqrt() - velocity) / acceleration;
    }
    reaction + (largest - velocity) / acceleration + (distance - ramp) / largest
}

#[cfg(test)]
mod tests {
    use super::{could_stop, reverses, travel_time};

    #[test]
    fn a_vehicle_that_moves_backwards_faster_than_standing_reverses() {
        assert_eq!([-1.5, -0.11, -0.1, 0.0, 1.5].map(reverses), [true, true, false, false, false]);
    }

    #[test]
    fn a_vehicle_can_stop_within_its_squared_speed_over_six_metres_per_second_squared() {
        for (velocity, distance, expected) in
            [(12.0, 24.0, true), (12.0, 23.9, false), (0.0, 0.0, true), (0.0, -1.0, false)]
        {
            assert_eq!(could_stop(velocity, distance), expected, "{velocity} m/s, {distance} m");
        }
    }

    #[test]
    fn the_time_for_a_distance_follows_from_speed_and_acceleration() {
        for (distance, velocity, largest, acceleration, expected) in [
            (20.0, 10.0, 10.0, 2.0, 2.0),
            (27.8, 10.0, 10.0, 1.2, 2.78),
            (-1.0, 0.0, 10.0, 2.0, 0.0),
            // 0.3 s to react, sqrt(2 · 8.4 / 1.2)
            (8.4, 0.0, 7.0, 1.2, 0.3 + 3.741_657_386_773_941),
            // 4 to 8 m/s in 2 s over 12 m, then 8 m more.
            (20.0, 4.0, 8.0, 2.0, 3.0),
        ] {
            assert!((travel_time(distance, velocity, largest, acceleration) - expected).abs() < 1e-9);
        }
    }
}
