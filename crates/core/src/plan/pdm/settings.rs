//! Settings of the planner: the numbers of the published configuration, and what it needs beyond them here.

use super::super::car_following::CarFollowing;
use crate::settings::{NOT_NEGATIVE, between, positive, settings};

/// Car following of the published configuration, which does not follow what is expected elsewhere.
const LAW: CarFollowing =
    CarFollowing { time_gap: 1.5, minimum_gap: 1.0, acceleration: 1.5, deceleration: 3.0, exponent: 10.0 };

settings! {
    /// Weights of the quality of a proposal.
    pub struct PdmWeights as PdmWeights {
        /// Way along the middle of the lane, as a share of that of the admissible proposal that gets furthest.
        progress: f64 = 5.0, NOT_NEGATIVE;
        /// 1 if no contact is near.
        ttc: f64 = 5.0, NOT_NEGATIVE;
        /// 1 if it is comfortable.
        comfort: f64 = 2.0, NOT_NEGATIVE;
    }

    /// Drives the best of 15 proposals, after PDM-Closed.
    ///
    /// Dauner, Hallgarten, Geiger, Chitta, "Parting with Misconceptions about Learning-based Vehicle Motion Planning", CoRL
    /// 2023, arXiv 2306.07962; defaults are those of its configuration, but for the last two settings. Car following on
    /// three paths at five shares of the speed limit, each followed by a tracker and scored as the closed-loop benchmark of
    /// nuPlan scores drives. See docs/reference/planner_pdm.md.
    pub struct PdmSettings as Pdm(law: CarFollowing = LAW) {
        /// Length of a proposal.
        horizon: f64 ["s"] = 4.0, between(0.5, 60.0);
        /// Largest time between two points of a proposal.
        step: f64 ["s"] = 0.1, between(0.01, 1.0);
        /// Number of speeds of each path: equal shares of the speed limit, up to the whole; 1: the limit alone.
        speeds: usize = 5, between(1.0, 100.0);
        /// Offset of the paths beside the middle of the lane, one to each side; 0: there is one path.
        offset: f64 ["m"] = 1.0, between(0.0, 10.0);
        /// Target speed where no limit is stated within 50 m.
        unlimited_velocity: f64 ["m/s"] = 15.0, positive(100.0);
        /// Participants further away do not count.
        radius: f64 ["m"] = 50.0, positive(1000.0);
        /// It brakes if the best proposal hits another participant within this time ...
        braking_time: f64 ["s"] = 2.0, between(0.0, 60.0);
        /// ... and the agent is at most this fast.
        braking_velocity: f64 ["m/s"] = 5.0, between(0.0, 100.0);
        /// How hard it then brakes.
        braking: f64 ["m/s²"] = 4.05, positive(100.0);
        /// Weights of the quality.
        weights: PdmWeights;
        /// Lateral acceleration in bends, at most three quarters of the vehicle's limit. The published planner knows no bends.
        lateral_acceleration: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Deceleration before bends, lower limits and the goal. The published planner knows the limit where it is, and no
        /// speed of its goal.
        approach: f64 ["m/s²"] = 1.5, positive(100.0);
    }
}
