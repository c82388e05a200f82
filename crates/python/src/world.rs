//! The world and the tables of a step as handles.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use interdrive_core::error::Error;
use interdrive_core::geometry::shape::Shape;
use interdrive_core::plan::Planner;
use interdrive_core::recording::{Entry, Outcome, Sighting, Wait};
use interdrive_core::scene::{Participants, Scene};
use interdrive_core::trajectory::{Obstruction, PlanTable, State, States};
use interdrive_core::v2x::{Agreement, Logged, Row as Message};
use interdrive_core::vehicle::ParticipantKind;
use interdrive_core::world::{Agent, Clock, Outside, Queue, Step, World, WorldSettings};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays;
use crate::errors::{InputError, detached, exception};
use crate::getters::getters;
use crate::planner::PyPlanner;
use crate::predictions::{KnownParts, PyPredictions};
use crate::predictor::PyPredictor;
use crate::reference_drivers::driver;
use crate::route::{PyGoal, PyRoute};
use crate::scenario::{PyScenario, PyShape};
use crate::scene::{PyScene, Told, side, turn_of};
use crate::settings::read;
use crate::step::{PyForecast, PyStep, nanoseconds as clock_nanoseconds, now};
use crate::vehicle::PyVehicle;
use crate::view::{KnownBody, ProgressParts, PyView, progress};

/// Time step, rows present and the turns that they show, first time step and number of columns of the past, its six fields
/// row-major, its mask.
type SceneParts<'py> =
    (i64, Vec<usize>, Vec<f64>, i64, usize, [PyReadonlyArray1<'py, f64>; 6], PyReadonlyArray1<'py, bool>);

/// Participants that are driven from outside: the new ones (id, code of the kind, length, width), the ids of all that are
/// there, their states of shape (participants, 6), the ids of those that jumped.
type OutsideParts<'py> = (Vec<(i64, i64, f64, f64)>, Vec<i64>, PyReadonlyArray2<'py, f64>, Vec<i64>);

fn outside((new, ids, states, jumped): OutsideParts<'_>) -> PyResult<Outside> {
    if states.shape() != [ids.len(), 6] {
        let n = ids.len();
        return Err(InputError::new_err(format!("outside: states of shape {:?}, not ({n}, 6)", states.shape())));
    }
    let shape = |kind, length: f64, width| match kind {
        ParticipantKind::Pedestrian => Shape::circle(0.5 * length),
        _ => Shape::rectangle(length, width),
    };
    let new = new.into_iter().map(|(id, kind, length, width)| {
        let kind = ParticipantKind::from_code(kind).map_err(exception)?;
        Ok((id, kind, shape(kind, length, width)))
    });
    let rows = states.as_array();
    let state = |row: usize| {
        let [x, y, orientation, velocity, acceleration, yaw_rate] = [0, 1, 2, 3, 4, 5].map(|field| rows[[row, field]]);
        State { x, y, orientation, velocity, acceleration, yaw_rate }
    };
    let states = ids.iter().enumerate().map(|(row, id)| (*id, state(row))).collect();
    Ok(Outside { new: new.collect::<PyResult<_>>()?, states, jumped })
}

#[pyclass(frozen, name = "Agent", module = "interdrive._core")]
pub struct PyAgent(pub Arc<Agent>);

#[pymethods]
impl PyAgent {
    #[new]
    #[pyo3(signature = (
        id, kind, shape, vehicle, initial_state, start_time_step, goal, route, planner, view, rules, v2x=None,
        replays_before=false, queue=None
    ))]
    fn new(
        id: i64,
        kind: i64,
        shape: &PyShape,
        vehicle: &PyVehicle,
        initial_state: (f64, f64, f64, f64, f64, f64),
        start_time_step: i64,
        goal: &PyGoal,
        route: &PyRoute,
        planner: Option<&PyPlanner>,
        view: &Bound<'_, PyAny>,
        rules: &Bound<'_, PyAny>,
        v2x: Option<bool>,
        replays_before: bool,
        queue: Option<(i64, i64)>,
    ) -> PyResult<Self> {
        let (x, y, orientation, velocity, acceleration, yaw_rate) = initial_state;
        Ok(Self(Arc::new(Agent {
            id,
            kind: ParticipantKind::from_code(kind).map_err(exception)?,
            shape: Shape::clone(&shape.0),
            vehicle: vehicle.0,
            initial_state: State { x, y, orientation, velocity, acceleration, yaw_rate },
            start_time_step,
            replays_before,
            queue: queue.map(|(lane, until)| Queue { lane, until }),
            goal: goal.0.clone(),
            route: Arc::clone(&route.route),
            planner: planner.map_or(Planner::External, |planner| planner.0.clone()),
            view: read(view)?,
            rules: read(rules)?,
            v2x,
        })))
    }
}

/// The world, the time spent in its phases [ns], and its plans once they were handed over.
#[pyclass(name = "World", module = "interdrive._core")]
pub struct PyWorld(World, AtomicU64, Option<Py<PyDict>>);

impl PyWorld {
    /// Runs a phase with the interpreter released and adds its time to that of all phases.
    fn timed<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&World) -> Result<T, Error> + Send) -> PyResult<T> {
        let begin = now();
        let done = detached(py, || work(&self.0));
        self.1.fetch_add(nanoseconds(begin.elapsed()), Ordering::Relaxed);
        done
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

#[pymethods]
impl PyWorld {
    #[new]
    #[pyo3(signature = (
        scenario, agents, step, *, threads, record_views=false, v2x=None, seed=0, messages="none",
        profile=false, steps_without_agents=0
    ))]
    fn new(
        py: Python<'_>,
        scenario: &PyScenario,
        agents: Vec<PyRef<'_, PyAgent>>,
        step: &Bound<'_, PyAny>,
        threads: usize,
        record_views: bool,
        v2x: Option<&Bound<'_, PyAny>>,
        seed: u64,
        messages: &str,
        profile: bool,
        steps_without_agents: usize,
    ) -> PyResult<Self> {
        let agents: Vec<Arc<Agent>> = agents.iter().map(|agent| Arc::clone(&agent.0)).collect();
        let record_messages = match messages {
            "none" => Logged::None,
            "sent" => Logged::Sent,
            "links" => Logged::Links,
            _ => return Err(InputError::new_err(("messages", format!("must be none, sent or links, not {messages}")))),
        };
        let v2x = v2x.map(read).transpose()?.unwrap_or_default();
        let settings = WorldSettings {
            step: read(step)?,
            threads,
            record_views,
            v2x,
            seed,
            record_messages,
            steps_without_agents,
            clock: profile.then_some(Clock(clock_nanoseconds)),
            ..WorldSettings::default()
        };
        let scenario = Arc::clone(&scenario.0);
        let world = detached(py, || World::with_shared(scenario, agents, settings))?;
        Ok(Self(world, AtomicU64::new(0), None))
    }

    fn scene(&self, py: Python<'_>) -> PyResult<PyScene> {
        let scene = self.timed(py, |world| Ok(Arc::new(world.scene())))?;
        Ok(PyScene { scene, road: Arc::clone(&self.0.scenario().road) })
    }

    /// What an agent sees. `told` is `Ego._progress` of this view in the process that simulates: the world there knows
    /// it. `known` is what `Predictions.known` says; without it the view has what the agent's sensors see. `driver` is what its
    /// driver has drawn.
    #[pyo3(signature = (scene, id, told=None, known=None, driver=None))]
    fn view(
        &self,
        scene: &PyScene,
        id: i64,
        told: Option<ProgressParts>,
        known: Option<Vec<KnownParts>>,
        driver: Option<Py<PyDict>>,
    ) -> PyResult<PyView> {
        let agent = Arc::clone(self.0.agent(id).map_err(exception)?);
        let visible = self.0.visible(id, &scene.scene).map_err(exception)?;
        let row = self.0.participants().ids.binary_search(&id).expect("agents are participants");
        let progress = match told {
            Some(told) => progress(told)?,
            None => self.0.progress(id).map_err(exception)?,
        };
        let seems = scene.scene.perceived_by(row, &agent.view, &visible);
        Ok(PyView {
            visible,
            known: known.map(|known| known.into_iter().map(|parts| body(&scene.scene, parts)).collect()),
            row,
            state: scene.scene.state(row),
            progress,
            speed_limit: self.0.speed_limits(id).map_err(exception)?,
            scene: seems.as_ref().map_or_else(|| Arc::clone(&scene.scene), |seems| Arc::clone(&seems.scene)),
            perceived: seems.map(|seems| (Arc::clone(&scene.scene), seems)),
            road: Arc::clone(&self.0.scenario().road),
            agent,
            driver,
        })
    }

    /// The scene of another process that simulates the same world, from its `parts`.
    fn scene_from(&self, parts: SceneParts<'_>) -> PyResult<PyScene> {
        let (time_step, present, turns, first_time_step, n_steps, fields, valid) = parts;
        let participants = Arc::clone(self.0.participants());
        let n = participants.ids.len();
        if let Some(row) = present.iter().find(|row| **row >= n) {
            return Err(InputError::new_err(format!("scene: there is no row {row} among {n} participants")));
        }
        let mut past = States::absent(participants.ids.clone(), first_time_step, n_steps);
        past.valid = arrays::read_row("scene: valid", &valid, n * n_steps)?;
        let [x, y, orientation, velocity, acceleration, yaw_rate] = fields;
        past.x = arrays::read_row("scene: x", &x, n * n_steps)?;
        past.y = arrays::read_row("scene: y", &y, n * n_steps)?;
        past.orientation = arrays::read_row("scene: orientation", &orientation, n * n_steps)?;
        past.velocity = arrays::read_row("scene: velocity", &velocity, n * n_steps)?;
        past.acceleration = arrays::read_row("scene: acceleration", &acceleration, n * n_steps)?;
        past.yaw_rate = arrays::read_row("scene: yaw_rate", &yaw_rate, n * n_steps)?;
        if turns.len() != present.len() {
            return Err(InputError::new_err(format!("scene: {} turns of {} participants", turns.len(), present.len())));
        }
        let turns = turns.into_iter().map(turn_of).collect();
        let scene = Scene { time_step, dt: self.0.scenario().dt, participants, present, turns, past };
        Ok(PyScene { scene: Arc::new(scene), road: Arc::clone(&self.0.scenario().road) })
    }

    fn predict(
        &self,
        py: Python<'_>,
        predictor: &PyPredictor,
        scene: &PyScene,
        n_steps: usize,
    ) -> PyResult<PyPredictions> {
        self.timed(py, |world| world.predict(&predictor.0, &scene.scene, n_steps)).map(PyPredictions::whole)
    }

    /// Begins a step: what is there now.
    fn observe(&self, py: Python<'_>) -> PyResult<PyStep> {
        let begin = now();
        let step = self.timed(py, |world| Ok(Step::begin(world)))?;
        let road = Arc::clone(&self.0.scenario().road);
        Ok(PyStep { step, road, marks: vec![begin, now()], collision: None })
    }

    /// What agents expect in a step, and the plans of those whose planners are in the core; `n_steps` ahead, if the core
    /// predicts.
    #[pyo3(signature = (step, forecast, n_steps=0))]
    fn plan(&self, py: Python<'_>, step: &mut PyStep, forecast: PyForecast<'_>, n_steps: usize) -> PyResult<()> {
        forecast.with(n_steps, |forecast| self.timed(py, |world| step.step.expect(world, forecast)))?;
        step.mark();
        self.timed(py, |world| step.step.plan(world))?;
        step.mark();
        Ok(())
    }

    /// Stretches in which agents held for others, as a dict of arrays; going_id -1: the way behind was blocked.
    fn agreements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays::table(py, Agreement::columns(&self.0.agreements().iter().collect::<Vec<_>>()))
    }

    /// All messages as a dict of arrays: one row per message, and one per message and receiver in range, with
    /// receiver_id -1 in the former, and arrived -1 where the message is lost; and totals. None if no agent has V2X.
    fn messages<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(log) = self.0.messages() else { return Ok(None) };
        let dict = arrays::table(py, Message::columns(&log.rows.iter().collect::<Vec<_>>()))?;
        dict.set_item("messages", log.messages)?;
        dict.set_item("total_bytes", log.bytes)?;
        dict.set_item("total_in_range", log.in_range)?;
        dict.set_item("total_received", log.received)?;
        dict.set_item("peak_bytes", log.peak_bytes)?;
        Ok(Some(dict))
    }

    /// Lets an agent drive on that the last step ended by a contact; the other participant leaves.
    fn drive_on(&mut self, id: i64) -> PyResult<()> {
        self.0.drive_on(id).map_err(exception)
    }

    /// Puts a reference driver in the place of an agent from the next plan on.
    fn replace_driver(&mut self, agent_id: i64, name: &str) -> PyResult<()> {
        self.0.replace_driver(agent_id, driver(name)?).map_err(exception)
    }

    /// Adds participants that are driven from outside and are there before the first step.
    fn place_outside(&mut self, parts: OutsideParts<'_>) -> PyResult<()> {
        self.0.place_outside(&outside(parts)?).map_err(exception)
    }

    /// Where the agents will be after a step, if they do not end by their plans: ids, and states of shape (agents, 6).
    fn next_of<'py>(&self, py: Python<'py>, step: &PyStep) -> PyResult<(Vec<i64>, Bound<'py, PyAny>)> {
        let next = self.0.next_of(&step.step.plans).map_err(exception)?;
        let flat = next.iter().flat_map(|(_, state)| {
            [state.x, state.y, state.orientation, state.velocity, state.acceleration, state.yaw_rate]
        });
        let states = arrays::grid(py, flat.collect(), [next.len(), 6])?;
        Ok((next.into_iter().map(|(id, _)| id).collect(), states))
    }

    /// Ends a step: moves all participants; among those driven from outside, if there are any.
    #[pyo3(signature = (step, driven=None))]
    fn advance(&mut self, py: Python<'_>, step: &mut PyStep, driven: Option<OutsideParts<'_>>) -> PyResult<()> {
        step.mark();
        let driven = driven.map(outside).transpose()?.unwrap_or_default();
        let (world, plans) = (&mut self.0, &step.step.plans);
        let mut contacts = [None; 2];
        detached(py, || world.step_among(plans, &driven, || contacts = [contacts[1], Some(now())]))?;
        step.mark();
        if let [Some(begin), Some(end)] = contacts {
            step.collision = Some(end - begin);
        }
        if let [.., begin, end] = step.marks[..] {
            self.1.fetch_add(nanoseconds(end - begin), Ordering::Relaxed);
        }
        Ok(())
    }

    /// All samples of an agent's planner as a dict of arrays; None if it has none.
    fn candidates<'py>(&self, py: Python<'py>, id: i64, step: &PyStep) -> PyResult<Option<Bound<'py, PyDict>>> {
        let (world, step) = (&self.0, &step.step);
        let found = detached(py, || world.candidates(id, step))?;
        found.map(|candidates| crate::planner::candidates_dict(py, &candidates)).transpose()
    }

    /// Outcomes of all agents as a dict of arrays, sorted by id.
    fn outcomes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        outcomes_dict(py, &self.0)
    }

    /// Participants and their states as a dict of arrays, shape (participants, time_steps).
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        all_states_dict(py, &self.0)
    }

    /// What was recorded since the last call, which the world forgets: states as `states` gives them, of the participants
    /// that were there, their `row` among all, and plans; with the present one only at the `end`.
    fn take_recorded<'py>(&mut self, py: Python<'py>, end: bool) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
        let (rows, states, plans) = self.0.take_recorded(end);
        let dict = states_dict(py, self.0.participants(), states, &rows)?;
        dict.set_item("row", arrays::row(py, rows.iter().map(|row| *row as i64).collect()))?;
        Ok((dict, plans_dict(py, plans)?))
    }

    /// All participants as `states` gives them, without their states.
    fn participants<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (participants, time_step) = (self.0.participants(), self.0.time_step());
        let rows: Vec<usize> = (0..participants.ids.len()).collect();
        states_dict(py, participants, States::absent(participants.ids.clone(), time_step, 0), &rows)
    }

    /// Visibility intervals per observer and participant as a dict of arrays; empty unless the world records views.
    fn sightings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let sightings: Vec<_> = self.0.recording().sightings().collect();
        arrays::table(py, Sighting::columns(&sightings.iter().collect::<Vec<_>>()))
    }

    /// Waits before junctions as a dict of arrays; `kind` is a code of `interdrive.run.ORDERS`, `by_id` -1 for none.
    fn waits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays::table(py, Wait::columns(&self.0.recording().waits().collect::<Vec<_>>()))
    }

    /// When agents that obey orders entered areas of junctions, as a dict of arrays; `granted`: not although they were told to
    /// wait.
    fn entries<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays::table(py, Entry::columns(&self.0.recording().entries().iter().collect::<Vec<_>>()))
    }

    /// All plans as a dict of arrays, one row per time step and agent.
    fn plans<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        match &self.2 {
            Some(handed_over) => handed_over.bind(py).copy(),
            None => plans_dict(py, self.0.recording().plans().clone()),
        }
    }

    /// The same at the end of a run, without a copy of the points: the world forgets them.
    fn hand_over_plans<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        if self.2.is_none() {
            self.2 = Some(plans_dict(py, self.0.take_plans())?.unbind());
        }
        self.plans(py)
    }
}

/// A participant that an agent knows of, from plain numbers.
fn body(scene: &Scene, (id, via, age, place, numbers): KnownParts) -> KnownBody {
    let (kind, is_static, length, width, [x, y, orientation, velocity, acceleration, yaw_rate]) = numbers;
    let state = State { x, y, orientation, velocity, acceleration, yaw_rate };
    let seen = usize::try_from(place).ok().and_then(|place| scene.present.get(place).copied());
    let told = || Told { id, kind, is_static, shape: Shape::rectangle(length, width), state };
    KnownBody { via, age, body: seen.ok_or_else(told) }
}

/// Outcomes of all agents as a dict of arrays, sorted by id.
pub fn outcomes_dict<'py>(py: Python<'py>, world: &World) -> PyResult<Bound<'py, PyDict>> {
    let dict = arrays::table(py, Outcome::columns(&world.outcomes().collect::<Vec<_>>()))?;
    dict.set_item("agent_id", arrays::row(py, world.agents().map(|agent| agent.id).collect()))?;
    Ok(dict)
}

/// All participants and their states as a dict of arrays, shape (participants, time_steps).
pub fn all_states_dict<'py>(py: Python<'py>, world: &World) -> PyResult<Bound<'py, PyDict>> {
    let states = world.recording().states();
    let rows: Vec<usize> = (0..states.ids.len()).collect();
    states_dict(py, world.participants(), states, &rows)
}

/// The participants of some rows and their states as a dict of arrays, shape (participants, time_steps).
fn states_dict<'py>(
    py: Python<'py>,
    participants: &Participants,
    states: States,
    rows: &[usize],
) -> PyResult<Bound<'py, PyDict>> {
    let shape = [states.ids.len(), states.n_steps];
    let extent: Vec<(f64, f64)> = rows.iter().map(|row| participants.shape[*row].extent()).collect();
    let truths = |of: &[bool]| arrays::row(py, rows.iter().map(|row| of[*row]).collect());
    let dict = PyDict::new(py);
    dict.set_item("first_time_step", states.first_time_step)?;
    dict.set_item("kind", arrays::row(py, rows.iter().map(|row| participants.kind[*row] as i64).collect()))?;
    dict.set_item("is_agent", truths(&participants.is_agent))?;
    dict.set_item("is_static", truths(&participants.is_static))?;
    dict.set_item("length", arrays::row(py, extent.iter().map(|e| e.0).collect()))?;
    dict.set_item("width", arrays::row(py, extent.iter().map(|e| e.1).collect()))?;
    dict.set_item("ids", arrays::row(py, states.ids))?;
    for (name, values) in [
        ("x", states.x),
        ("y", states.y),
        ("orientation", states.orientation),
        ("velocity", states.velocity),
        ("acceleration", states.acceleration),
        ("yaw_rate", states.yaw_rate),
    ] {
        dict.set_item(name, arrays::grid(py, values, shape)?)?;
    }
    dict.set_item("valid", arrays::grid(py, states.valid, shape)?)?;
    Ok(dict)
}

/// Plans as a dict of arrays, one row per time step and agent; the points are not copied.
pub fn plans_dict<'py>(py: Python<'py>, plans: PlanTable) -> PyResult<Bound<'py, PyDict>> {
    let shape = [plans.n_rows(), plans.n_points];
    let dict = PyDict::new(py);
    dict.set_item("time_step", arrays::row(py, plans.time_step))?;
    dict.set_item("agent_id", arrays::row(py, plans.agent_id))?;
    dict.set_item("status", arrays::row(py, plans.status.iter().map(|status| *status as i64).collect()))?;
    dict.set_item("cost", arrays::row(py, plans.cost))?;
    dict.set_item("turn", arrays::row(py, plans.turn.into_iter().map(side).collect()))?;
    let mut obstructions: Vec<Option<&Obstruction>> = vec![None; shape[0]];
    plans.obstructions.iter().for_each(|(row, obstruction)| obstructions[*row] = Some(obstruction));
    let words: Vec<&str> = obstructions.iter().map(|o| o.map_or("", |o| o.rejection.as_str())).collect();
    dict.set_item("rejection", PyTuple::new(py, words)?)?;
    for (name, number) in [
        ("rejection_x", (|o: &Obstruction| o.at.x) as fn(&Obstruction) -> f64),
        ("rejection_y", |o| o.at.y),
        ("rejection_overhang", |o| o.overhang),
    ] {
        let column = obstructions.iter().map(|o| o.map_or(f64::NAN, number)).collect();
        dict.set_item(name, arrays::row(py, column))?;
    }
    for (name, column) in PlanTable::FIELDS.into_iter().zip(plans.points) {
        dict.set_item(name, arrays::grid(py, column, shape)?)?;
    }
    Ok(dict)
}

getters! { PyWorld {
    /// Ids of the agents with V2X, ascending.
    equipped: Vec<i64> = |this| this.0.equipped().to_vec();
    /// Ids of the agents that enter junctions when they are told to, ascending.
    obeying: Vec<i64> = |this| this.0.obeying();
    time_step: i64 = |this| this.0.time_step();
    is_done: bool = |this| this.0.is_done();
    /// Ids of the agents that drive now, ascending.
    driving: Vec<i64> = |this| this.0.driving();
    /// Latest time step at which the last agent ends.
    last_time_step: Option<i64> = |this| this.0.last_time_step();
    /// Pairs that touched when one of them entered and have not separated since.
    entered_in_contact: Vec<(i64, i64)> = |this| this.0.entered_in_contact();
    /// Seconds that the core has worked in steps without the interpreter.
    native_seconds: f64 = |this| 1e-9 * this.1.load(Ordering::Relaxed) as f64;
} }
