//! What agents with V2X expect and know.

use super::*;
use crate::predict::{Predictor, Spread};
use crate::trajectory::{PlanStatus, Predictions};
use crate::v2x::{Known, SharedPredictions, V2xSettings, Via};

const DT: f64 = 0.1;

/// Two lanes; the agents have V2X as `equipped` says.
fn connected(agents: Vec<Agent>, recorded: &[Recorded], v2x: V2xSettings) -> World {
    let settings = WorldSettings { v2x: V2xSettings { penetration: 1.0, ..v2x }, ..WorldSettings::default() };
    world_with(agents, recorded, settings)
}

/// Drive at constant acceleration until standstill: one point per step for `seconds`.
fn drive(from: State, acceleration: f64, seconds: f64) -> Vec<State> {
    let stop = if acceleration < 0.0 { -from.velocity / acceleration } else { f64::INFINITY };
    let at = |k: usize| {
        let t = (k as f64 * DT).min(stop);
        let x = from.x + from.velocity * t + 0.5 * acceleration * t * t;
        State { x, velocity: from.velocity + acceleration * t, acceleration, ..from }
    };
    (0..=(seconds / DT).round() as usize).map(at).collect()
}

/// One step in which agents follow these plans from now on; all others stay at their speeds.
fn follow(world: &mut World, given: &[(i64, Vec<State>)]) {
    follow_as(world, given, PlanStatus::Planned);
}

/// The same with plans of a status.
fn follow_as(world: &mut World, given: &[(i64, Vec<State>)], status: PlanStatus) {
    let mut plans = Plans::none(world.time_step(), world.driving(), 31);
    for id in world.driving() {
        let now = state(world, id).expect("a driving agent is present");
        let plan =
            given.iter().find(|(agent, _)| *agent == id).map_or_else(|| drive(now, 0.0, 3.0), |(_, plan)| plan.clone());
        plans.set_row(id, &plan).expect("it drives");
        let row = plans.ids.binary_search(&id).expect("it drives");
        plans.status[row] = status;
    }
    world.step(&plans).expect("plans of all driving agents");
}

fn expected(world: &World) -> (Predictions, SharedPredictions) {
    let scene = world.scene();
    let spread = Spread { position_sigma: 0.15, acceleration_sigma: 0.8, lateral_rate: 0.25 };
    let table = world.predict(&Predictor::ConstantVelocity(spread), &scene, 30).expect("predictions");
    let found = world.with_messages(&scene, &table).expect("of now").expect("agents with V2X");
    (table, found)
}

fn of(found: &SharedPredictions, observer: i64, id: i64) -> Option<Known> {
    found.known[&observer].iter().find(|known| known.id == id).copied()
}

/// x of a row at a step.
fn x_at(found: &SharedPredictions, known: &Known, step: usize) -> f64 {
    found.table.x[found.table.offset(known.row, 0) + step]
}

#[test]
fn an_agent_that_announces_to_brake_is_expected_to_brake() {
    let follower = agent(1, at(10.0, 0.0, 20.0), vec![far()]);
    let leader = agent(2, at(60.0, 0.0, 20.0), vec![far()]);
    let mut world = connected(vec![follower, leader], &[], V2xSettings::default());
    let plan = drive(at(60.0, 0.0, 20.0), -6.0, 4.0);
    follow(&mut world, &[(2, plan.clone())]);
    let (alone, found) = expected(&world);
    let known = of(&found, 1, 2).expect("in sight");
    assert_eq!((known.via, known.age), (Via::Sensors, 0.1));
    // Three seconds from now is 3.1 s after the plan was made.
    assert!((x_at(&found, &known, 29) - plan[31].x).abs() < 0.1);
    let straight = alone.x[alone.offset(1, 0) + 29];
    assert!((straight - plan[31].x - 27.0).abs() < 0.5, "{straight}");
}

#[test]
fn a_plan_counts_for_as_long_as_its_sender_follows_it() {
    for (aside, follows) in [(0.5, true), (1.2, false)] {
        let follower = agent(1, at(10.0, 0.0, 10.0), vec![far()]);
        let leader = agent(2, at(60.0, 0.0, 10.0), vec![far()]);
        let settings = V2xSettings { mcm_interval: 5.0, delay: 0.2, ..V2xSettings::default() };
        let mut world = connected(vec![follower, leader], &[], settings);
        follow(&mut world, &[]);
        // The message about the first step arrives with the second one; until then the sender has moved aside.
        let beside = State { y: 0.5 * aside, ..at(62.0, 0.0, 10.0) };
        follow(&mut world, &[(2, vec![at(61.0, 0.0, 10.0), beside])]);
        let (_, found) = expected(&world);
        let known = of(&found, 1, 2).expect("in sight");
        assert!(known.age > 0.0, "half of it is little enough");
        let start = found.table.offset(known.row, 0);
        assert!((found.table.y[start] - 0.5 * aside).abs() < 0.06, "it begins where the sender is");
        let far_aside = State { y: aside, ..at(63.0, 0.0, 10.0) };
        follow(&mut world, &[(2, vec![beside, far_aside])]);
        let (_, found) = expected(&world);
        let known = of(&found, 1, 2).expect("in sight");
        assert_eq!(known.age > 0.0, follows, "{aside} m");
        assert_eq!(known.row == 1, !follows, "otherwise the row of the predictor");
    }
}

#[test]
fn the_plan_of_an_emergency_is_not_expected_to_be_followed() {
    for (status, counts) in [(PlanStatus::Planned, true), (PlanStatus::EmergencyBraking, false)] {
        let follower = agent(1, at(10.0, 0.0, 10.0), vec![far()]);
        let leader = agent(2, at(60.0, 0.0, 10.0), vec![far()]);
        let mut world = connected(vec![follower, leader], &[], V2xSettings::default());
        follow_as(&mut world, &[(2, drive(at(60.0, 0.0, 10.0), -6.0, 4.0))], status);
        let (_, found) = expected(&world);
        let known = of(&found, 1, 2).expect("in sight");
        assert_eq!(known.row != 1, counts, "{status:?}: a row of its own");
    }
}

#[test]
fn an_old_plan_is_shifted_and_less_certain() {
    let follower = agent(1, at(10.0, 0.0, 10.0), vec![far()]);
    let leader = agent(2, at(60.0, 0.0, 10.0), vec![far()]);
    let settings = V2xSettings { delay: 0.5, mcm_interval: 5.0, ..V2xSettings::default() };
    let mut world = connected(vec![follower, leader], &[], settings);
    let plan = drive(at(60.0, 0.0, 10.0), -1.0, 5.0);
    for step in 0..5 {
        follow(&mut world, &[(2, plan[step..].to_vec())]);
    }
    let (_, found) = expected(&world);
    let known = of(&found, 1, 2).expect("in sight");
    assert!((known.age - 0.5).abs() < 1e-9);
    assert!((x_at(&found, &known, 9) - plan[15].x).abs() < 0.02, "a second ahead is 1.5 s after the plan was made");
    let variance = found.table.covariance_xx[found.table.offset(known.row, 0) + 9];
    assert!((variance - (0.1_f64.powi(2) + 0.45_f64.powi(2))).abs() < 1e-9, "{variance}");
}

/// Agent 1 looks along the road past a truck at agent 2 and a parked car behind it; agent 2 is equipped as said.
fn hidden_car(is_equipped: bool, loss: f64) -> World {
    let view = ViewLimits { occlusion: true, ..ViewLimits::default() };
    let observer = Agent { view, ..agent(1, at(10.0, 0.0, 5.0), vec![far()]) };
    // In the other lane, further ahead: sees both sides of the truck.
    let witness = Agent { view, v2x: Some(is_equipped), ..agent(2, at(60.0, 3.5, 5.0), vec![far()]) };
    let car = Recorded::moving(3, (0..60).map(|k| (k < 20).then(|| at(45.0 + 0.5 * f64::from(k), 0.0, 5.0))));
    let truck = Recorded::moving(4, (0..60).map(|k| Some(at(30.0 + 0.5 * f64::from(k), 0.0, 5.0))));
    let settings = V2xSettings { cpm: true, loss, ..V2xSettings::default() };
    connected(vec![observer, witness], &[car, truck], settings)
}

#[test]
fn what_another_one_sees_is_known_a_step_later_and_forgotten_when_it_has_left() {
    let mut world = hidden_car(true, 0.0);
    let ids = |world: &World| -> Vec<i64> { expected(world).1.known[&1].iter().map(|known| known.id).collect() };
    assert_eq!(ids(&world), [2, 4], "the truck hides the car");
    follow(&mut world, &[]);
    let (_, found) = expected(&world);
    let known = of(&found, 1, 3).expect("told");
    assert_eq!((known.via, known.seen), (Via::Cpm, None));
    for _ in 0..5 {
        let (_, found) = expected(&world);
        let known = of(&found, 1, 3).expect("told");
        let truth = state(&world, 3).expect("a car").x;
        let told = found.extra(known.row).expect("a row of its own").state.x;
        assert!((told - truth).abs() < 0.05, "{told} {truth}");
        follow(&mut world, &[]);
    }
    while world.time_step() < 19 + 16 {
        follow(&mut world, &[]);
    }
    assert_eq!(ids(&world), [2, 4], "forgotten 1.5 s after the last report");
}

#[test]
fn what_has_left_is_not_known_any_more_once_the_place_is_seen() {
    // As before, but the truck leaves with the car: then agent 1 sees that nothing is there.
    let view = ViewLimits { occlusion: true, ..ViewLimits::default() };
    let observer = Agent { view, ..agent(1, at(10.0, 0.0, 5.0), vec![far()]) };
    let witness = Agent { view, ..agent(2, at(60.0, 3.5, 5.0), vec![far()]) };
    let until_20 = |x: f64| move |k: i32| (k < 20).then(|| at(x + 0.5 * f64::from(k), 0.0, 5.0));
    let car = Recorded::moving(3, (0..60).map(until_20(45.0)));
    let truck = Recorded::moving(4, (0..60).map(until_20(30.0)));
    let mut world =
        connected(vec![observer, witness], &[car, truck], V2xSettings { cpm: true, ..V2xSettings::default() });
    let knows = |world: &World| of(&expected(world).1, 1, 3).is_some();
    while world.time_step() < 19 {
        follow(&mut world, &[]);
    }
    assert!(knows(&world));
    follow(&mut world, &[]);
    assert!(!knows(&world), "at once, not 1.5 s later");
}

#[test]
fn what_was_not_sent_or_was_lost_is_not_known() {
    for (is_equipped, loss) in [(false, 0.0), (true, 1.0)] {
        let mut world = hidden_car(is_equipped, loss);
        for _ in 0..10 {
            follow(&mut world, &[]);
            let (alone, found) = expected(&world);
            assert!(found.known[&1].iter().all(|known| known.id != 3 && known.age == 0.0));
            assert_eq!(found.table.x, alone.x, "there is no additional row");
        }
    }
}

#[test]
fn a_plan_is_known_to_others_only_once_it_was_received() {
    let bits = |is_equipped: bool, acceleration: f64| {
        let one = agent(1, at(10.0, 0.0, 10.0), vec![far()]);
        let other = Agent { v2x: Some(is_equipped), ..agent(2, at(60.0, 0.0, 10.0), vec![far()]) };
        let mut world = connected(vec![one, other], &[], V2xSettings::default());
        // Both plans begin alike, so that nothing can be seen of the difference.
        let mut plan = drive(at(60.0, 0.0, 10.0), 0.0, 0.1);
        plan.extend(drive(at(61.0, 0.0, 10.0), acceleration, 2.9).into_iter().skip(1));
        follow(&mut world, &[(2, plan)]);
        let (_, found) = expected(&world);
        let row = of(&found, 1, 2).expect("in sight").row;
        let start = found.table.offset(row, 0);
        found.table.x[start..start + 30].iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(false, 0.0), bits(false, -3.0), "an agent that sends nothing tells nothing");
    assert_ne!(bits(true, 0.0), bits(true, -3.0));
}
