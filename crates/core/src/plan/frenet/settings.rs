//! Settings of the planner.

use super::super::comfort::FrenetComfort;
use super::super::wavering::PlaceInLane;
use crate::error::{Error, Result};
use crate::settings::{NOT_NEGATIVE, between, positive, settings};

settings! {
    /// Weights of the terms of the cost; zero disables a term. Every term is zero or positive.
    pub struct CostWeights as FrenetWeights [N_TERMS] {
        /// Root of the summed squares of speed minus desired speed over all points [m/s].
        velocity_offset: f64 = 1.0, NOT_NEGATIVE;
        /// Root of the summed squares of the lateral offset, from where the agent wants to be in its lane, over the last half of
        /// the points [m].
        distance_to_reference: f64 = 5.0, NOT_NEGATIVE;
        /// Root of the integral of the squared lateral jerk over the horizon [m/s^2.5].
        lateral_jerk: f64 = 0.2, NOT_NEGATIVE;
        /// Root of the integral of the squared longitudinal jerk over the horizon [m/s^2.5].
        longitudinal_jerk: f64 = 0.2, NOT_NEGATIVE;
        /// Integral of the squared acceleration along the heading [m²/s³].
        acceleration: f64 = 0.0, NOT_NEGATIVE;
        /// Integral of the squared change of that acceleration [m²/s⁵].
        jerk: f64 = 0.0, NOT_NEGATIVE;
        /// Integral of the squared lateral speed [m²/s].
        lateral_velocity: f64 = 0.0, NOT_NEGATIVE;
        /// Integral of the squared lateral acceleration [m²/s³].
        lateral_acceleration: f64 = 0.0, NOT_NEGATIVE;
        /// Integral of the squared longitudinal speed [m²/s].
        longitudinal_velocity: f64 = 0.0, NOT_NEGATIVE;
        /// Integral of the squared longitudinal acceleration [m²/s³].
        longitudinal_acceleration: f64 = 0.0, NOT_NEGATIVE;
        /// Root of the summed squares of the heading relative to the path over the last half of the points, plus the
        /// square of the last one [rad].
        orientation_offset: f64 = 0.0, NOT_NEGATIVE;
        /// Sum over participants of 1 / (smallest squared distance of the centres) [1/m²].
        distance_to_obstacles: f64 = 0.0, NOT_NEGATIVE;
        /// 1000 times the summed probabilities that a participant's centre or corners lie in the ego's footprint, over
        /// points and participants, weighted by the probabilities of the participants' modes.
        prediction: f64 = 0.07, NOT_NEGATIVE;
    }

    /// Sampling in the Frenet frame of the reference path.
    ///
    /// Werling et al., ICRA 2010, doi 10.1109/ROBOT.2010.5509799; Trauth, Moller, Wuersching, Betz, "FRENETIX", IEEE
    /// Access 2024, doi 10.1109/ACCESS.2024.3436835; in a corrected form, see docs/reference/planner_frenet.md.
    pub struct FrenetSettings as Frenet(place: PlaceInLane) {
        /// Sampling density: 48, 180, 800, 3564 or 12716 samples in the grid.
        level: usize = 2, between(0.0, 4.0);
        /// Length of a plan.
        horizon: f64 ["s"] = 3.0, positive(60.0);
        /// Shortest time in which a manoeuvre ends; at most the horizon.
        t_min: f64 ["s"] = 1.1, positive(60.0);
        /// Largest lateral distance of end positions from the reference path.
        d_max: f64 ["m"] = 3.0, positive(15.0);
        /// Distance kept to the edge of the road where there is room.
        road_margin: f64 ["m"] = 0.1, between(0.0, 10.0);
        /// Below this speed lateral motion is planned over arc length instead of time.
        low_velocity: f64 ["m/s"] = 2.0, positive(100.0);
        /// Total length added to predicted participants.
        prediction_margin_length: f64 ["m"] = 0.5, between(0.0, 100.0);
        /// Total width added to predicted participants.
        prediction_margin_width: f64 ["m"] = 0.2, between(0.0, 100.0);
        /// Full opening angle of the cone behind the agent.
        rear_cone_angle: f64 ["rad"] = 20_f64.to_radians(), between(0.0, std::f64::consts::TAU);
        /// Participants in that cone further away than this (centre to centre) are expected to keep their distance.
        rear_cone_distance: f64 ["m"] = 6.0, between(0.0, 1e6);
        /// Smallest probability of a predicted mode that a plan must not hit; the most probable mode always counts.
        collision_mode_probability: f64 = 0.2, between(0.0, 1.0);
        /// Peak density of positions below which a mode less probable than that costs nothing: it then hardly predicts
        /// a position.
        expectation_density_min: f64 ["1/m²"] = 0.02, between(0.0, 1e6);
        /// Also sample stops behind the leader and at the end of the goal area.
        stop_targets: bool = true;
        /// Evaluate only the samples and terms needed to find the best sample; false evaluates all. The choice is the
        /// same.
        lazy: bool = true;
        /// Weights of the cost.
        weights: CostWeights;
        /// Comfortable driving.
        comfort: FrenetComfort;
    }, ends_within_horizon
}

fn ends_within_horizon(settings: &FrenetSettings) -> Result<()> {
    let FrenetSettings { t_min, horizon, .. } = *settings;
    if t_min <= horizon {
        return Ok(());
    }
    let message = format!("must be positive and at most {horizon}, not {t_min:?}");
    Err(Error::Setting { name: "t_min".into(), message })
}

/// Number of cost terms.
pub const N_TERMS: usize = N_TABLE_TERMS + N_WORLD_TERMS + 1;
/// The first terms need only the profile or the end offset of a sample.
pub(super) const N_TABLE_TERMS: usize = 4;
/// The next ones need its trajectory; the last one is the prediction.
pub(super) const N_WORLD_TERMS: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_valid() {
        FrenetSettings::default().validate().expect("valid");
    }

    #[test]
    fn an_impossible_setting_is_named() {
        let check = |change: fn(&mut FrenetSettings), name: &str| {
            let mut settings = FrenetSettings::default();
            change(&mut settings);
            let error = settings.validate().expect_err(name);
            assert!(error.to_string().starts_with(name), "{error}");
        };
        check(|s| s.level = 5, "level");
        check(|s| s.horizon = f64::NAN, "horizon");
        check(|s| s.t_min = 3.1, "t_min");
        check(|s| s.collision_mode_probability = 1.5, "collision_mode_probability");
        check(|s| s.weights.prediction = -0.1, "weights.prediction");
        check(|s| s.weights.jerk = f64::NAN, "weights.jerk");
        check(|s| s.comfort.deceleration = 0.0, "comfort.deceleration");
    }
}
