//! Goals: in time, late, missed, never.

use super::*;

/// One agent that goes on along x by 1 m per step, until it ends or for 100 steps.
fn drive(start: State, goals: Vec<GoalState>, start_time_step: i64) -> Outcome {
    let mut world = world(vec![Agent { start_time_step, ..agent(1, start, goals) }], &[]);
    while !world.is_done() && world.time_step() < 100 {
        let next = state(&world, 1).map(|now| (1, State { x: now.x + 1.0, ..now }));
        move_to(&mut world, next.as_slice());
    }
    outcome(&world, 1)
}

#[test]
fn the_goal_is_reached_when_all_that_it_states_holds_at_once() {
    let with = |velocity, orientation| GoalState { velocity, orientation, ..stretch(30.0, 40.0, (0, 1000)) };
    let start = at(20.5, 0.0, 10.0);
    for (goal, expected, time_step) in [
        (with(None, None), OutcomeKind::GoalReached, 10),
        (with(Some((10.0, 12.0)), Some((-0.1, 0.1))), OutcomeKind::GoalReached, 10),
        // Both ends of an interval belong to it.
        (with(Some((8.0, 10.0)), Some((0.0, 1.0))), OutcomeKind::GoalReached, 10),
        (with(Some((11.0, 12.0)), None), OutcomeKind::GoalMissed, 21),
        (with(Some((8.0, 9.0)), None), OutcomeKind::GoalMissed, 21),
        (with(None, Some((0.1, 0.3))), OutcomeKind::GoalMissed, 21),
        (stretch(30.0, 40.0, (10, 10)), OutcomeKind::GoalReached, 10),
        (stretch(30.0, 40.0, (13, 50)), OutcomeKind::GoalReached, 13),
        (stretch(30.0, 40.0, (25, 50)), OutcomeKind::GoalMissed, 21),
    ] {
        let outcome = drive(start, vec![goal.clone()], 0);
        assert_eq!((outcome.kind, outcome.time_step), (expected, time_step), "{goal:?}");
        assert!(outcome.impact_speed.is_nan() && outcome.partner.is_none() && !outcome.off_road);
    }
}

#[test]
fn any_alternative_of_the_goal_will_do() {
    let slow = GoalState { velocity: Some((0.0, 1.0)), ..stretch(30.0, 40.0, (0, 1000)) };
    let second = stretch(50.0, 60.0, (0, 1000));
    // The route leads to the first alternative only, 10.5 m behind it the goal would be missed.
    let outcome = drive(at(20.5, 0.0, 10.0), vec![slow.clone(), stretch(40.0, 60.0, (0, 1000))], 0);
    assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::GoalReached, 20));
    let outcome = drive(at(20.5, 0.0, 10.0), vec![slow, second], 0);
    assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::GoalMissed, 21));
}

#[test]
fn the_goal_is_missed_one_metre_beyond_its_area_unless_another_area_begins_there() {
    let too_fast = |from, to| GoalState { velocity: Some((0.0, 1.0)), ..stretch(from, to, (0, 1000)) };
    // The centre passes 40 + 1 m between steps 20 (40.5 m) and 21 (41.5 m).
    let outcome = drive(at(20.5, 0.0, 10.0), vec![too_fast(30.0, 40.0)], 0);
    assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::GoalMissed, 21));
    // In an area that is not on its route it cannot miss the goal; it leaves that one between steps 34 and 35.
    let outcome = drive(at(20.5, 0.0, 10.0), vec![too_fast(30.0, 40.0), too_fast(40.0, 55.0)], 0);
    assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::GoalMissed, 35));
}

#[test]
fn a_goal_that_is_reached_after_its_time_is_reached_late() {
    // In the area from step 10 on. Its time ends at 6, 7, 9 and 10; 1.7 times that is 10, 11, 15, 17.
    for (latest, expected, time_step) in [
        (5, OutcomeKind::TimeLimit, 8),
        (6, OutcomeKind::GoalReachedLate, 10),
        (9, OutcomeKind::GoalReachedLate, 10),
        (10, OutcomeKind::GoalReached, 10),
    ] {
        let outcome = drive(at(20.5, 0.0, 10.0), vec![stretch(30.0, 40.0, (0, latest))], 0);
        assert_eq!((outcome.kind, outcome.time_step), (expected, time_step), "{latest}");
    }
}

#[test]
fn no_alternative_is_late_before_the_time_of_all_is_over() {
    // Inside the first one from step 10 on, too late for it; the other one can be reached until step 12.
    let goals = vec![stretch(30.0, 40.0, (0, 8)), stretch(150.0, 160.0, (0, 12))];
    let outcome = drive(at(20.5, 0.0, 10.0), goals, 0);
    assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::GoalReachedLate, 13));
}

#[test]
fn the_time_limit_is_the_time_of_the_goal_times_the_grace_factor_counted_from_the_start() {
    // 1.7 * 10 = 17 steps after the start.
    for start_time_step in [0, 4] {
        let goal = stretch(150.0, 160.0, (0, start_time_step + 10));
        let outcome = drive(at(20.5, 0.0, 10.0), vec![goal], start_time_step);
        assert_eq!((outcome.kind, outcome.time_step), (OutcomeKind::TimeLimit, start_time_step + 17));
    }
}

#[test]
fn who_collides_in_the_step_that_reaches_the_goal_has_collided() {
    let mut world = world(
        vec![agent(1, at(29.5, 0.0, 10.0), vec![stretch(30.0, 40.0, (0, 100))])],
        &[Recorded::standing(5, 29.5 + HALF + 1.0 + 0.5, 0.0)],
    );
    move_to(&mut world, &[(1, at(30.5, 0.0, 10.0))]);
    assert_eq!(outcome(&world, 1).kind, OutcomeKind::Collision);
}

#[test]
fn progress_is_the_way_along_the_reference_path() {
    let mut world = world(vec![agent(1, at(60.0, 0.0, 10.0), vec![far()])], &[]);
    let start = world.progress(1).expect("an agent").s;
    for (x, way) in [(61.0, 0.0), (62.0, 1.0), (63.5, 2.5)] {
        move_to(&mut world, &[(1, at(x, 0.2, 10.0))]);
        let expected = start + 1.0 + way;
        let found = world.progress(1).expect("an agent").s;
        assert!((found - expected).abs() < 0.01, "{found}, not {expected}");
    }
}

#[test]
fn agents_end_once_nothing_has_moved_for_the_time_of_a_standstill() {
    let settings = WorldSettings {
        step: StepSettings { standstill_s: 1.0, ..StepSettings::default() },
        ..WorldSettings::default()
    };
    let wall = [Recorded::standing(5, 60.0, 0.0)];
    let mut world = world_with(vec![agent(1, at(20.0, 0.0, 0.0), vec![far()])], &wall, settings);
    while !world.is_done() {
        // It moves on at step 5: the time begins anew there.
        let next = State { x: if world.time_step() < 4 { 20.0 } else { 20.5 }, ..at(0.0, 0.0, 0.0) };
        let plans = towards(&world, &[(1, next)]);
        world.step(&plans).expect("plans of all driving agents");
        assert!(world.time_step() < 100);
    }
    let found = outcome(&world, 1);
    assert_eq!((found.kind, found.time_step), (OutcomeKind::TimeLimit, 15));
    assert_eq!(
        found.message,
        "nothing moved any more: it had stood at (20.5, 0.0) for 1.0 s; its time would have been up at 170.0 s"
    );
}

#[test]
fn the_largest_number_of_steps_ends_all_that_drive_or_are_still_to_come() {
    let settings =
        WorldSettings { step: StepSettings { max_steps: 3, ..StepSettings::default() }, ..WorldSettings::default() };
    let late = Agent { start_time_step: 8, ..agent(2, at(80.0, 0.0, 10.0), vec![far()]) };
    let mut world = world_with(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()]), late], &[], settings);
    for time_step in 1..=3 {
        move_to(&mut world, &[]);
        for found in world.outcomes() {
            let expected = if time_step < 3 { OutcomeKind::Running } else { OutcomeKind::TimeLimit };
            assert_eq!(found.kind, expected, "{time_step}");
            assert_eq!(found.message.contains("after 3 time steps"), time_step == 3);
        }
    }
    assert!(world.is_done() && world.last_time_step() == Some(3));
}

#[test]
fn without_agents_a_world_is_over_after_its_time_and_with_agents_once_they_have_ended() {
    let settings = WorldSettings { steps_without_agents: 3, ..WorldSettings::default() };
    let mut alone = world_with(Vec::new(), &[Recorded::standing(5, 60.0, 0.0)], settings);
    assert_eq!(alone.last_time_step(), Some(3));
    while !alone.is_done() {
        move_to(&mut alone, &[]);
        assert!(alone.time_step() <= 3);
    }
    assert_eq!((alone.time_step(), alone.recording().states().n_steps), (3, 4));
    let mut driving = world_with(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[], settings);
    (0..4).for_each(|_| move_to(&mut driving, &[]));
    assert!(!driving.is_done());
    assert!(world(Vec::new(), &[]).is_done());
}
