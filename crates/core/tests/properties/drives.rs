//! Worlds with agents of every native planner, predicted by every native predictor, and plans and predictions from
//! outside.

use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

use interdrive_core::geometry::shape::Shape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::plan::external_plan::StatedPlan;
use interdrive_core::plan::frenet::FrenetSettings;
use interdrive_core::plan::rollout::RolloutSettings;
use interdrive_core::plan::{
    CarFollowing, IdmMobilSettings, IdmSettings, LawfulSettings, Planner, ReferenceDriving, VelocityAdjustingSettings,
};
use interdrive_core::predict::neural::{Network, Neural};
use interdrive_core::predict::{LaneFollowing, Predictor, Spread};
use interdrive_core::reference_drivers::Driver;
use interdrive_core::route::{RouteSettings, find_route};
use interdrive_core::rules::RulesSettings;
use interdrive_core::scenario::{Goal, GoalState, Scenario};
use interdrive_core::scene::ViewLimits;
use interdrive_core::trajectory::{PlanStatus, Plans, Predictions, State};
use interdrive_core::v2x::V2xSettings;
use interdrive_core::vehicle::Vehicle;
use interdrive_core::world::{Agent, Forecast, Step, StepSettings, World, WorldSettings};

use crate::source::Source;
use crate::{network, roads, shapes, traffic};

fn frenet(source: &mut Source) -> FrenetSettings {
    let default = FrenetSettings { level: source.below(2), ..FrenetSettings::default() };
    if !source.is_odd() {
        return default;
    }
    let mut changed = default;
    changed.horizon = source.any(1.0, 5.0);
    changed.t_min = source.any(0.1, 1.0);
    changed.d_max = source.any(0.5, 4.0);
    changed.low_velocity = source.any(0.5, 5.0);
    changed.weights.prediction = source.any(0.0, 2.0);
    changed.weights.distance_to_obstacles = source.any(0.0, 2.0);
    changed.comfort.time_gap = source.any(0.5, 2.0);
    changed.expectation_density_min = source.any(0.0, 0.1);
    changed.lazy = source.chance(128);
    if changed.validate().is_ok() { changed } else { default }
}

fn rollout(source: &mut Source) -> RolloutSettings {
    let default = RolloutSettings::default();
    if !source.is_odd() {
        return default;
    }
    let mut changed = default;
    changed.horizon = source.any(0.5, 5.0);
    changed.margin_length = source.any(0.0, 2.0);
    changed.margin_width = source.any(0.0, 2.0);
    changed.margin_time = source.any(0.0, 0.1);
    changed.collision_mode_probability = source.any(0.0, 1.0);
    changed.weights.contact = source.any(0.0, 200.0);
    changed.weights.off_road = source.any(0.0, 500.0);
    changed.comfort.time_gap = source.any(0.5, 2.0);
    changed.comfort.acceleration = source.any(0.5, 5.0);
    changed.comfort.deceleration = source.any(0.5, 5.0);
    changed.comfort.jerk = source.any(0.5, 10.0);
    changed.comfort.lateral_acceleration = source.any(0.5, 5.0);
    if changed.validate().is_ok() { changed } else { default }
}

fn law(source: &mut Source) -> CarFollowing {
    let default = CarFollowing::default();
    if !source.is_odd() {
        return default;
    }
    let changed = CarFollowing {
        time_gap: source.any(0.5, 2.0),
        minimum_gap: source.any(0.0, 5.0),
        acceleration: source.any(0.5, 3.0),
        deceleration: source.any(0.5, 3.0),
        exponent: source.any(1.0, 8.0),
    };
    if changed.validate().is_ok() { changed } else { default }
}

/// Agents without a recording mostly get a planner that needs none: otherwise there is no world.
fn planner(source: &mut Source, is_recorded: bool) -> Planner {
    let idm = |source: &mut Source| IdmSettings { law: law(source), ..IdmSettings::default() };
    let kind = source.byte() % 11;
    match if (3..=4).contains(&kind) && !is_recorded && !source.is_odd() { 6 } else { kind } {
        0 | 1 => Planner::Rollout(Box::new(rollout(source))),
        2 => Planner::Frenet(Box::new(frenet(source))),
        3 => Planner::Recorded,
        4 => Planner::VelocityAdjusting(VelocityAdjustingSettings { law: law(source), ..Default::default() }),
        5 => Planner::Idm(idm(source)),
        6 => Planner::IdmMobil(Box::new(IdmMobilSettings { idm: idm(source), ..IdmMobilSettings::default() })),
        7 => Planner::Lawful(LawfulSettings { law: law(source), ..LawfulSettings::default() }),
        8 => Planner::Reference(Driver::ALL[usize::from(source.byte() % 4)], ReferenceDriving::default()),
        9 => Planner::Pdm(Box::default()),
        _ => Planner::External,
    }
}

fn predictor(source: &mut Source, scenario: &Arc<Scenario>) -> Predictor {
    static NETWORK: OnceLock<Arc<Network>> = OnceLock::new();
    let default = LaneFollowing::default();
    let lanes = if source.is_odd() {
        LaneFollowing {
            modes_max: source.below(10),
            lateral_acceleration: source.finite(0.1, 5.0),
            deceleration: source.finite(0.1, 5.0),
            return_time: source.finite(0.1, 10.0),
            ..default
        }
    } else {
        default
    };
    match source.below(5) {
        0 => Predictor::ConstantVelocity(Spread::default()),
        1 | 2 => Predictor::LaneFollowing(lanes),
        3 => Predictor::GroundTruth(Arc::clone(scenario), lanes),
        _ => {
            let network = Arc::clone(NETWORK.get_or_init(|| Arc::new(network::network())));
            Predictor::Neural(Neural { network, modes_max: 1 + source.below(4) })
        }
    }
}

/// Mostly somewhere ahead of the start.
fn goal(source: &mut Source, scenario: &Scenario, start: Pose) -> Goal {
    let n = if source.is_odd() { source.below(4) } else { 1 };
    let mut alternative = || {
        let n_areas = if source.chance(60) { 0 } else { 1 + source.below(2) };
        let mut interval =
            |low: f64, high: f64| source.chance(60).then(|| (source.finite(low, high), source.finite(low, high)));
        let (velocity, orientation) = (interval(0.0, 20.0), interval(-PI, PI));
        GoalState {
            areas: (0..n_areas)
                .map(|_| {
                    let near = if source.chance(60) {
                        roads::pose(source, &scenario.road)
                    } else {
                        let ahead = Point::from_angle(start.orientation) * source.within(5.0, 40.0);
                        Pose { position: start.position + ahead, ..start }
                    };
                    shapes::placed(source, near)
                })
                .collect(),
            time_step: (source.whole(0, 20), source.whole(20, 60)),
            velocity,
            orientation,
        }
    };
    Goal { states: (0..n).map(|_| alternative()).collect(), pace: None }
}

/// An agent, if there is a route for it; otherwise the reason was text. Some stand in for a recorded obstacle.
fn agent(source: &mut Source, scenario: &Scenario, id: i64) -> Option<Agent> {
    let recorded = &scenario.obstacles.states;
    let stand_in = (!recorded.ids.is_empty() && source.chance(128)).then(|| source.below(recorded.ids.len()));
    let first = recorded.first_time_step;
    let late = if source.chance(40) { source.whole(0, 5) } else { 0 };
    let start_time_step = if source.is_odd() { late } else { first.saturating_add(late) };
    let stand_in = stand_in.and_then(|row| Some((recorded.ids[row], recorded.get(row, start_time_step)?)));
    let pose = roads::pose(source, &scenario.road);
    let is_recorded = stand_in.is_some();
    let (id, state) = stand_in.unwrap_or((id, traffic::state(source, pose)));
    let kind = traffic::kind(source);
    let shape = if source.is_odd() { shapes::shape(source) } else { Shape::rectangle(4.5, 1.8) };
    let (length, width) = shape.extent();
    let vehicle = Vehicle::for_footprint(kind, length, width).unwrap_or(Vehicle::BMW_320I);
    let goal = goal(source, scenario, state.pose());
    let areas: Vec<_> = goal.states.iter().flat_map(|state| state.areas.iter().cloned()).collect();
    let route = find_route(&scenario.road, state.pose(), state.velocity, &areas, &RouteSettings::default());
    let route = match route {
        Ok(route) => route,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return None;
        }
    };
    assert!(route.path.length().is_finite() && route.start_s.is_finite());
    Some(Agent {
        id,
        kind,
        shape,
        vehicle,
        initial_state: state,
        start_time_step,
        replays_before: false,
        queue: None,
        goal,
        route: Arc::new(route),
        planner: planner(source, is_recorded),
        view: ViewLimits {
            sensor_radius: source.any(10.0, 100.0),
            occlusion: source.chance(100),
            ..ViewLimits::default()
        },
        rules: RulesSettings::default(),
        v2x: source.chance(60).then(|| source.chance(200)),
    })
}

/// Cooperation with an imperfect channel.
fn v2x(source: &mut Source) -> V2xSettings {
    V2xSettings {
        penetration: source.within(0.0, 1.0),
        delay: source.within(0.0, 0.4),
        jitter: source.within(0.0, 0.4),
        loss: source.within(0.0, 0.5),
        fading: source.chance(60),
        cpm: source.chance(120),
        ..V2xSettings::default()
    }
}

/// What a planner from outside hands over: from ordinary points to any numbers.
fn outside(source: &mut Source, now: &State, dt: f64) -> Vec<State> {
    let n = if source.is_odd() { source.below(40) } else { 2 + source.below(20) };
    let field = |source: &mut Source, at: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (0..n).map(|i| if source.is_odd() { source.any(-100.0, 100.0) } else { at(i as f64 * dt) }).collect()
    };
    let (sin, cos) = now.orientation.sin_cos();
    let x = field(source, &|t| now.x + now.velocity * t * cos);
    let y = field(source, &|t| now.y + now.velocity * t * sin);
    let (orientation, velocity) = (field(source, &|_| now.orientation), field(source, &|_| now.velocity));
    let rates = source.chance(128).then(|| field(source, &|_| 0.0));
    let stated = StatedPlan {
        x: &x,
        y: &y,
        orientation: &orientation,
        velocity: &velocity,
        acceleration: rates.as_deref(),
        yaw_rate: None,
    };
    match stated.points(dt) {
        Ok(points) => points,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            // Without the check, too: a plan is a plan of the world, whatever wrote it.
            (0..n)
                .map(|i| State { x: x[i], y: y[i], orientation: orientation[i], velocity: velocity[i], ..*now })
                .collect()
        }
    }
}

/// A table from outside that the core accepts, or that of a native predictor.
fn unsettled(source: &mut Source, native: Predictions) -> Predictions {
    let mut table = native.clone();
    let n = table.x.len();
    if n == 0 || !source.chance(60) {
        return native;
    }
    for _ in 0..source.below(8) {
        let i = (source.below(256) * 256 + source.below(256)) % n;
        let fields = [
            &mut table.x,
            &mut table.y,
            &mut table.orientation,
            &mut table.velocity,
            &mut table.covariance_xx,
            &mut table.covariance_xy,
            &mut table.covariance_yy,
        ];
        fields.into_iter().nth(source.below(7)).expect("seven fields")[i] = source.any(-20.0, 20.0);
        table.valid[(i + source.below(3)) % n] = source.chance(128);
    }
    if source.is_odd() {
        let p = table.probability.len();
        table.probability[source.below(p.min(256))] = source.any(0.0, 1.0);
    }
    match table.validate() {
        Ok(()) => table,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            native
        }
    }
}

/// What came of a world.
#[derive(Debug, PartialEq)]
struct Driven {
    /// Of all that happened.
    bits: Vec<u64>,
    /// The error that ended it.
    failed: String,
    n_planned: usize,
}

/// A world driven for some steps.
fn drive(mut source: Source, threads: usize) -> Option<Driven> {
    let source = &mut source;
    let scenario = Arc::new(traffic::scenario(source)?);
    let n_agents = 1 + source.below(4);
    let mut agents: Vec<Agent> = (0..n_agents).filter_map(|i| agent(source, &scenario, i as i64)).collect();
    if !source.is_odd() {
        agents.sort_by_key(|agent| agent.id);
        agents.dedup_by_key(|agent| agent.id);
    }
    let settings = WorldSettings {
        step: StepSettings {
            entry_wait: 0.0,
            grace_factor: if source.is_odd() { source.any(1.0, 3.0) } else { 1.7 },
            replan_every: 1 + source.below(3),
            history_steps: 1 + source.below(30),
            standstill_s: 60.0,
            max_steps: if source.is_odd() { 1 + source.below(8) } else { 10_000 },
        },
        threads,
        record_views: source.chance(60),
        v2x: if source.chance(60) { v2x(source) } else { V2xSettings::default() },
        ..WorldSettings::default()
    };
    let mut world = match World::new(Arc::clone(&scenario), agents, settings) {
        Ok(world) => world,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return None;
        }
    };
    let predictor = predictor(source, &scenario);
    let (n_steps, horizon) = (5 + source.below(8), 1 + source.below(30));
    let mut failed = String::new();
    for _ in 0..n_steps {
        if let Err(error) = step(source, &mut world, &predictor, horizon) {
            failed = error.to_string();
            assert!(!failed.is_empty());
            break;
        }
    }
    world.last_time_step();
    let n_planned = world.recording().plans().status.iter().filter(|status| **status == PlanStatus::Planned).count();
    Some(Driven { bits: bits(&world), failed, n_planned })
}

/// Number of plans that are driven in the world of some bytes.
pub fn n_planned(bytes: &[u8]) -> usize {
    drive(Source::new(bytes), 1).map_or(0, |driven| driven.n_planned)
}

fn step(
    source: &mut Source,
    world: &mut World,
    predictor: &Predictor,
    horizon: usize,
) -> interdrive_core::error::Result<()> {
    let mut begun = Step::begin(world);
    let predictions = unsettled(source, world.predict(predictor, &begun.scene, horizon)?);
    begun.expect(world, Forecast::Outside(&Arc::new(predictions)))?;
    begun.plan(world)?;
    let (mut plans, scene) = (begun.plans.clone(), Arc::clone(&begun.scene));
    for row in 0..plans.ids.len() {
        let id = plans.ids[row];
        let is_written = plans.status[row] == PlanStatus::Planned;
        let planned = plans.row_points(row).iter().take_while(|point| point.is_finite()).count();
        assert!(!is_written || planned >= 2, "agent {id} has a plan that is not a number");
        if plans.status[row] == PlanStatus::None || source.is_odd() {
            replace(source, world, &mut plans, id, &scene);
        }
    }
    if source.is_odd() {
        let id = plans.ids.first().copied().unwrap_or_default();
        world.candidates(id, &begun).ok();
    }
    world.step(&plans)?;
    let states = world.recording().last_states(1);
    for (row, valid) in states.valid.iter().enumerate() {
        assert!(!valid || states.get(row, world.time_step()).is_some_and(|state| state.is_finite()));
    }
    Ok(())
}

fn replace(source: &mut Source, world: &World, plans: &mut Plans, id: i64, scene: &interdrive_core::scene::Scene) {
    let row = scene.participants.ids.binary_search(&id).expect("agents are participants");
    let points = outside(source, &scene.state(row), world.scenario().dt);
    plans.set_row(id, &points).expect("the agent drives");
}

fn bits(world: &World) -> Vec<u64> {
    let states = world.recording().states();
    let mut bits: Vec<u64> = [&states.x, &states.y, &states.orientation, &states.velocity, &states.acceleration]
        .into_iter()
        .flatten()
        .map(|value| value.to_bits())
        .collect();
    bits.extend(world.outcomes().flat_map(|outcome| [outcome.kind as u64, outcome.impact_speed.to_bits()]));
    let plans = world.recording().plans();
    bits.extend(plans.cost.iter().chain(plans.points.iter().flatten()).map(|value| value.to_bits()));
    bits.extend(plans.status.iter().map(|status| *status as u64));
    bits
}

/// Any world that can be made is driven to its end, with one thread and with two to the same bits.
pub fn check(bytes: &[u8]) {
    let one = drive(Source::new(bytes), 1);
    if one.is_some() && bytes.last().is_some_and(|byte| byte % 4 == 0) {
        assert_eq!(one, drive(Source::new(bytes), 2), "one thread, two threads");
    }
}
