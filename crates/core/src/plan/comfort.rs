//! What is comfortable, by planner: `rollout` drives as people do, `frenet` with the values that its cost was tuned for.

use crate::settings::{between, positive, settings};

settings! {
    /// How comfortably an agent drives where it can.
    pub struct Comfort as Comfort {
        /// Time gap to a leader: the reaction time of the safe speed.
        time_gap: f64 ["s"] = 0.85, positive(60.0);
        /// Distance kept to a standing leader.
        standstill_gap: f64 ["m"] = 2.0, between(0.0, 100.0);
        /// Acceleration on a free road.
        acceleration: f64 ["m/s²"] = 3.0, positive(100.0);
        /// Deceleration before leaders, curves, barriers and the goal.
        deceleration: f64 ["m/s²"] = 2.0, positive(100.0);
        /// Largest jerk from 9 m/s on, as long as the agent need not brake harder than 2.5 m/s².
        jerk: f64 ["m/s³"] = 1.9, positive(1000.0);
        /// Largest jerk up to 3 m/s: people, and assistance systems (ISO 15622), set off and stop with more jerk than they
        /// accept on a motorway.
        jerk_low: f64 ["m/s³"] = 5.7, positive(1000.0);
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit. In the bend of a motorway ramp
        /// (MONA) half of the recorded people stay below 2.6 m/s², 70 % below 2.8 m/s².
        lateral_acceleration: f64 ["m/s²"] = 2.8, positive(100.0);
        /// Largest difference between the present speed and the speed at which a gap for a lane change is looked for.
        velocity_step: f64 ["m/s"] = 5.0, positive(100.0);
        /// Lowest desired speed on a free road, where neither the goal nor the road asks for less.
        cruise_velocity_min: f64 ["m/s"] = 5.0, between(0.0, 100.0);
    }

    /// Comfortable driving. The desired speed respects these values; feasibility does not depend on them.
    pub struct FrenetComfort as FrenetComfort {
        /// Time gap to a leader: the reaction time of the safe speed.
        time_gap: f64 ["s"] = 0.85, positive(60.0);
        /// Distance kept to a standing leader.
        standstill_gap: f64 ["m"] = 2.0, between(0.0, 100.0);
        /// Deceleration before leaders, curves and the goal.
        deceleration: f64 ["m/s²"] = 3.0, positive(100.0);
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit.
        lateral_acceleration: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Largest difference between desired and present speed.
        velocity_step: f64 ["m/s"] = 5.0, positive(100.0);
        /// Lowest desired speed on a free road, where neither the goal nor the road asks for less.
        cruise_velocity_min: f64 ["m/s"] = 5.0, between(0.0, 100.0);
    }
}
