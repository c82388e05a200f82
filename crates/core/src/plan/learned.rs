//! Actions of learners: numbers that become plans.

use super::frenet::FrenetTarget;
use super::weights::WeightActions;
use crate::error::{Error, Result};
use crate::trajectory::State;
use crate::vehicle::Vehicle;
use crate::vehicle::single_track::{Kinematic, Moved};

/// What an action means.
#[derive(Debug, Clone, PartialEq)]
pub enum ActionSpace {
    /// Two numbers from -1 to 1: pedals and steering wheel.
    Kinematic(Kinematic),
    /// The same as one of a grid of choices: (numbers of the first, of the second), both odd.
    KinematicGrid(Kinematic, (usize, usize)),
    /// Three numbers from -1 to 1: the end of a sample in the frame of the path.
    FrenetTarget(FrenetTarget),
    /// Numbers that change the cost weights of the sampling planner that drives the learner.
    FrenetWeights(Box<WeightActions>),
}

impl ActionSpace {
    /// Numbers of an action; `None` for one choice.
    pub fn size(&self) -> Option<usize> {
        match self {
            Self::Kinematic(_) => Some(2),
            Self::FrenetTarget(_) => Some(3),
            Self::FrenetWeights(actions) => Some(actions.terms.len()),
            Self::KinematicGrid(..) => None,
        }
    }

    /// Number of choices.
    pub fn n_choices(&self) -> usize {
        match self {
            Self::KinematicGrid(_, (pedals, wheels)) => pedals * wheels,
            _ => 0,
        }
    }

    /// The settings are possible.
    ///
    /// # Errors
    /// `InvalidInput`.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Kinematic(model) => model.validate(),
            Self::FrenetTarget(target) => target.validate(),
            Self::FrenetWeights(actions) => actions.check(),
            Self::KinematicGrid(model, (pedals, wheels)) => {
                model.validate()?;
                let odd = |n: usize| n % 2 == 1 && (3..=1001).contains(&n);
                if odd(*pedals) && odd(*wheels) {
                    return Ok(());
                }
                Err(Error::invalid(format!("actions: a grid of {pedals} x {wheels} has no middle; both must be odd")))
            }
        }
    }
}

/// An action as it comes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action<'a> {
    /// Numbers.
    Numbers(&'a [f32]),
    /// A choice.
    Choice(i32),
}

impl Action<'_> {
    /// So many numbers; `None` if they are not that, or not finite.
    pub fn numbers<const N: usize>(&self) -> Option<[f64; N]> {
        let Self::Numbers(given) = self else { return None };
        let numbers: [f32; N] = (*given).try_into().ok()?;
        numbers.iter().all(|number| number.is_finite()).then(|| numbers.map(f64::from))
    }
}

impl ActionSpace {
    /// It moves the vehicle by the single-track model, so that nothing but its state has to be known.
    pub fn is_kinematic(&self) -> bool {
        matches!(self, Self::Kinematic(_) | Self::KinematicGrid(..))
    }

    /// The weights that it changes, if it does.
    pub fn weights(&self) -> Option<&WeightActions> {
        if let Self::FrenetWeights(actions) = self { Some(actions) } else { None }
    }

    /// Names of what a learner observes about its planner; empty without one.
    pub fn observed(&self) -> Vec<String> {
        self.weights().map_or_else(Vec::new, WeightActions::observed)
    }

    /// The state after `dt` [s] by the single-track model; `None` if the action is not a number. `path_curvature` [1/m] is that of the path at the
    /// rear axle.
    pub fn next_state(
        &self,
        action: Action<'_>,
        vehicle: &Vehicle,
        state: &State,
        path_curvature: f64,
        dt: f64,
    ) -> Option<Moved> {
        let (model, inputs) = match (self, action) {
            (Self::Kinematic(model), action) => (model, action.numbers()?),
            (Self::KinematicGrid(model, (pedals, wheels)), Action::Choice(choice)) => {
                let choice = usize::try_from(choice).ok()?;
                let number = |i: usize, n: usize| -1.0 + 2.0 * i as f64 / (n - 1) as f64;
                (model, [number(choice / wheels, *pedals), number(choice % wheels, *wheels)])
            }
            _ => return None,
        };
        Some(model.step(vehicle, state, inputs, path_curvature, dt))
    }
}
