//! Native planners with their settings, and their samples.

use std::sync::Arc;

use interdrive_core::plan::Planner;
use interdrive_core::plan::frenet::{Candidates, CostWeights, FrenetTarget, N_TERMS};
use interdrive_core::plan::learned::ActionSpace;
use interdrive_core::plan::policy::{Activation, LayerWeights, Policy, SharedPolicy};
use interdrive_core::plan::weights::{WeightActions, WeightChange};
use interdrive_core::plan::{IdmMobilSettings, VelocityAdjustingSettings};
use interdrive_core::vehicle::single_track::Kinematic;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{InputError, exception};
use crate::settings::read;

/// What actions mean, from their name, their record, and the numbers of choices or the positions of weights.
pub fn action_space(name: &str, record: &Bound<'_, PyAny>, numbers: Vec<usize>) -> PyResult<ActionSpace> {
    let weights = |change: WeightChange, terms: Vec<usize>| -> PyResult<ActionSpace> {
        Ok(ActionSpace::FrenetWeights(Box::new(WeightActions { planner: read(record)?, terms, change })))
    };
    Ok(match name {
        "kinematic" => ActionSpace::Kinematic(read::<Kinematic>(record)?),
        "frenet_target" => ActionSpace::FrenetTarget(read::<FrenetTarget>(record)?),
        "kinematic_grid" => {
            let &[pedals, wheels] = numbers.as_slice() else {
                return Err(InputError::new_err("actions: a grid has two numbers of choices"));
            };
            ActionSpace::KinematicGrid(read::<Kinematic>(record)?, (pedals, wheels))
        }
        "frenet_weights_absolute" => weights(WeightChange::Absolute, numbers)?,
        "frenet_weights_additive" => weights(WeightChange::Additive, numbers)?,
        _ => return Err(InputError::new_err(format!("actions: there are no actions {name}"))),
    })
}

#[pyclass(frozen, name = "Planner", module = "interdrive._core")]
pub struct PyPlanner(pub Planner);

#[pymethods]
impl PyPlanner {
    /// The native planner of this name, with the settings of its record.
    #[new]
    fn new(name: &str, record: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(match name {
            "rollout" => Planner::Rollout(Box::new(read(record)?)),
            "frenet" => Planner::Frenet(Box::new(read(record)?)),
            "recorded" => Planner::Recorded,
            "velocity_adjusting" => Planner::VelocityAdjusting(read::<VelocityAdjustingSettings>(record)?.law),
            "idm" => Planner::Idm(read(record)?),
            "idm_mobil" => Planner::IdmMobil(Box::new(read::<IdmMobilSettings>(record)?)),
            _ => return Err(InputError::new_err((name.to_owned(), "is not a native planner"))),
        }))
    }

    /// A learned policy from the weights of its layers, the last one for the action.
    #[staticmethod]
    fn policy(
        layers: Vec<LayerParts<'_>>,
        activation: &str,
        actions: (String, Bound<'_, PyAny>, Vec<usize>),
        observation: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let layer = |(name, weight, bias): LayerParts<'_>| LayerWeights {
            name,
            weight: weight.as_array().iter().copied().collect(),
            bias: bias.as_array().iter().copied().collect(),
        };
        let layers: Vec<LayerWeights> = layers.into_iter().map(layer).collect();
        let activation = match activation {
            "tanh" => Activation::Tanh,
            "relu" => Activation::Relu,
            _ => return Err(InputError::new_err(("activation", format!("must be tanh or relu, not {activation}")))),
        };
        let space = action_space(&actions.0, &actions.1, actions.2)?;
        let policy = Policy::new(&layers, activation, space, read(observation)?).map_err(exception)?;
        Ok(Self(Planner::Policy(SharedPolicy(Arc::new(policy)))))
    }
}

/// Name, weights of shape (outputs, inputs) and bias of shape (outputs,) of a layer.
type LayerParts<'py> = (String, PyReadonlyArray2<'py, f32>, PyReadonlyArray1<'py, f32>);

/// All samples of a plan as a dict of arrays: x, y (samples, points); terms (samples, terms); cost, end_time,
/// end_velocity, end_offset (samples,); rejection (words per sample); chosen (-1 for none);
/// n_steered, of the last rows; desired_velocity.
pub fn candidates_dict<'py>(py: Python<'py>, candidates: &Candidates) -> PyResult<Bound<'py, PyDict>> {
    let (n, n_points) = (candidates.len(), candidates.n_points);
    let reasons = candidates.rejection.iter().zip(&candidates.collision_id).map(|(why, id)| why.words(*id));
    let dict = PyDict::new(py);
    dict.set_item("x", arrays::grid(py, candidates.x.clone(), [n, n_points])?)?;
    dict.set_item("y", arrays::grid(py, candidates.y.clone(), [n, n_points])?)?;
    dict.set_item("terms", arrays::grid(py, candidates.terms.clone(), [n, N_TERMS])?)?;
    dict.set_item("term_names", CostWeights::NAMES.to_vec())?;
    dict.set_item("cost", arrays::row(py, candidates.cost.clone()))?;
    dict.set_item("end_time", arrays::row(py, candidates.end_time.clone()))?;
    dict.set_item("end_velocity", arrays::row(py, candidates.end_velocity.clone()))?;
    dict.set_item("end_offset", arrays::row(py, candidates.end_offset.clone()))?;
    dict.set_item("rejection", reasons.collect::<Vec<_>>())?;
    dict.set_item("chosen", candidates.chosen.map_or(-1, |chosen| chosen as i64))?;
    dict.set_item("n_steered", candidates.n_steered)?;
    dict.set_item("desired_velocity", candidates.desired_velocity)?;
    Ok(dict)
}
