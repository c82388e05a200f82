//! Which plans are driven, and which participants enter and leave.

use super::*;
use crate::error::Error;

fn every(replan_every: usize) -> WorldSettings {
    WorldSettings { step: StepSettings { replan_every, ..StepSettings::default() }, ..WorldSettings::default() }
}

#[test]
fn all_move_at_once_agents_to_point_1_of_their_plans() {
    let recorded = Recorded::moving(7, (0..4).map(|k| Some(at(100.0 + f64::from(k), 3.5, 10.0))));
    let mut world =
        world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[recorded, Recorded::standing(9, 90.0, 0.0)]);
    assert_eq!((world.time_step(), state(&world, 7)), (0, Some(at(100.0, 3.5, 10.0))));
    move_to(&mut world, &[(1, at(20.9, 0.1, 9.5))]);
    assert_eq!(world.time_step(), 1);
    assert_eq!(state(&world, 1), Some(at(20.9, 0.1, 9.5)));
    assert_eq!(state(&world, 7), Some(at(101.0, 3.5, 10.0)));
    assert_eq!(state(&world, 9), Some(at(90.0, 0.0, 0.0)), "it stands for ever");
    let states = world.recording().states();
    assert_eq!(
        (states.n_steps, states.get(0, 0), states.get(0, 1)),
        (2, Some(at(20.0, 0.0, 10.0)), Some(at(20.9, 0.1, 9.5)))
    );
    assert_eq!(world.recording().plans().n_rows(), 1);
    let running = outcome(&world, 1);
    assert_eq!((running.kind, running.time_step), (OutcomeKind::Running, 1));
}

#[test]
fn plans_of_another_time_step_or_of_other_agents_are_refused_and_nothing_moves() {
    let mut world = world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[]);
    let mut late = towards(&world, &[]);
    late.time_step = 1;
    assert!(matches!(world.step(&late), Err(Error::WrongTimeStep { expected: 0, found: 1, .. })));
    let absent = Plans::none(0, vec![], 2);
    let other = Plans::none(0, vec![2], 2);
    for plans in [absent, other] {
        assert!(world.step(&plans).unwrap_err().to_string().contains("[1] are driving"));
    }
    assert_eq!((world.time_step(), world.recording().n_steps()), (0, 1));
}

#[test]
fn an_agent_without_a_usable_plan_ends_where_it_is() {
    let now = at(20.0, 0.0, 10.0);
    let nan = State { x: f64::NAN, ..now };
    let planned = |points: &[State]| {
        let mut plans = Plans::none(0, vec![1], 2);
        plans.set_row(1, points).expect("it drives");
        plans
    };
    let with = |status, message: &str| {
        let mut plans = planned(&[now, at(21.0, 0.0, 10.0)]);
        (plans.status[0], plans.message[0]) = (status, message.into());
        plans
    };
    for (plans, kind, message) in [
        (with(PlanStatus::Infeasible, "no room"), OutcomeKind::Infeasible, "no room"),
        (with(PlanStatus::Error, "it raised"), OutcomeKind::PlannerError, "it raised"),
        (with(PlanStatus::None, ""), OutcomeKind::PlannerError, "the planner returned no plan"),
        (planned(&[now, nan]), OutcomeKind::PlannerError, "the plan has values that are not numbers"),
        (planned(&[now]), OutcomeKind::PlannerError, "the plan has values that are not numbers"),
        (planned(&[at(21.0, 0.0, 10.0), now]), OutcomeKind::PlannerError, "the plan jumps"),
    ] {
        let mut world = world(vec![agent(1, now, vec![far()])], &[]);
        world.step(&plans).expect("a plan for each");
        let found = outcome(&world, 1);
        assert_eq!((found.kind, found.time_step), (kind, 0), "{message}");
        assert!(found.message.contains(message), "{} instead of {message}", found.message);
        assert!(state(&world, 1).is_none() && world.driving().is_empty() && world.is_done());
        assert_eq!(world.recording().states().get(0, 1), None, "{message}");
    }
    for status in [PlanStatus::Planned, PlanStatus::EmergencyBraking] {
        let mut world = world(vec![agent(1, now, vec![far()])], &[]);
        world.step(&with(status, "")).expect("a plan for each");
        assert_eq!((outcome(&world, 1).kind, world.driving()), (OutcomeKind::Running, vec![1]));
    }
}

#[test]
fn between_new_plans_the_last_one_is_followed_as_long_as_it_has_points() {
    let settings = every(3);
    let way = |n: usize| (0..n).map(|k| at(20.0 + k as f64, 0.0, 10.0)).collect::<Vec<_>>();
    // Plans given for agents whose last plan still counts are ignored.
    let elsewhere = [at(50.0, 0.0, 10.0), at(51.0, 0.0, 10.0)];
    for (n_points, expected) in [(2, 1), (3, 2), (4, 3), (9, 3)] {
        let mut world = world_with(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[], settings);
        let mut plans = towards(&world, &[]);
        plans.set_row(1, &way(n_points)).expect("it drives");
        world.step(&plans).expect("a good plan");
        while !world.is_done() && world.time_step() < 6 {
            let mut plans = towards(&world, &[]);
            plans.set_row(1, &elsewhere).expect("it drives");
            world.step(&plans).expect("ignored or garbage");
        }
        let end = outcome(&world, 1);
        assert_eq!((end.kind, end.time_step), (OutcomeKind::PlannerError, expected), "{n_points} points");
        let last = world.recording().states().get(0, expected).expect("it got there");
        assert_eq!(last.x, 20.0 + expected as f64);
    }
}

#[test]
fn the_next_plan_is_followed_from_its_own_time_on() {
    let settings = every(2);
    let mut world = world_with(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[], settings);
    let mut found = Vec::new();
    for _ in 0..4 {
        let mut plans = towards(&world, &[]);
        let now = state(&world, 1).expect("it drives");
        let pace = 0.5 + 0.1 * world.time_step() as f64;
        plans.set_row(1, &[0.0, 1.0, 2.0].map(|k| State { x: now.x + pace * k, ..now })).expect("it drives");
        world.step(&plans).expect("good plans");
        found.push(state(&world, 1).expect("it drives").x);
    }
    for (found, expected) in found.into_iter().zip([20.5, 21.0, 21.7, 22.4]) {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }
}

#[test]
fn an_agent_that_does_not_look_goes_on_with_its_plan_to_its_end() {
    // It looks away from 0.1 s to 0.4 s; a plan of three points is driven for two steps.
    let view = ViewLimits { inattentive_from: 0.1, inattentive_for: 0.3, ..ViewLimits::default() };
    for (points, expected) in [(6_i32, [20.5, 21.0, 21.5, 22.0, 22.9]), (3, [20.5, 21.0, 21.7, 22.4, 23.3])] {
        let mut world = world(vec![Agent { view, ..agent(1, at(20.0, 0.0, 10.0), vec![far()]) }], &[]);
        for (step, expected) in expected.into_iter().enumerate() {
            let now = state(&world, 1).expect("it drives");
            let pace = [0.5, 0.6, 0.7, 0.8, 0.9][step];
            let mut plans = Plans::none(world.time_step(), world.driving(), points as usize);
            let plan: Vec<State> = (0..points).map(|k| State { x: now.x + pace * f64::from(k), ..now }).collect();
            plans.set_row(1, &plan).expect("it drives");
            world.step(&plans).expect("good plans");
            let x = state(&world, 1).expect("it drives").x;
            assert!((x - expected).abs() < 1e-9, "{x}, not {expected}, {points} points, step {step}");
        }
    }
}

#[test]
fn agents_and_recorded_ones_come_and_go_at_their_times() {
    let late = Agent { start_time_step: 2, ..agent(3, at(20.0, 0.0, 10.0), vec![far()]) };
    let passing = Recorded::moving(7, [None, Some(at(60.0, 3.5, 0.0)), Some(at(60.0, 3.5, 0.0)), None]);
    let mut world = world(vec![agent(1, at(40.0, 0.0, 0.0), vec![far()]), late], &[passing]);
    for (time_step, driving, is_there) in
        [(0, vec![1], false), (1, vec![1], true), (2, vec![1, 3], true), (3, vec![1, 3], false)]
    {
        assert_eq!((world.time_step(), world.driving()), (time_step, driving));
        assert_eq!(state(&world, 7).is_some(), is_there, "{time_step}");
        assert_eq!(state(&world, 3).is_some(), time_step >= 2, "{time_step}");
        move_to(&mut world, &[]);
    }
    assert!(!world.is_done());
    assert_eq!(outcome(&world, 3).time_step, 4);
}

#[test]
fn an_agent_replays_its_recording_until_it_starts() {
    let recorded = |x: f64| Some(at(x, 0.0, 10.0));
    let own = Recorded::moving(3, [recorded(20.0), recorded(21.0), recorded(22.0), recorded(23.0)]);
    let replaying = Agent { start_time_step: 2, replays_before: true, ..agent(3, at(22.0, 0.0, 10.0), vec![far()]) };
    let mut world = world(vec![agent(1, at(60.0, 0.0, 0.0), vec![far()]), replaying], &[own]);
    for (time_step, x) in [(0, 20.0), (1, 21.0), (2, 22.0), (3, 22.0)] {
        assert_eq!(world.driving(), if time_step < 2 { vec![1] } else { vec![1, 3] });
        assert_eq!(state(&world, 3).map(|state| state.x), Some(x), "{time_step}");
        move_to(&mut world, &[]);
    }
}

#[test]
fn a_contact_with_an_agent_that_still_replays_ends_the_other_one_alone() {
    let own = Recorded::moving(3, [Some(at(20.0, 0.0, 0.0)); 4]);
    let replaying = Agent { start_time_step: 3, replays_before: true, ..agent(3, at(20.0, 0.0, 0.0), vec![far()]) };
    let mut world = world(vec![agent(1, at(14.0, 0.0, 10.0), vec![far()]), replaying], &[own]);
    move_to(&mut world, &[(1, at(18.0, 0.0, 10.0))]);
    assert_eq!(outcome(&world, 1).kind, OutcomeKind::Collision);
    assert_eq!(outcome(&world, 3).kind, OutcomeKind::Running);
}

#[test]
fn an_agent_waits_for_room_to_enter_and_gives_up_after_a_while() {
    let step = StepSettings { entry_wait: 0.25, ..StepSettings::default() };
    let settings = WorldSettings { step, ..WorldSettings::default() };
    for (leaves_at, enters_at) in [(2, Some(2)), (9, None)] {
        let late = Agent { start_time_step: 1, ..agent(3, at(20.0, 0.0, 10.0), vec![far()]) };
        let blocking = Recorded::moving(7, (0..10).map(|step| (step < leaves_at).then(|| at(28.0, 0.0, 0.0))));
        let far_away = agent(1, at(150.0, 0.0, 0.0), vec![far()]);
        let mut world = world_with(vec![far_away, late], &[blocking], settings);
        for time_step in 1..6 {
            move_to(&mut world, &[]);
            assert_eq!(state(&world, 3).is_some(), enters_at.is_some_and(|enters| time_step >= enters), "{time_step}");
        }
        let ended = outcome(&world, 3);
        assert_eq!(ended.kind == OutcomeKind::TimeLimit, enters_at.is_none());
        assert_eq!(ended.message.starts_with("found no room to enter"), enters_at.is_none());
    }
}

#[test]
fn of_two_agents_that_wait_for_the_same_place_one_enters_after_the_other() {
    let step = StepSettings { entry_wait: 2.0, ..StepSettings::default() };
    let settings = WorldSettings { step, ..WorldSettings::default() };
    let due_at = |id, start| Agent { start_time_step: start, ..agent(id, at(20.0, 0.0, 10.0), vec![far()]) };
    let beside = Recorded::moving(7, (0..12).map(|step| (step < 6).then(|| at(20.0, 2.0, 0.0))));
    let far_away = agent(1, at(150.0, 0.0, 0.0), vec![far()]);
    let mut world = world_with(vec![far_away, due_at(3, 2), due_at(4, 4)], &[beside], settings);
    for time_step in 1..20 {
        let first = state(&world, 3).map(|state| (3, State { x: state.x + 1.0, ..state }));
        move_to(&mut world, &first.into_iter().collect::<Vec<_>>());
        let second = state(&world, 4);
        assert_eq!(state(&world, 3).is_some(), time_step >= 6, "{time_step}");
        if let (Some(first), Some(second)) = (state(&world, 3), second) {
            assert!(time_step > 6 && first.x > second.x + 5.0, "{time_step}: {} m", first.x - second.x);
            return;
        }
    }
    panic!("the second one never enters");
}

#[test]
fn an_agent_waits_for_a_vehicle_that_crosses_in_a_moment_and_the_time_of_its_goal_waits_with_it() {
    let step = StepSettings { entry_wait: 2.0, ..StepSettings::default() };
    let settings = WorldSettings { step, ..WorldSettings::default() };
    let open = GoalState { areas: [].into(), ..stretch(0.0, 1.0, (60, 60)) };
    let late = Agent { start_time_step: 1, ..agent(3, at(20.0, 0.0, 10.0), vec![stretch(80.0, 90.0, (5, 60)), open]) };
    // At step 1 it is 8 m beside the way, and a quarter of a second later right before the agent.
    let crossing = Recorded::moving(
        7,
        (0..10).map(|i| {
            Some(State { orientation: -std::f64::consts::FRAC_PI_2, ..at(25.0, 11.0 - 3.0 * f64::from(i), 30.0) })
        }),
    );
    let mut world = world_with(vec![agent(1, at(150.0, 0.0, 0.0), vec![far()]), late], &[crossing], settings);
    for time_step in 1..8 {
        move_to(&mut world, &[]);
        if state(&world, 3).is_some() {
            let entered = world.agent(3).expect("an agent");
            let waited = entered.start_time_step - 1;
            let times: Vec<(i64, i64)> = entered.goal.states.iter().map(|goal| goal.time_step).collect();
            assert_eq!((time_step, waited, times), (3, 2, vec![(5 + waited, 60 + waited), (60, 60)]));
            return;
        }
    }
    panic!("it never enters");
}

#[test]
fn visibility_is_recorded_where_it_is_asked_for() {
    let others = || [Recorded::standing(7, 60.0, 3.5), Recorded::standing(8, 160.0, 3.5)];
    for record_views in [true, false] {
        let settings = WorldSettings { record_views, ..WorldSettings::default() };
        let later = Agent { start_time_step: 1, ..agent(2, at(150.0, 0.0, 0.0), vec![far()]) };
        let mut world = world_with(vec![agent(1, at(20.0, 0.0, 0.0), vec![far()]), later], &others(), settings);
        for _ in 0..3 {
            move_to(&mut world, &[]);
        }
        let seen: Vec<_> = world.recording().sightings().map(|s| (s.observer, s.seen, s.first, s.last)).collect();
        assert_eq!(seen, if record_views { vec![(1, 7, 0, 2), (2, 8, 1, 2)] } else { vec![] });
    }
}

#[test]
fn a_step_is_marked_before_and_after_contacts_are_looked_for() {
    let mut world = world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[]);
    let plans = towards(&world, &[]);
    let mut marks = 0;
    world.step_marked(&plans, || marks += 1).expect("a good plan");
    assert_eq!(marks, 2);
}
