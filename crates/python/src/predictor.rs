//! Native predictors as handles.

use std::sync::Arc;

use interdrive_core::predict::neural::Neural;
use interdrive_core::predict::{ConstantVelocity, Predictor};
use pyo3::prelude::*;

use crate::neural::PyNeuralNetwork;
use crate::scenario::PyScenario;
use crate::settings::read;

#[pyclass(frozen, name = "Predictor", module = "interdrive._core")]
pub struct PyPredictor(pub Predictor);

#[pymethods]
impl PyPredictor {
    #[staticmethod]
    fn constant_velocity(record: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(Predictor::ConstantVelocity(read::<ConstantVelocity>(record)?.spread)))
    }

    #[staticmethod]
    fn lane_following(record: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(Predictor::LaneFollowing(read(record)?)))
    }

    #[staticmethod]
    fn ground_truth(recorded: &PyScenario, agents: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(Predictor::GroundTruth(Arc::clone(&recorded.0), read(agents)?)))
    }

    #[staticmethod]
    fn neural(network: &PyNeuralNetwork, modes_max: usize) -> Self {
        Self(Predictor::Neural(Neural { network: Arc::clone(&network.0), modes_max }))
    }
}
