//! The formulas on numbers: one vehicle behind another one on one path. Sources: docs/reference/criticality.md.
//! An infinite headway means that no participant is ahead; where an argument is not a number, neither is the result.

/// At this speed [m/s] and below no time headway is defined.
pub const HEADWAY_SPEED: f64 = 1e-3;
/// Denominators below this are no approach.
const NO_APPROACH: f64 = 1e-12;

/// Time headway [s]: headway [m] over the speed along the path [m/s] of the vehicle behind. 0 in contact, infinite for
/// a standing or reversing vehicle.
pub fn time_headway(headway: f64, velocity: f64) -> f64 {
    if headway.is_nan() {
        f64::NAN
    } else if headway <= 0.0 {
        0.0
    } else if velocity <= HEADWAY_SPEED {
        f64::INFINITY
    } else {
        headway / velocity
    }
}

/// Time to collision [s] with constant accelerations: the smallest t >= 0 at which
/// `headway + velocity * t + acceleration * t² / 2` is 0; infinite if there is none (Jansson 2005).
///
/// Velocity [m/s] and acceleration [m/s²] are those of the leader minus those of the follower.
pub fn time_to_collision(headway: f64, velocity: f64, acceleration: f64) -> f64 {
    if headway <= 0.0 {
        return 0.0;
    }
    if headway == f64::INFINITY {
        return headway;
    }
    let discriminant = velocity * velocity - 2.0 * headway * acceleration;
    if discriminant < 0.0 {
        return f64::INFINITY;
    }
    let denominator = discriminant.sqrt() - velocity;
    if denominator <= NO_APPROACH { f64::INFINITY } else { 2.0 * headway / denominator }
}

/// Required longitudinal acceleration [m/s²], at most 0: the largest constant acceleration of the follower that keeps
/// the gap from ever closing (Jansson 2005). `headway` [m] is positive; `velocity` [m/s] is that of the leader minus
/// that of the follower; `leader_acceleration` [m/s²] is taken to last.
pub fn required_acceleration(headway: f64, velocity: f64, leader_acceleration: f64) -> f64 {
    if headway.is_nan() || headway == f64::INFINITY {
        return if headway.is_nan() { f64::NAN } else { 0.0 };
    }
    let closing = if velocity >= 0.0 { 0.0 } else { velocity * velocity / (2.0 * headway) };
    let required = leader_acceleration - closing;
    if required > 0.0 { 0.0 } else { required }
}

/// As [`required_acceleration`] for a leader that brakes to rest and stays there, if it rests before the gap would have
/// closed: the follower stops behind it; a standing or reversing follower need not brake. Speeds [m/s] along the path.
pub fn required_acceleration_stopping(headway: f64, follower: f64, leader: f64, leader_acceleration: f64) -> f64 {
    let required = required_acceleration(headway, leader - follower, leader_acceleration);
    if headway == f64::INFINITY || leader_acceleration >= 0.0 || leader < 0.0 {
        return required;
    }
    if follower <= 0.0 {
        return if required.is_nan() { f64::NAN } else { 0.0 };
    }
    let rest = leader / -leader_acceleration;
    let touch = if follower > leader { 2.0 * headway / (follower - leader) } else { f64::INFINITY };
    if rest < touch {
        -follower * follower / (2.0 * (headway + leader * leader / (-2.0 * leader_acceleration)))
    } else {
        required
    }
}

/// Required lateral acceleration [m/s²], at least 0: the smaller of the accelerations that pass the other vehicle on
/// its left and on its right after `time` [s] (Jansson 2005). `offset` [m] is where the other one will be then, left
/// positive; `left` and `right` [m] are how far away the centres must be for passing there.
pub fn required_lateral_acceleration(time: f64, offset: f64, left: f64, right: f64) -> f64 {
    if [time, offset, left, right].iter().any(|argument| argument.is_nan()) {
        return f64::NAN;
    }
    if time <= 0.0 || time == f64::INFINITY || offset <= -left || offset >= right {
        return 0.0;
    }
    2.0 * (offset + left).min(right - offset) / (time * time)
}

/// Minimal stopping distance [m] at a speed [m/s] with the deceleration that is available [m/s²] (Allen 1978).
pub fn minimal_stopping_distance(velocity: f64, deceleration: f64) -> f64 {
    velocity * velocity / (2.0 * deceleration)
}

/// Proportion of stopping distance: remaining distance [m] over minimal stopping distance [m] (Allen 1978). 0 inside,
/// infinite at rest and where nothing lies ahead (an infinite remaining distance).
pub fn proportion_of_stopping_distance(remaining: f64, stopping: f64) -> f64 {
    if remaining.is_nan() || stopping.is_nan() {
        f64::NAN
    } else if remaining <= 0.0 {
        0.0
    } else if stopping <= 0.0 || remaining == f64::INFINITY {
        f64::INFINITY
    } else {
        remaining / stopping
    }
}

/// Time exposed [s] to a time to collision of at most `threshold` [s], and its integral below the threshold [s²]
/// (Minderhoud and Bovy 2001), of samples `dt` [s] apart; NaN is not exposed.
pub fn exposure(ttc: &[f64], threshold: f64, dt: f64) -> (f64, f64) {
    let add = |(time, integral): (f64, f64), ttc: &f64| {
        let (more_time, more_integral) = exposure_of_sample(*ttc, threshold, dt);
        (time + more_time, integral + more_integral)
    };
    ttc.iter().fold((0.0, 0.0), add)
}

/// The contribution of one sample to both sums of [`exposure`].
pub fn exposure_of_sample(ttc: f64, threshold: f64, dt: f64) -> (f64, f64) {
    if ttc <= threshold { (dt, dt * (threshold - ttc)) } else { (0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f64 = f64::INFINITY;

    #[track_caller]
    fn near(found: f64, expected: f64) {
        let same = found == expected || (found - expected).abs() <= 1e-6 * expected.abs().max(1.0);
        assert!(same, "{found} instead of {expected}");
    }

    #[test]
    fn time_headway_is_headway_over_speed_and_infinite_at_rest() {
        for (headway, velocity, expected) in [(30.5, 20.0, 1.525), (30.5, 0.0, INF), (30.5, -3.0, INF), (0.0, 0.0, 0.0)]
        {
            assert_eq!(time_headway(headway, velocity), expected);
        }
    }

    #[test]
    fn a_free_path_is_no_conflict() {
        assert_eq!(time_headway(INF, 10.0), INF);
        for (velocity, acceleration) in [(-10.0, 0.0), (-10.0, -1.0), (0.0, -1.0), (5.0, 2.0)] {
            assert_eq!(time_to_collision(INF, velocity, acceleration), INF);
            assert_eq!(required_acceleration(INF, velocity, acceleration), 0.0);
            assert_eq!(required_acceleration_stopping(INF, 10.0, 10.0 + velocity, acceleration), 0.0);
        }
        assert_eq!(proportion_of_stopping_distance(INF, 0.0), INF);
        assert_eq!(proportion_of_stopping_distance(INF, 4.0), INF);
    }

    #[test]
    fn what_is_not_known_gives_nothing_that_looks_known() {
        const NAN: f64 = f64::NAN;
        for unknown in [
            time_headway(NAN, 0.0),
            time_headway(NAN, 10.0),
            time_headway(30.0, NAN),
            time_to_collision(NAN, -10.0, 0.0),
            time_to_collision(30.0, NAN, 0.0),
            time_to_collision(30.0, -10.0, NAN),
            required_acceleration(NAN, 5.0, -1.0),
            required_acceleration(NAN, -5.0, -1.0),
            required_acceleration(30.0, NAN, -1.0),
            required_acceleration(30.0, 5.0, NAN),
            required_acceleration_stopping(NAN, 20.0, 10.0, -5.0),
            required_acceleration_stopping(30.0, NAN, 10.0, -5.0),
            required_acceleration_stopping(30.0, 20.0, NAN, -5.0),
            required_acceleration_stopping(30.0, 20.0, 10.0, NAN),
            required_acceleration_stopping(NAN, 0.0, 10.0, -5.0),
            required_lateral_acceleration(NAN, 0.0, 2.0, 2.0),
            required_lateral_acceleration(3.0, NAN, 2.0, 2.0),
            required_lateral_acceleration(3.0, 0.0, NAN, 2.0),
            required_lateral_acceleration(3.0, 0.0, 2.0, NAN),
            minimal_stopping_distance(NAN, 11.5),
            proportion_of_stopping_distance(NAN, 0.0),
            proportion_of_stopping_distance(3.0, NAN),
        ] {
            assert!(unknown.is_nan(), "{unknown}");
        }
    }

    #[test]
    fn time_to_collision_is_the_first_time_without_a_gap() {
        for (headway, velocity, acceleration, expected) in [
            (30.0, -10.0, 0.0, 3.0),
            (30.0, -10.0, -2.0, 60.0 / (10.0 + 220.0_f64.sqrt())),
            (30.0, -10.0, -2.0, 2.416198),
            (30.0, -10.0, 1.0, 3.675445),
            (30.0, -10.0, -1.0, 2.649111),
            (20.0, -2.0, -0.1, 8.284271),
            (30.0, 0.0, -2.0, 30.0_f64.sqrt()),
            (30.0, -10.0, 2.0, INF),
            (30.0, 5.0, 0.0, INF),
            (30.0, -20.0, 0.0, 1.5),
            (30.0, 0.0, 0.0, INF),
            (0.0, 1.0, 0.0, 0.0),
        ] {
            near(time_to_collision(headway, velocity, acceleration), expected);
        }
    }

    #[test]
    fn the_gap_is_zero_at_the_time_to_collision_and_positive_before() {
        let mut random = crate::geometry::shape::Lcg::new(7);
        let mut finite = 0;
        for _ in 0..2000 {
            let (gap, velocity) = (random.within(0.1, 100.0), random.within(-30.0, 10.0));
            let acceleration = random.within(-9.0, 9.0);
            let ttc = time_to_collision(gap, velocity, acceleration);
            let at = |t: f64| gap + velocity * t + 0.5 * acceleration * t * t;
            if ttc.is_finite() {
                finite += 1;
                assert!(
                    at(ttc).abs() < 1e-7 * (1.0 + ttc * ttc * acceleration.abs()),
                    "{gap} {velocity} {acceleration}"
                );
            }
            let last = ttc.min(60.0);
            assert!((0..400).all(|i| at(last * f64::from(i) / 400.0) > -1e-9));
        }
        assert!(finite > 500);
    }

    #[test]
    fn time_to_collision_does_not_jump_where_the_acceleration_vanishes() {
        for acceleration in [-1e-9, -1e-13, 1e-13, 1e-9] {
            near(time_to_collision(20.0, -2.0, acceleration), 10.0);
        }
    }

    #[test]
    fn required_acceleration_brakes_for_closing_gaps_and_braking_leaders_only() {
        for (headway, velocity, leader, expected) in [
            (30.0, -10.0, 0.0, -5.0 / 3.0),
            (30.0, -10.0, -2.0, -2.0 - 5.0 / 3.0),
            (30.0, 10.0, 0.0, 0.0),
            (30.0, -10.0, 2.0, 0.0),
            (30.0, 0.0, -3.0, -3.0),
        ] {
            near(required_acceleration(headway, velocity, leader), expected);
        }
        near(-required_acceleration(30.0, -10.0, 0.0) / 11.5, 0.144928);
        near(-required_acceleration(30.0, -10.0, -2.0) / 11.5, 0.318841);
        near(-required_acceleration(30.0, 0.0, -3.0) / 11.5, 0.260870);
    }

    #[test]
    fn the_required_acceleration_just_keeps_the_gap_open() {
        let mut random = crate::geometry::shape::Lcg::new(11);
        for _ in 0..500 {
            let (gap, velocity, leader) =
                (random.within(0.5, 80.0), random.within(-25.0, 10.0), random.within(-8.0, 3.0));
            let required = required_acceleration(gap, velocity, leader);
            let smallest = |own: f64| {
                let at = |t: f64| gap + velocity * t + 0.5 * (leader - own) * t * t;
                (0..4000).map(|i| at(f64::from(i) * 0.01)).fold(INF, f64::min)
            };
            assert!(smallest(required) >= -1e-6);
            if required < 0.0 && velocity < 0.0 {
                // A little less braking closes the gap sooner or later.
                assert!(time_to_collision(gap, velocity, leader - (required + 1e-3)).is_finite());
            }
        }
    }

    #[test]
    fn a_leader_that_comes_to_rest_needs_to_be_stopped_behind() {
        // Both at 10 m/s, 20 m apart, the leader brakes with 5: it rests after 10 m, so 30 m are left for stopping.
        near(required_acceleration_stopping(20.0, 10.0, 10.0, -5.0), -100.0 / 60.0);
        // It does not rest before the gap would have closed: as before.
        near(required_acceleration_stopping(2.0, 20.0, 10.0, -1.0), required_acceleration(2.0, -10.0, -1.0));
        near(required_acceleration_stopping(30.0, 20.0, 10.0, 0.0), -5.0 / 3.0);
        // Already standing, its brake still on.
        near(required_acceleration_stopping(20.0, 10.0, 0.0, -1.0), -100.0 / 40.0);
    }

    #[test]
    fn who_stands_need_not_brake_for_a_leader_that_stops() {
        for follower in [0.0, -1.0] {
            assert_eq!(required_acceleration_stopping(20.0, follower, 10.0, -5.0), 0.0);
        }
        // No jump at rest: 0.1² / (2 (20 + 10)).
        near(required_acceleration_stopping(20.0, 0.1, 10.0, -5.0), -0.01 / 60.0);
    }

    #[test]
    fn behind_a_leader_that_stops_the_required_acceleration_just_keeps_the_gap_open() {
        let mut random = crate::geometry::shape::Lcg::new(13);
        let mut stopping = 0;
        for _ in 0..300 {
            let (gap, follower) = (random.within(1.0, 60.0), random.within(1.0, 25.0));
            let (leader, braking) = (random.within(0.0, 25.0), random.within(-8.0, -0.5));
            let required = required_acceleration_stopping(gap, follower, leader, braking);
            let way = |speed: f64, acceleration: f64, t: f64| {
                let t = t.min(if acceleration < 0.0 { -speed / acceleration } else { INF });
                speed * t + 0.5 * acceleration * t * t
            };
            let smallest = |own: f64| {
                let at = |t: f64| gap + way(leader, braking, t) - way(follower, own, t);
                (0..20_000).map(|i| at(f64::from(i) * 0.01)).fold(INF, f64::min)
            };
            assert!(smallest(required) >= -1e-6, "{gap} {follower} {leader} {braking}");
            if required > braking - 1e-3 && follower > 3.0 {
                stopping += 1;
                assert!(smallest(required + 0.05) < 0.0, "{gap} {follower} {leader} {braking}");
            }
        }
        assert!(stopping > 50, "{stopping}");
    }

    #[test]
    fn required_lateral_acceleration_takes_the_easier_side() {
        let w = 2.0;
        for (time, offset, expected) in [
            (3.0, 0.0, 4.0 / 9.0),
            (3.0, 0.8, 2.4 / 9.0),
            (3.0, -0.8, 2.4 / 9.0),
            (2.0, 1.0 - 0.25 * 2.0, 0.75),
            (3.0, 2.5, 0.0),
            (INF, 0.0, 0.0),
            (0.0, 0.0, 0.0),
        ] {
            near(required_lateral_acceleration(time, offset, w, w), expected);
        }
        near(required_lateral_acceleration(3.0, 0.0, w, w) / 8.0, 0.055556);
        near(required_lateral_acceleration(3.0, 0.8, w, w) / 8.0, 0.033333);
        near(required_lateral_acceleration(2.0, 0.5, w, w) / 8.0, 0.09375);
    }

    #[test]
    fn stopping_distances_and_their_proportions() {
        near(minimal_stopping_distance(20.0, 11.5), 17.391304);
        near(proportion_of_stopping_distance(30.0, minimal_stopping_distance(10.0, 11.5)), 6.9);
        near(proportion_of_stopping_distance(10.0, minimal_stopping_distance(10.0, 11.5)), 2.3);
        assert_eq!(proportion_of_stopping_distance(0.0, 0.0), 0.0);
        assert_eq!(proportion_of_stopping_distance(3.0, 0.0), INF);
    }

    #[test]
    fn exposure_counts_samples_below_the_threshold() {
        let ttc: Vec<f64> = (0..26).map(|k| 3.005 - 0.1 * f64::from(k)).collect();
        let (time, integral) = exposure(&ttc, 2.0, 0.1);
        near(time, 1.5);
        near(time / (26.0 * 0.1), 15.0 / 26.0);
        near(integral, 1.1925);
        let (time, integral) = exposure(&ttc[..25], 2.0, 0.1);
        near(time, 1.4);
        near(integral, 1.043);
        assert_eq!(exposure(&[f64::NAN, INF], 2.0, 0.1), (0.0, 0.0));
    }

    #[test]
    fn limits_between_cases_belong_to_the_side_that_is_stated() {
        for (headway, velocity, expected) in
            [(-1.0, 10.0, 0.0), (-1.0, 0.0, 0.0), (10.0, HEADWAY_SPEED, INF), (10.0, 2.0 * HEADWAY_SPEED, 5000.0)]
        {
            assert_eq!(time_headway(headway, velocity), expected, "{headway} m, {velocity} m/s");
        }
        for (headway, velocity, acceleration, expected) in [
            (-1.0, -10.0, 0.0, 0.0),
            // Just so: 25 - 10 t + t² is 0 at t = 5 and never negative.
            (25.0, -10.0, 2.0, 5.0),
            // Denominators of exactly and of twice the smallest approach.
            (30.0, -0.5 * NO_APPROACH, 0.0, INF),
            (30.0, -NO_APPROACH, 0.0, 60.0 / (2.0 * NO_APPROACH)),
        ] {
            assert_eq!(
                time_to_collision(headway, velocity, acceleration),
                expected,
                "{headway} {velocity} {acceleration}"
            );
        }
        // The leader speeds up by more than what closes: 100 / 60 = 1.67 m/s².
        assert_eq!(required_acceleration(30.0, -10.0, 3.0), 0.0);
        near(required_acceleration(30.0, -10.0, 1.0), 1.0 - 100.0 / 60.0);
        for (follower, leader, braking, expected) in [
            // It stands: 10² / (2 * 30).
            (10.0, 0.0, -5.0, -100.0 / 60.0),
            // It reverses, or does not brake: as without an end.
            (10.0, -2.0, -5.0, -5.0 - 144.0 / 60.0),
            (10.0, 5.0, 0.0, -25.0 / 60.0),
            // Rests after 5 / 5 = 1 s and 2.5 m, before 60 / 5 = 12 s: 10² / (2 * 32.5).
            (10.0, 5.0, -5.0, -100.0 / 65.0),
            // As fast as the leader: 10² / (2 * (30 + 10)).
            (10.0, 10.0, -5.0, -100.0 / 80.0),
            // Rests after 20 s, touched after 60 / 10 = 6 s.
            (30.0, 20.0, -1.0, -1.0 - 100.0 / 60.0),
            (0.0, 5.0, -5.0, 0.0),
            (-3.0, 5.0, -5.0, 0.0),
        ] {
            near(required_acceleration_stopping(30.0, follower, leader, braking), expected);
        }
        for (time, offset, left, right, expected) in [
            (2.0, -1.0, 1.0, 3.0, 0.0),
            (2.0, 3.0, 1.0, 3.0, 0.0),
            (2.0, 0.0, 1.0, 3.0, 0.5),
            (2.0, 2.0, 1.0, 3.0, 0.5),
            (-1.0, 0.0, 1.0, 3.0, 0.0),
        ] {
            near(required_lateral_acceleration(time, offset, left, right), expected);
        }
        assert_eq!(proportion_of_stopping_distance(-1.0, 4.0), 0.0);
        assert_eq!(exposure(&[2.0, 2.5, 1.0], 2.0, 0.5), (1.0, 0.5), "the threshold itself is exposed");
    }
}
