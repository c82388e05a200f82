//! Native planners with their settings, and their samples.

use std::sync::Arc;

use interdrive_core::plan::frenet::{self, CostWeights, FrenetTarget};
use interdrive_core::plan::learned::ActionSpace;
use interdrive_core::plan::pdm::{PDM_TERMS, PdmCandidates};
use interdrive_core::plan::policy::{Activation, LayerWeights, Policy, SharedPolicy};
use interdrive_core::plan::rollout::{self, RolloutCandidates, RolloutWeights};
use interdrive_core::plan::weights::{WeightActions, WeightChange};
use interdrive_core::plan::{Candidates, Planner};
use interdrive_core::plan::{
    CcSettings, FsmSettings, IdmMobilSettings, R157Settings, RssSettings, VelocityAdjustingSettings,
};
use interdrive_core::reference_drivers::Driver;
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
            "velocity_adjusting" => Planner::VelocityAdjusting(read::<VelocityAdjustingSettings>(record)?),
            "idm" => Planner::Idm(read(record)?),
            "lawful" => Planner::Lawful(read(record)?),
            "pdm" => Planner::Pdm(Box::new(read(record)?)),
            "cc" => Planner::Reference(Driver::Cc, read::<CcSettings>(record)?.driving),
            "r157" => Planner::Reference(Driver::R157, read::<R157Settings>(record)?.driving),
            "rss" => Planner::Reference(Driver::Rss, read::<RssSettings>(record)?.driving),
            "fsm" => Planner::Reference(Driver::Fsm, read::<FsmSettings>(record)?.driving),
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

/// What a plan was chosen from as a dict of arrays: x, y (candidates, points); terms (candidates, terms); term_names; cost,
/// end_velocity, end_offset (candidates,); rejection (words per candidate); chosen (-1 for none); desired_velocity. Of
/// `frenet` also end_time (candidates,); of `rollout` and `pdm` pace (a name per candidate).
pub fn candidates_dict<'py>(py: Python<'py>, candidates: &Candidates) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    match candidates {
        Candidates::Frenet(found) => frenet_candidates(py, &dict, found)?,
        Candidates::Rollout(found) => rollout_candidates(py, &dict, found)?,
        Candidates::Pdm(found) => pdm_candidates(py, &dict, found)?,
    }
    Ok(dict)
}

fn frenet_candidates(py: Python<'_>, dict: &Bound<'_, PyDict>, found: &frenet::Candidates) -> PyResult<()> {
    let (n, n_points) = (found.len(), found.n_points);
    let reasons = found.rejection.iter().zip(&found.collision_id).map(|(why, id)| why.words(*id));
    dict.set_item("x", arrays::grid(py, found.x.clone(), [n, n_points])?)?;
    dict.set_item("y", arrays::grid(py, found.y.clone(), [n, n_points])?)?;
    dict.set_item("terms", arrays::grid(py, found.terms.clone(), [n, frenet::N_TERMS])?)?;
    dict.set_item("term_names", CostWeights::NAMES.to_vec())?;
    dict.set_item("cost", arrays::row(py, found.cost.clone()))?;
    dict.set_item("end_time", arrays::row(py, found.end_time.clone()))?;
    dict.set_item("end_velocity", arrays::row(py, found.end_velocity.clone()))?;
    dict.set_item("end_offset", arrays::row(py, found.end_offset.clone()))?;
    dict.set_item("rejection", reasons.collect::<Vec<_>>())?;
    dict.set_item("chosen", found.chosen.map_or(-1, |chosen| chosen as i64))?;
    dict.set_item("desired_velocity", found.desired_velocity)
}

fn rollout_candidates(py: Python<'_>, dict: &Bound<'_, PyDict>, found: &RolloutCandidates) -> PyResult<()> {
    let (n, n_points) = (found.cost.len(), found.n_points);
    dict.set_item("x", arrays::grid(py, found.x.clone(), [n, n_points])?)?;
    dict.set_item("y", arrays::grid(py, found.y.clone(), [n, n_points])?)?;
    dict.set_item("terms", arrays::grid(py, found.terms.clone(), [n, rollout::N_TERMS])?)?;
    dict.set_item("term_names", RolloutWeights::NAMES.to_vec())?;
    dict.set_item("cost", arrays::row(py, found.cost.clone()))?;
    dict.set_item("pace", found.pace.clone())?;
    dict.set_item("end_velocity", arrays::row(py, found.end_velocity.clone()))?;
    dict.set_item("end_offset", arrays::row(py, found.end_offset.clone()))?;
    dict.set_item("rejection", found.rejection.clone())?;
    dict.set_item("chosen", found.chosen.map_or(-1, |chosen| chosen as i64))?;
    dict.set_item("desired_velocity", found.desired_velocity)
}

fn pdm_candidates(py: Python<'_>, dict: &Bound<'_, PyDict>, found: &PdmCandidates) -> PyResult<()> {
    let (n, n_points) = (found.cost.len(), found.n_points);
    dict.set_item("x", arrays::grid(py, found.x.clone(), [n, n_points])?)?;
    dict.set_item("y", arrays::grid(py, found.y.clone(), [n, n_points])?)?;
    dict.set_item("terms", arrays::grid(py, found.terms.clone(), [n, PDM_TERMS.len()])?)?;
    dict.set_item("term_names", PDM_TERMS.to_vec())?;
    dict.set_item("cost", arrays::row(py, found.cost.clone()))?;
    dict.set_item("pace", found.pace.clone())?;
    dict.set_item("end_velocity", arrays::row(py, found.end_velocity.clone()))?;
    dict.set_item("end_offset", arrays::row(py, found.end_offset.clone()))?;
    dict.set_item("rejection", found.rejection.clone())?;
    dict.set_item("chosen", found.chosen.map_or(-1, |chosen| chosen as i64))?;
    dict.set_item("desired_velocity", f64::NAN)
}
