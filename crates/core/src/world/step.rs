//! A step of every loop: [`Step::begin`] observes, [`Step::expect`] predicts, [`Step::plan`] plans, [`World::step`]
//! moves all at once. In between, planners and predictors outside the core have what they need: a predictor the scene,
//! a planner what is expected.

use std::sync::Arc;

use super::World;
use crate::error::{Error, Result};
use crate::predict::Predictor;
use crate::scene::Scene;
use crate::trajectory::{Plans, Predictions};
use crate::v2x::SharedPredictions;

/// The source of predictions.
#[derive(Debug, Clone, Copy)]
pub enum Forecast<'a> {
    /// A predictor of the core, so many time steps ahead.
    Core(&'a Predictor, usize),
    /// A predictor outside the core: its answer.
    Outside(&'a Arc<Predictions>),
}

/// How agents expect all participants to move.
#[derive(Debug, Clone)]
pub struct Expected {
    /// By the predictor and by the rules: vehicles take the ways that they show, and wait where they were told to.
    pub predictions: Arc<Predictions>,
    /// The same with what agents with V2X were told; `None` if none has V2X.
    pub told: Option<Arc<SharedPredictions>>,
}

/// A step that has begun.
#[derive(Debug, Clone)]
pub struct Step {
    /// What is there now.
    pub scene: Arc<Scene>,
    /// What is expected of it, once that was predicted.
    expected: Option<Expected>,
    /// Plans of all agents that drive; planners outside the core write into their rows.
    pub plans: Plans,
}

impl Step {
    /// Observes what is there now, with as much of the past as the settings of the world say.
    pub fn begin(world: &World) -> Self {
        let plans = Plans::none(world.time_step(), world.driving(), 2);
        Self { scene: Arc::new(world.scene()), expected: None, plans }
    }

    /// Begins the next step without looking: the scene stays what it was, and nothing can be predicted or planned from it.
    pub(crate) fn begin_unseen(&mut self, world: &World) {
        self.expected = None;
        self.plans.clear(world.time_step(), world.driving_ids(), 2);
    }

    /// Begins the next step with so many past time steps; memory is reused.
    pub(crate) fn begin_anew(&mut self, world: &World, history_steps: usize) {
        world.write_scene(history_steps, Arc::make_mut(&mut self.scene));
        self.begin_unseen(world);
    }

    /// Predicts, unless that has been done: planners of the core need it, and observers outside.
    ///
    /// # Errors
    /// `WrongTimeStep` if the scene or the predictions are not of now; `InvalidInput` for another world; those of the
    /// predictor.
    pub fn expect(&mut self, world: &World, forecast: Forecast<'_>) -> Result<()> {
        if self.expected.is_some() {
            return Ok(());
        }
        let found = match forecast {
            Forecast::Core(predictor, n_steps) => Arc::new(world.predict(predictor, &self.scene, n_steps)?),
            Forecast::Outside(predictions) => Arc::clone(predictions),
        };
        world.check_time_step("predictions", found.time_step)?;
        let predictions = world.with_rules(&found).map_or(found, Arc::new);
        let told = world.with_messages(&self.scene, &predictions)?.map(Arc::new);
        self.expected = Some(Expected { predictions, told });
        Ok(())
    }

    /// What is expected.
    ///
    /// # Errors
    /// `InvalidInput` if the step has no predictions.
    pub fn expected(&self) -> Result<&Expected> {
        self.expected.as_ref().ok_or_else(unpredicted)
    }

    /// The predictions, if there are any.
    pub fn predictions(&self) -> Option<&Predictions> {
        self.expected.as_ref().map(|expected| &*expected.predictions)
    }

    /// Plans of all agents with planners in the core; the rows of all others are left without a plan.
    ///
    /// # Errors
    /// `InvalidInput` without predictions, or for another world; `WrongTimeStep` if the step is over.
    pub fn plan(&mut self, world: &World) -> Result<()> {
        let expected = self.expected.as_ref().ok_or_else(unpredicted)?;
        world.plan(&self.scene, expected, &mut self.plans)
    }
}

fn unpredicted() -> Error {
    Error::invalid("this step has no predictions")
}
