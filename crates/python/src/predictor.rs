//! Native predictors as handles.

use std::sync::Arc;

use interdrive_core::predict::neural::Neural;
use interdrive_core::predict::{LaneFollowing, Predictor, Spread};
use pyo3::prelude::*;

use crate::neural::PyNeuralNetwork;
use crate::scenario::PyScenario;

#[pyclass(frozen, name = "Predictor", module = "interdrive._core")]
pub struct PyPredictor(pub Predictor);

#[pymethods]
impl PyPredictor {
    #[staticmethod]
    fn constant_velocity(position_sigma: f64, acceleration_sigma: f64, lateral_rate: f64) -> Self {
        Self(Predictor::ConstantVelocity(Spread { position_sigma, acceleration_sigma, lateral_rate }))
    }

    #[staticmethod]
    #[pyo3(signature = (
        position_sigma, acceleration_sigma, lateral_rate, modes_max, lateral_acceleration, deceleration, return_time,
        recorded=None
    ))]
    fn lane_following(
        position_sigma: f64,
        acceleration_sigma: f64,
        lateral_rate: f64,
        modes_max: usize,
        lateral_acceleration: f64,
        deceleration: f64,
        return_time: f64,
        recorded: Option<&PyScenario>,
    ) -> Self {
        let spread = Spread { position_sigma, acceleration_sigma, lateral_rate };
        let settings = LaneFollowing { spread, modes_max, lateral_acceleration, deceleration, return_time };
        Self(match recorded {
            Some(scenario) => Predictor::GroundTruth(Arc::clone(&scenario.0), settings),
            None => Predictor::LaneFollowing(settings),
        })
    }

    #[staticmethod]
    fn neural(network: &PyNeuralNetwork, modes_max: usize) -> Self {
        Self(Predictor::Neural(Neural { network: Arc::clone(&network.0), modes_max }))
    }
}
