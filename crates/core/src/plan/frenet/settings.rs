//! Parameters of the planner.

use crate::error::{Error, Result};

/// How much each part of the cost counts; all weights are zero or positive. Every part is zero or positive too, so a
/// sum of some parts is a lower bound of the whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostWeights {
    /// Root of the summed squares of speed minus desired speed over all points [m/s].
    pub velocity_offset: f64,
    /// Root of the summed squares of the lateral offset over the last half of the points [m].
    pub distance_to_reference: f64,
    /// Root of the integral of the squared lateral jerk (third derivative of d by time) over the horizon [m/s^2.5].
    pub lateral_jerk: f64,
    /// Root of the integral of the squared longitudinal jerk (third derivative of s by time) over the horizon.
    pub longitudinal_jerk: f64,
    /// Integral of the squared acceleration along the heading [m²/s³].
    pub acceleration: f64,
    /// Integral of the squared change of that acceleration [m²/s⁵].
    pub jerk: f64,
    /// Integral of the squared lateral speed d_dot [m²/s].
    pub lateral_velocity: f64,
    /// Integral of the squared lateral acceleration d_ddot [m²/s³].
    pub lateral_acceleration: f64,
    /// Integral of the squared longitudinal speed s_dot [m²/s].
    pub longitudinal_velocity: f64,
    /// Integral of the squared longitudinal acceleration s_ddot [m²/s³].
    pub longitudinal_acceleration: f64,
    /// Root of the summed squares of the heading relative to the path over the last half of the points, plus the
    /// square of the last one [rad].
    pub orientation_offset: f64,
    /// Sum over participants of 1 / (smallest squared distance between the centres) [1/m²].
    pub distance_to_obstacles: f64,
    /// 1000 times the summed probabilities that a participant's centre or corners lie in the ego's footprint, over
    /// points and participants, weighted by the probabilities of the participants' modes.
    pub prediction: f64,
}

impl Default for CostWeights {
    fn default() -> Self {
        Self {
            velocity_offset: 1.0,
            distance_to_reference: 5.0,
            lateral_jerk: 0.2,
            longitudinal_jerk: 0.2,
            acceleration: 0.0,
            jerk: 0.0,
            lateral_velocity: 0.0,
            lateral_acceleration: 0.0,
            longitudinal_velocity: 0.0,
            longitudinal_acceleration: 0.0,
            orientation_offset: 0.0,
            distance_to_obstacles: 0.0,
            prediction: 0.2,
        }
    }
}

/// Number of cost terms.
pub const N_TERMS: usize = 13;

impl CostWeights {
    /// Names of the terms, in the order of [`CostWeights::as_array`].
    pub const NAMES: [&'static str; N_TERMS] = [
        "velocity_offset",
        "distance_to_reference",
        "lateral_jerk",
        "longitudinal_jerk",
        "acceleration",
        "jerk",
        "lateral_velocity",
        "lateral_acceleration",
        "longitudinal_velocity",
        "longitudinal_acceleration",
        "orientation_offset",
        "distance_to_obstacles",
        "prediction",
    ];

    /// The weights in the order of [`CostWeights::NAMES`].
    pub fn as_array(&self) -> [f64; N_TERMS] {
        [
            self.velocity_offset,
            self.distance_to_reference,
            self.lateral_jerk,
            self.longitudinal_jerk,
            self.acceleration,
            self.jerk,
            self.lateral_velocity,
            self.lateral_acceleration,
            self.longitudinal_velocity,
            self.longitudinal_acceleration,
            self.orientation_offset,
            self.distance_to_obstacles,
            self.prediction,
        ]
    }
}

/// What the agent finds comfortable; the desired speed respects it, the limits of feasibility do not know it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comfort {
    /// Time gap to a leader [s]: the reaction time of the safe speed.
    pub time_gap: f64,
    /// Distance kept to a standing leader [m].
    pub standstill_gap: f64,
    /// Deceleration before leaders, curves and the goal [m/s²].
    pub deceleration: f64,
    /// Lateral acceleration in curves [m/s²].
    pub lateral_acceleration: f64,
    /// Desired and present speed differ by at most this [m/s].
    pub velocity_step: f64,
    /// Least speed [m/s] of an agent whose goal says nothing about where or how fast.
    pub cruise_velocity_min: f64,
}

impl Default for Comfort {
    fn default() -> Self {
        Self {
            time_gap: 1.0,
            standstill_gap: 2.0,
            deceleration: 3.0,
            lateral_acceleration: 3.0,
            velocity_step: 5.0,
            cruise_velocity_min: 5.0,
        }
    }
}

/// Parameters of the sampling planner in the Frenet frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrenetSettings {
    /// Fineness of the sampling, 0 to 4: 48, 180, 800, 3564, 12716 samples in the grid.
    pub level: usize,
    /// Length of a plan [s].
    pub horizon: f64,
    /// Shortest time in which a manoeuvre ends [s].
    pub t_min: f64,
    /// Lateral end positions lie within this distance of the reference path [m].
    pub d_max: f64,
    /// Below this speed [m/s] lateral motion is planned over arc length instead of time.
    pub low_velocity: f64,
    /// Weights of the cost terms.
    pub weights: CostWeights,
    /// Predicted participants are longer by this (total) [m].
    pub prediction_margin_length: f64,
    /// Predicted participants are wider by this (total) [m].
    pub prediction_margin_width: f64,
    /// Full opening angle of the cone behind the agent [rad] ...
    pub rear_cone_angle: f64,
    /// ... in which participants further away than this [m] (centre to centre) are left to keep their own distance.
    pub rear_cone_distance: f64,
    /// Modes with at least this probability must not be hit; the most probable one always counts.
    pub collision_mode_probability: f64,
    /// A mode that need not be missed and whose expected positions have less than this probability per area [1/m²] even in
    /// the middle, where they are densest, costs nothing then: it says next to nothing about where somebody will be.
    pub expectation_density_min: f64,
    /// Comfortable driving.
    pub comfort: Comfort,
    /// Also sample stops behind the leader and before the end of the goal area.
    pub stop_targets: bool,
    /// Find the best sample with as little work as possible; `false` evaluates every sample. The choice is the same.
    pub lazy: bool,
}

impl Default for FrenetSettings {
    fn default() -> Self {
        Self {
            level: 2,
            horizon: 3.0,
            t_min: 1.1,
            d_max: 3.0,
            low_velocity: 2.0,
            weights: CostWeights::default(),
            prediction_margin_length: 0.5,
            prediction_margin_width: 0.2,
            rear_cone_angle: 20_f64.to_radians(),
            rear_cone_distance: 6.0,
            collision_mode_probability: 0.2,
            expectation_density_min: 0.02,
            comfort: Comfort::default(),
            stop_targets: true,
            lazy: true,
        }
    }
}

impl FrenetSettings {
    /// Checks every field.
    ///
    /// # Errors
    /// `InvalidInput` naming the field and what is expected.
    pub fn validate(&self) -> Result<()> {
        if self.level > 4 {
            return Err(Error::invalid(format!("level must be 0 to 4, not {}", self.level)));
        }
        let positive = [
            ("horizon", self.horizon, 60.0),
            ("t_min", self.t_min, self.horizon),
            ("d_max", self.d_max, 15.0),
            ("low_velocity", self.low_velocity, 100.0),
            ("comfort.time_gap", self.comfort.time_gap, 60.0),
            ("comfort.deceleration", self.comfort.deceleration, 100.0),
            ("comfort.lateral_acceleration", self.comfort.lateral_acceleration, 100.0),
            ("comfort.velocity_step", self.comfort.velocity_step, 100.0),
        ];
        for (name, value, max) in positive {
            if !(value > 0.0 && value <= max) {
                return Err(Error::invalid(format!("{name} must be positive and at most {max}, not {value}")));
            }
        }
        let not_negative = [
            ("prediction_margin_length", self.prediction_margin_length, 100.0),
            ("prediction_margin_width", self.prediction_margin_width, 100.0),
            ("rear_cone_angle", self.rear_cone_angle, std::f64::consts::TAU),
            ("rear_cone_distance", self.rear_cone_distance, 1e6),
            ("collision_mode_probability", self.collision_mode_probability, 1.0),
            ("expectation_density_min", self.expectation_density_min, 1e6),
            ("comfort.standstill_gap", self.comfort.standstill_gap, 100.0),
            ("comfort.cruise_velocity_min", self.comfort.cruise_velocity_min, 100.0),
        ];
        for (name, value, max) in not_negative {
            if !(0.0..=max).contains(&value) {
                return Err(Error::invalid(format!("{name} must be between 0 and {max}, not {value}")));
            }
        }
        for (name, weight) in CostWeights::NAMES.into_iter().zip(self.weights.as_array()) {
            if !(0.0..=f64::MAX).contains(&weight) {
                return Err(Error::invalid(format!("weights.{name} must not be negative, is {weight}")));
            }
        }
        Ok(())
    }
}

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
