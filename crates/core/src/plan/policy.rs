//! A learned policy as a planner: what it observes becomes an action, the action one step of the single-track model.

use std::sync::Arc;

use super::learned::{Action, ActionSpace};
use super::{Other, PlanRequest, PlanResult};
use crate::error::{Error, Result};
use crate::layers::linear::{Linear, relu};
use crate::observation::{ObservationMemory, ObservationSettings, ObservedBody, Observer, PathTable, layout, observe};
use crate::trajectory::Trajectory;

/// Weights of a layer: (outputs, inputs) row-major, and bias (outputs,).
#[derive(Debug, Clone, PartialEq)]
pub struct LayerWeights {
    /// Its name, for messages.
    pub name: String,
    /// Row-major.
    pub weight: Vec<f32>,
    /// One per output.
    pub bias: Vec<f32>,
}

/// What follows a hidden layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// Hyperbolic tangent.
    Tanh,
    /// Negative numbers become zero.
    Relu,
}

/// A network that turns observations into actions: hidden layers and one for the action.
#[derive(Debug)]
pub struct Policy {
    hidden: Vec<(Linear, usize)>,
    action: (Linear, usize),
    activation: Activation,
    space: ActionSpace,
    observation: ObservationSettings,
}

/// A policy that agents share.
#[derive(Debug, Clone)]
pub struct SharedPolicy(pub Arc<Policy>);

impl PartialEq for SharedPolicy {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// Memory of policies; holds no state.
#[derive(Debug, Clone, Default)]
pub(super) struct PolicyMemory {
    inputs: Vec<f32>,
    outputs: Vec<f32>,
    bodies: Vec<ObservedBody>,
    seen: Vec<usize>,
    observation: ObservationMemory,
}

impl Policy {
    /// From the weights of its layers, the last one for the action.
    ///
    /// # Errors
    /// `InvalidInput` naming the layer that does not fit.
    pub fn new(
        layers: &[LayerWeights],
        activation: Activation,
        space: ActionSpace,
        observation: ObservationSettings,
    ) -> Result<Self> {
        space.check()?;
        if !space.is_kinematic() {
            return Err(Error::invalid("actions: a policy used as a planner needs actions of the single-track model"));
        }
        observation.validate()?;
        if observation.raster {
            return Err(Error::invalid("observation.raster: a policy used as a planner observes numbers only"));
        }
        let mut n_in = layout::length(&observation);
        let mut made = Vec::new();
        for layer in layers {
            let n_out = layer.bias.len();
            if n_out == 0 || layer.weight.len() != n_out * n_in {
                let whose = if made.is_empty() { "the observation" } else { "the layer before" };
                let given = layer.weight.len().checked_div(n_out).unwrap_or(0);
                return Err(Error::invalid(format!("{} is ({n_out}, {given}), {whose} has {n_in} values", layer.name)));
            }
            made.push((Linear::new(&layer.weight, &layer.bias, n_in, 0..n_in), n_out));
            n_in = n_out;
        }
        let Some(action) = made.pop() else { return Err(Error::invalid("a policy needs a layer for the action")) };
        let expected = space.size().unwrap_or_else(|| space.n_choices());
        if action.1 != expected {
            return Err(Error::invalid(format!("action.weight has {} rows, {expected} expected", action.1)));
        }
        Ok(Self { hidden: made, action, activation, space, observation })
    }

    /// What the network says about an observation.
    fn outputs<'a>(&self, memory: &'a mut PolicyMemory) -> &'a [f32] {
        let PolicyMemory { inputs, outputs, .. } = memory;
        for (layer, n_out) in &self.hidden {
            layer.apply(inputs, inputs.len(), 1, outputs);
            outputs.truncate(*n_out);
            match self.activation {
                Activation::Tanh => outputs.iter_mut().for_each(|value| *value = value.tanh()),
                Activation::Relu => relu(outputs),
            }
            std::mem::swap(inputs, outputs);
        }
        self.action.0.apply(inputs, inputs.len(), 1, outputs);
        outputs.truncate(self.action.1);
        outputs
    }
}

/// The plan of a policy: two points.
pub(super) fn plan(
    request: &PlanRequest,
    SharedPolicy(policy): &SharedPolicy,
    table: &PathTable,
    memory: &mut PolicyMemory,
) -> PlanResult {
    memory.bodies.clear();
    memory.bodies.extend(request.others.iter().enumerate().map(body));
    memory.seen.clear();
    memory.seen.extend(0..memory.bodies.len());
    let observer = Observer {
        state: &request.state,
        vehicle: request.vehicle,
        route: request.route,
        table,
        limits: &request.rules.way.limits,
        goal: request.goal,
        road: request.road,
        predictions: Some(request.predictions),
        s: request.s_hint,
        time_step: request.time_step,
        dt: request.dt,
        last_time_step: request.last_time_step,
    };
    memory.inputs.clear();
    memory.inputs.resize(layout::length(&policy.observation), 0.0);
    let PolicyMemory { bodies, seen, observation, inputs, .. } = memory;
    observe(&observer, bodies, seen, &policy.observation, observation, inputs);
    let outputs = policy.outputs(memory);
    let mut numbers = [0.0; 2];
    let action = if policy.space.size().is_some() {
        numbers.iter_mut().zip(outputs).for_each(|(number, output)| *number = output.clamp(-1.0, 1.0));
        Action::Numbers(&numbers)
    } else {
        // The first one of equals.
        let best = (0..outputs.len()).fold(0, |best, i| if outputs[i] > outputs[best] { i } else { best });
        Action::Choice(best as i32)
    };
    let curvature = request.route.path.curvature_at(request.s_hint);
    let moved = policy.space.next_state(action, request.vehicle, &request.state, curvature, request.dt);
    let points = match moved {
        Some(moved) => vec![request.state, moved.state],
        None => vec![request.state],
    };
    PlanResult::planned(Trajectory { points }, f64::NAN)
}

/// Others are sorted by id, so their order stands for it.
fn body((order, other): (usize, &Other<'_>)) -> ObservedBody {
    let what = (other.shape.extent(), other.kind, other.is_static);
    let mut body = ObservedBody::of(order as i64, other.pose, other.velocity, what);
    body.predicted = Some(other.row);
    body
}
