//! Settings of the planner: every number of its behaviour that a user may want to change.

use super::super::lane_change::Seeking;
use crate::settings::{NOT_NEGATIVE, between, positive, settings};

settings! {
    /// Weights of the terms of the cost, which is counted in metres of lost progress.
    pub struct RolloutWeights as RolloutWeights [N_TERMS] {
        /// Way that is lost against a free road over the horizon [m].
        progress: f64 = 1.0, NOT_NEGATIVE;
        /// Speed that is missing at the end against a free road [m/s]; the weight is the time in which it is made up for.
        end_velocity: f64 = 0.7, NOT_NEGATIVE;
        /// Integral of the squared acceleration [m²/s³].
        acceleration: f64 = 0.04, NOT_NEGATIVE;
        /// Integral of the squared jerk [m²/s⁵].
        jerk: f64 = 0.02, NOT_NEGATIVE;
        /// Integral of the squared lateral acceleration beyond that of the path [m²/s³].
        lateral_acceleration: f64 = 1.0, NOT_NEGATIVE;
        /// Integral of the distance from the reference path [m s].
        offset: f64 = 0.5, NOT_NEGATIVE;
        /// Distance of the end from where the plan before ends, across the path [m].
        change: f64 = 0.5, NOT_NEGATIVE;
        /// Integral of the nearness to others, from 0 to 1 and weighted by the probabilities of their modes [s].
        nearness: f64 = 1.0, NOT_NEGATIVE;
        /// 1 if it comes nearer to the edge of the road than `road_margin`.
        edge: f64 = 2.0, NOT_NEGATIVE;
        /// 1 if it comes nearer to another participant than the margins.
        margin: f64 = 5.0, NOT_NEGATIVE;
        /// (1 + closing speed) / (time until then)² of the first contact [m/s³]: the later and the slower, the less certain
        /// it is and the less harm it does.
        contact: f64 = 40.0, NOT_NEGATIVE;
        /// The same for leaving the road, whose edge does not move.
        off_road: f64 = 200.0, NOT_NEGATIVE;
    }

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
        /// Lateral acceleration in curves, at most three quarters of the vehicle's limit.
        lateral_acceleration: f64 ["m/s²"] = 2.2, positive(100.0);
        /// Largest difference between the present speed and the speed at which a gap for a lane change is looked for.
        velocity_step: f64 ["m/s"] = 5.0, positive(100.0);
        /// Lowest desired speed of late agents and of agents whose goal has neither place nor speed.
        cruise_velocity_min: f64 ["m/s"] = 5.0, between(0.0, 100.0);
    }

    /// Closed-loop roll-outs: a few ways, paces and steering laws, driven ahead by a model of the vehicle, and one cost.
    ///
    /// See docs/reference/planner_rollout.md.
    pub struct RolloutSettings as Rollout {
        /// Length of a plan.
        horizon: f64 ["s"] = 3.0, between(0.5, 60.0);
        /// Distance kept to the edge of the road where there is room.
        road_margin: f64 ["m"] = 0.1, between(0.0, 10.0);
        /// Distance kept to others where there is room, before and behind them.
        margin_length: f64 ["m"] = 0.25, between(0.0, 100.0);
        /// Distance kept to others where there is room, beside them.
        margin_width: f64 ["m"] = 0.1, between(0.0, 100.0);
        /// Smallest probability of a predicted mode that a plan must not hit; the most probable mode always counts.
        collision_mode_probability: f64 = 0.2, between(0.0, 1.0);
        /// Drives back a little where it stands wedged.
        reverse: bool = true;
        /// Weights of the cost.
        weights: RolloutWeights;
        /// Comfortable driving.
        comfort: Comfort;
    }
}

impl Comfort {
    /// How an agent seeks a gap to change lanes.
    pub(in crate::plan) fn seeking(&self) -> Seeking {
        let Self { deceleration, cruise_velocity_min, velocity_step, .. } = *self;
        Seeking { deceleration, cruise_velocity_min, velocity_step }
    }
}

/// Number of cost terms.
pub const N_TERMS: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_valid() {
        RolloutSettings::default().validate().expect("valid");
    }

    #[test]
    fn an_impossible_setting_is_named() {
        let mut settings = RolloutSettings::default();
        settings.comfort.jerk = 0.0;
        let error = settings.validate().expect_err("no jerk at all");
        assert!(error.to_string().starts_with("comfort.jerk"), "{error}");
    }
}
