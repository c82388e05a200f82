//! All agents with native planners in one call, on all cores.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{MutexGuard, OnceLock};

use super::{Drive, Expected, Step, World};
use crate::barrier::Barriers;
use crate::error::Result;
use crate::plan::frenet::{self, CostWeights, FrenetSettings, FrenetTarget};
use crate::plan::{
    self, Candidates, LaneChange, Other, PlanRequest, PlanResult, Planner, PlanningMemory, PredictionIndex,
};
use crate::predict::completed;
use crate::rules::Rules;
use crate::scene::{PositionIndex, Scene};
use crate::trajectory::{Plans, Predictions, Trajectory};
use crate::v2x::{Extra, Known, SharedPredictions};
use crate::vehicle::single_track::Moved;

impl World {
    /// Writes the plans of all driving agents; rows of agents with planners outside the core are left without a plan.
    ///
    /// Every agent plans on the same scene and is independent of all others, so the result depends neither on the
    /// number of threads nor on the order.
    ///
    /// # Errors
    /// `WrongTimeStep` if the scene is not of now; `InvalidInput` if it is of another world.
    pub(super) fn plan(&self, scene: &Scene, expected: &Expected, plans: &mut Plans) -> Result<()> {
        self.check_time_step("scene", scene.time_step)?;
        self.check_scene(scene)?;
        let (crowd, predictions) = &Crowd::expected(scene, expected, self.drives.len());
        let prediction_index = PredictionIndex::of(predictions, &crowd.index.positions);
        let expected: (&Predictions, _) = (predictions, &prediction_index);
        let drives: Vec<&Drive> = self.drives.iter().filter(|drive| drive.is_driving(self.time_step)).collect();
        let results: Vec<OnceLock<PlanResult>> = drives.iter().map(|_| OnceLock::new()).collect();
        let clock = self.settings.clock;
        let spent: Vec<AtomicU64> = clock.iter().flat_map(|_| drives.iter().map(|_| AtomicU64::new(0))).collect();
        let order = self.longest_first(&drives);
        self.threads.each(order.len(), |thread, i| {
            let row = order[i];
            let begin = clock.map(|clock| (clock.0)());
            let plan = self.plan_one(drives[row], (scene, crowd), expected, &mut self.memory(thread));
            if let Some(plan) = plan {
                results[row].set(plan).expect("every agent plans once");
            }
            if let (Some(clock), Some(begin)) = (clock, begin) {
                spent[row].store((clock.0)().saturating_sub(begin), Ordering::Relaxed);
            }
        });
        let lengths = results.iter().filter_map(OnceLock::get).map(|result| result.trajectory.points.len());
        let n_points = lengths.max().unwrap_or(0);
        let n_points = n_points.max(predictions.n_steps + 1).max(2);
        plans.clear(self.time_step, drives.iter().map(|drive| drive.agent.id), n_points);
        plans.nanoseconds.extend(spent.into_iter().map(AtomicU64::into_inner));
        for (row, result) in results.into_iter().enumerate() {
            let Some(result) = result.into_inner() else { continue };
            let points = &result.trajectory.points;
            plans.points[row * n_points..row * n_points + points.len()].copy_from_slice(points);
            plans.status[row] = result.status;
            plans.cost[row] = result.cost;
            plans.message[row] = result.message;
            plans.lane_change[row] = result.lane_change;
            plans.obstructions.extend(result.obstruction.map(|obstruction| (row, obstruction)));
        }
        Ok(())
    }

    /// All that an agent's plan is chosen from; `None` if its planner does not choose.
    ///
    /// # Errors
    /// `UnknownId`, `WrongTimeStep`; `InvalidInput` if the step has no predictions.
    pub fn candidates(&self, id: i64, step: &Step) -> Result<Option<Candidates>> {
        let (scene, expected) = (&*step.scene, step.expected()?);
        self.check_time_step("scene", scene.time_step)?;
        let drive = &self.drives[self.drive_index(id)?];
        if !drive.agent.planner.chooses() || !drive.is_driving(self.time_step) {
            return Ok(None);
        }
        let (crowd, table) = &Crowd::expected(scene, expected, 1);
        let (mut visible, mut others) = (Vec::new(), Vec::new());
        crowd.see(drive, scene, &mut visible, &mut others);
        let perceived = crowd.perceive(drive, scene, table, &visible, &mut others);
        let exact = PredictionIndex::of(table, &crowd.index.positions);
        let (table, prediction_index) = perceived.as_ref().map_or((&**table, &exact), |(table, index)| (table, index));
        let level = self.on_its_storey(drive, &others, table);
        let request = self.request(drive, &others, (level.as_ref().unwrap_or(table), prediction_index));
        Ok(plan::candidates(&drive.agent.planner, drive.prepared(&self.scenario), &request))
    }

    /// Rows of the agents, those whose last plans took most work first: what begins last should not take longest. Nothing
    /// but time depends on it.
    fn longest_first(&self, drives: &[&Drive]) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..drives.len()).collect();
        if self.settings.threads > 1 {
            rows.sort_by_cached_key(|row| Reverse(drives[*row].effort.0.load(Ordering::Relaxed)));
        }
        rows
    }

    /// The memory of a thread; the lock is never contended.
    fn memory(&self, thread: usize) -> MutexGuard<'_, PlanningMemory> {
        // Plans do not depend on what is left in it, so a panic in between spoils nothing.
        self.memories[thread].lock()
    }

    fn plan_one(
        &self,
        drive: &Drive,
        (scene, crowd): (&Scene, &Crowd<'_>),
        expected: (&Predictions, &PredictionIndex),
        memory: &mut PlanningMemory,
    ) -> Option<PlanResult> {
        if let Some(kept) = self.kept_plan(drive) {
            drive.effort.0.store(0, Ordering::Relaxed);
            return Some(kept);
        }
        if drive.agent.planner == Planner::External {
            return None;
        }
        let mut others: Vec<Other<'_>> = std::mem::take(&mut memory.others);
        crowd.see(drive, scene, &mut memory.visible, &mut others);
        let perceived = crowd.perceive(drive, scene, expected.0, &memory.visible, &mut others);
        let expected = perceived.as_ref().map_or(expected, |(table, index)| (table, index));
        let level = self.on_its_storey(drive, &others, expected.0);
        let request = self.request(drive, &others, (level.as_ref().unwrap_or(expected.0), expected.1));
        let plan = match (&drive.agent.planner, drive.weights) {
            (Planner::Frenet(settings), Some(weights)) => {
                let planner = Planner::Frenet(Box::new(FrenetSettings { weights, ..**settings }));
                memory.cost_breakdown().enabled = true;
                let plan = plan::plan(&planner, drive.prepared(&self.scenario), &request, memory);
                let breakdown = std::mem::take(memory.cost_breakdown());
                *drive.terms.lock() = breakdown.terms;
                plan
            }
            (planner @ Planner::Reference(..), _) => {
                memory.alertness = drive.alertness.lock().at(self.time_step);
                let plan = plan::plan(planner, drive.prepared(&self.scenario), &request, memory);
                drive.alertness.lock().note(self.time_step, memory.alertness);
                plan
            }
            (planner, _) => plan::plan(planner, drive.prepared(&self.scenario), &request, memory),
        };
        drive.effort.0.store(memory.effort(), Ordering::Relaxed);
        others.clear();
        // An empty list is handed on as memory: collecting in place allocates nothing.
        memory.others = others.into_iter().map(|_| unreachable!("it is empty")).collect();
        plan
    }

    /// The rest of the last plan, if it is not yet time for a new one.
    fn kept_plan(&self, drive: &Drive) -> Option<PlanResult> {
        if !drive.keeps_plan(self.time_step, self.settings.step.replan_every, self.scenario.dt) {
            return None;
        }
        let (plan, made) = drive.plan.as_ref()?;
        let points = plan.points[(self.time_step - made) as usize..].to_vec();
        Some(PlanResult::planned(Trajectory { points }, f64::NAN))
    }

    /// The rules of the road for an agent now.
    pub(super) fn rules<'a>(&'a self, drive: &'a Drive) -> Rules<'a> {
        let mut told = Barriers::NONE;
        told.extend([self.crosswalk_ahead(drive), self.ordered(drive)].into_iter().flatten());
        Rules { told, ..self.lines(drive) }
    }

    /// The same without junctions and crosswalks.
    pub(super) fn lines<'a>(&'a self, drive: &'a Drive) -> Rules<'a> {
        Rules {
            control: &self.scenario.control,
            settings: &drive.agent.rules,
            way: &drive.way,
            time_step: self.time_step,
            entered: drive.agent.start_time_step,
            dt: self.scenario.dt,
            served: drive.lines.served(&drive.agent.rules, self.scenario.dt),
            passing: drive.lines.passing(),
            front: drive.front(),
            told: Barriers::NONE,
        }
    }

    /// An agent, by its position among the agents, plans with other cost weights from now on.
    pub(crate) fn weigh(&mut self, index: usize, weights: CostWeights) {
        self.drives[index].weights = Some(weights);
    }

    /// The terms of the last choice of an agent that plans with weights of its own; `None` if nothing was chosen.
    pub(crate) fn terms(&self, index: usize) -> Option<[f64; frenet::N_TERMS]> {
        *self.drives[index].terms.lock()
    }

    /// The next state of an agent, by its position among the agents, that drives a sample with a given end. It looks at
    /// nothing but its path.
    pub(crate) fn aim(&self, index: usize, target: &FrenetTarget, numbers: [f64; 3]) -> Moved {
        let drive = &self.drives[index];
        let predictions = Predictions { time_step: self.time_step, ..Predictions::default() };
        let prediction_index = PredictionIndex::of(&predictions, &[]);
        let rules = self.lines(drive);
        target.drive(&self.request_with(drive, &[], (&predictions, &prediction_index), rules), numbers)
    }

    fn request<'a>(
        &'a self,
        drive: &'a Drive,
        others: &'a [Other<'a>],
        expected: (&'a Predictions, &'a PredictionIndex),
    ) -> PlanRequest<'a> {
        self.request_with(drive, others, expected, self.rules(drive))
    }

    pub(super) fn request_with<'a>(
        &'a self,
        drive: &'a Drive,
        others: &'a [Other<'a>],
        (predictions, prediction_index): (&'a Predictions, &'a PredictionIndex),
        rules: Rules<'a>,
    ) -> PlanRequest<'a> {
        PlanRequest {
            time_step: self.time_step,
            dt: self.scenario.dt,
            state: self.states[drive.row].unwrap_or_default(),
            entry: drive.agent.initial_state,
            vehicle: &drive.agent.vehicle,
            shape: &drive.agent.shape,
            route: &drive.agent.route,
            s_hint: drive.s,
            goal: &drive.agent.goal,
            road: &self.scenario.road,
            was_on_road: drive.was_on_road,
            others,
            predictions,
            prediction_index,
            previous: drive.plan.as_ref().map(|(plan, _)| plan),
            previous_age: drive.plan.as_ref().map_or(0, |(_, made)| (self.time_step - made) as usize),
            standing: drive.memory.standing as f64 * self.scenario.dt,
            rules,
            last_time_step: drive.last_time_step(&self.settings.step),
            lane_change: LaneChange::default(),
            indicator: drive.indicator,
            line: None,
        }
    }
}

/// All participants present, as planners see them, and what agents were told.
pub(super) struct Crowd<'a> {
    /// One position per row of the predictions.
    index: PositionIndex,
    pub(super) all: Vec<Other<'a>>,
    told: Option<&'a SharedPredictions>,
}

impl<'a> Crowd<'a> {
    /// As so many of them look at it.
    pub(super) fn of(scene: &'a Scene, viewers: usize) -> Self {
        let participants = &scene.participants;
        let other = |(place, row): (usize, &usize)| Other {
            row: place,
            pose: scene.state(*row).pose(),
            velocity: scene.observed_velocity(*row),
            braking: scene.observed_braking(*row),
            shape: &participants.shape[*row],
            is_static: participants.is_static[*row],
            kind: participants.kind[*row],
        };
        Self {
            index: scene.position_index(viewers),
            all: scene.present.iter().enumerate().map(other).collect(),
            told: None,
        }
    }

    /// The same with what agents were told, and predictions for all of them.
    fn expected(scene: &'a Scene, expected: &'a Expected, viewers: usize) -> (Self, Cow<'a, Predictions>) {
        let mut crowd = Self::of(scene, viewers);
        let Some(told) = &expected.told else { return (crowd, completed(&expected.predictions, scene)) };
        crowd.index.positions.extend(told.extras.iter().map(|extra| extra.state.pose().position));
        (Self { told: Some(told), ..crowd }, Cow::Borrowed(&told.table))
    }

    /// Writes the participants that an agent sees or was told of; `visible` is memory.
    fn see(&self, drive: &Drive, scene: &Scene, visible: &mut Vec<usize>, others: &mut Vec<Other<'a>>) {
        others.clear();
        if let Some(told) = self.told
            && let Some(known) = told.known.get(&drive.agent.id)
        {
            others.extend(known.iter().map(|known| self.other(known, told)));
            return;
        }
        scene.see(drive.row, &drive.agent.view, &self.index, visible);
        others.extend(visible.iter().map(|place| self.all[*place]));
    }

    /// Has the others that an agent sees be where they seem to be, and returns what it expects of them; `None` if it
    /// perceives all as it is. What it was told has no errors. `visible` is as `see` has written it.
    fn perceive(
        &self,
        drive: &Drive,
        scene: &Scene,
        predictions: &Predictions,
        visible: &[usize],
        others: &mut [Other<'a>],
    ) -> Option<(Predictions, PredictionIndex)> {
        let view = &drive.agent.view;
        if view.is_exact() {
            return None;
        }
        let (mut table, mut positions) = (predictions.clone(), self.index.positions.clone());
        let mut seen = |i: usize, place: usize| {
            let Some((state, motion)) = scene.seeming_to(drive.row, scene.present[place], view) else { return };
            let pose = state.pose();
            let off = pose.position - positions[place];
            table.shift(place, off, motion.velocity - self.all[place].velocity, scene.dt);
            positions[place] = pose.position;
            others[i] = Other { pose, velocity: motion.velocity, braking: motion.braking, ..others[i] };
        };
        match self.told.and_then(|told| told.known.get(&drive.agent.id)) {
            Some(known) => {
                let places = known.iter().enumerate().filter_map(|(i, known)| Some((i, known.seen?)));
                places.for_each(|(i, place)| seen(i, place));
            }
            None => visible.iter().enumerate().for_each(|(i, place)| seen(i, *place)),
        }
        let index = PredictionIndex::of(&table, &positions);
        Some((table, index))
    }

    fn other(&self, known: &Known, told: &'a SharedPredictions) -> Other<'a> {
        if let Some(place) = known.seen {
            return Other { row: known.row, ..self.all[place] };
        }
        let Extra { state, shape, is_static, kind, .. } =
            told.extra(known.row).expect("an unseen participant has a row of its own");
        Other {
            row: known.row,
            pose: state.pose(),
            velocity: state.velocity,
            braking: (-state.acceleration).max(0.0),
            shape,
            is_static: *is_static,
            kind: *kind,
        }
    }
}
