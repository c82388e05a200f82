//! Settings of the planner: every number of its behaviour that a user may want to change.

use super::super::comfort::Comfort;
use crate::settings::{NOT_NEGATIVE, between, settings};

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
        /// 1 if it comes nearer to another participant than the margins; beside what stands, for every 0.1 m missing.
        margin: f64 = 5.0, NOT_NEGATIVE;
        /// (1 + closing speed) / (time until then)² of the first contact [m/s³]: the later and the slower, the less certain
        /// it is and the less harm it does.
        contact: f64 = 40.0, NOT_NEGATIVE;
        /// The same for leaving the road, whose edge does not move.
        off_road: f64 = 200.0, NOT_NEGATIVE;
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
        /// Additional distance kept beside others where there is room, per m/s of relative speed.
        margin_time: f64 ["s"] = 0.02, between(0.0, 0.1);
        /// Smallest probability of a predicted mode that a plan must not hit; the most probable mode always counts.
        collision_mode_probability: f64 = 0.2, between(0.0, 1.0);
        /// Takes the line of least curvature within its lane instead of the reference path.
        cut_bends: bool = true;
        /// Drives back a little where it stands wedged.
        reverse: bool = true;
        /// Weights of the cost.
        weights: RolloutWeights;
        /// Comfortable driving.
        comfort: Comfort;
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
