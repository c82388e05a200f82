//! Contacts and the edge of the road.

use super::*;

/// What becomes of an agent that goes on from (20, 0) by 1 m at 10 m/s.
fn one_step(recorded: &[Recorded]) -> Outcome {
    let mut world = world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], recorded);
    move_to(&mut world, &[(1, at(21.0, 0.0, 10.0))]);
    outcome(&world, 1)
}

/// Where a square of 2 m stands that is this far ahead of the front of that agent.
fn ahead(gap: f64) -> f64 {
    20.0 + HALF + gap + 1.0
}

#[test]
fn a_contact_ends_the_agent_with_partner_time_and_relative_speed() {
    let found = one_step(&[Recorded::standing(7, ahead(0.25), 0.0)]);
    assert_eq!(
        (found.kind, found.time_step, found.partner, found.off_road),
        (OutcomeKind::Collision, 1, Some(7), false)
    );
    assert!((found.impact_speed - 10.0).abs() < 1e-9 && found.message.contains("at 0.025 s"), "{found:?}");
    assert_eq!(one_step(&[Recorded::standing(7, ahead(1.001), 0.0)]).kind, OutcomeKind::Running);
}

#[test]
fn the_impact_speed_is_that_of_both_at_the_moment_of_contact() {
    let turned = |x: f64, y: f64, velocity: f64, orientation: f64| State { orientation, ..at(x, y, velocity) };
    let half_turn = std::f64::consts::PI;
    for (first, second, own_next, expected) in [
        // Halfway through the step its speed is 9.5 m/s.
        (at(ahead(0.5), 0.0, 0.0), at(ahead(0.5), 0.0, 0.0), 9.0, 9.5),
        // Head-on: 10 + 5 m/s.
        (turned(ahead(0.75), 0.0, 5.0, half_turn), turned(ahead(0.25), 0.0, 5.0, half_turn), 10.0, 15.0),
        // At right angles: the root of 100 + 16.
        (
            turned(ahead(0.5), 0.4, 4.0, -0.5 * half_turn),
            turned(ahead(0.5), 0.0, 4.0, -0.5 * half_turn),
            10.0,
            116f64.sqrt(),
        ),
    ] {
        let mut world = world(
            vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])],
            &[Recorded::moving(7, [Some(first), Some(second)])],
        );
        move_to(&mut world, &[(1, at(21.0, 0.0, own_next))]);
        let found = outcome(&world, 1);
        assert!((found.impact_speed - expected).abs() < 1e-3, "{found:?}, not {expected} m/s");
        assert!(found.message.contains("at 0.050 s"), "{found:?}");
    }
}

#[test]
fn the_earliest_contact_of_a_step_is_the_one_that_counts() {
    for (near, remote) in [(3, 8), (8, 3)] {
        let mut both = [Recorded::standing(near, ahead(0.2), 0.5), Recorded::standing(remote, ahead(0.6), -1.4)];
        both.sort_by_key(|one| one.id);
        let found = one_step(&both);
        assert_eq!(found.partner, Some(near));
        assert!(found.message.contains("at 0.020 s"), "{}", found.message);
    }
}

#[test]
fn both_agents_of_a_contact_end_and_are_gone_from_the_next_step_on() {
    let agents = vec![agent(1, at(20.0, 0.0, 10.0), vec![far()]), agent(2, at(25.0, 0.0, 0.0), vec![far()])];
    let mut world = world(agents, &[]);
    move_to(&mut world, &[(1, at(21.0, 0.0, 10.0)), (2, at(25.0, 0.0, 0.0))]);
    for (id, partner) in [(1, 2), (2, 1)] {
        let found = outcome(&world, id);
        assert_eq!((found.kind, found.partner), (OutcomeKind::Collision, Some(partner)));
        assert!((found.impact_speed - 10.0).abs() < 1e-9);
        let row = usize::from(id == 2);
        assert!(world.recording().states().get(row, 1).is_some(), "the last state is recorded");
        assert!(state(&world, id).is_none());
    }
    move_to(&mut world, &[]);
    assert_eq!(world.recording().states().get(0, 2), None);
    assert_eq!(outcome(&world, 1).time_step, 1);
}

#[test]
fn an_agent_that_has_ended_is_in_no_ones_way() {
    let agents = vec![agent(1, at(20.0, 0.0, 10.0), vec![far()]), agent(2, at(25.0, 0.0, 10.0), vec![far()])];
    let mut world = world(agents, &[]);
    let mut plans = towards(&world, &[(1, at(21.0, 0.0, 10.0))]);
    plans.fail_row(2, "it raised".into()).expect("it drives");
    world.step(&plans).expect("a plan for each");
    assert_eq!(outcome(&world, 1).kind, OutcomeKind::Running);
}

#[test]
fn contacts_among_recorded_ones_do_not_count() {
    // Id 0 is not present yet, so that rows and moving participants are numbered differently.
    let found = one_step(&[
        Recorded::moving(0, [None, None]),
        Recorded::moving(5, [Some(at(100.0, 0.0, 0.0)), Some(at(101.0, 0.0, 10.0))]),
        Recorded::moving(6, [Some(at(103.5, 0.0, 0.0)), Some(at(102.5, 0.0, 10.0))]),
    ]);
    assert_eq!(found.kind, OutcomeKind::Running);
    let found = one_step(&[Recorded::moving(0, [None, None]), Recorded::standing(7, ahead(0.5), 0.0)]);
    assert_eq!(found.partner, Some(7));
}

#[test]
fn who_starts_in_contact_collides_once_they_have_separated() {
    let mut world = world(vec![agent(1, at(20.0, 0.0, 0.0), vec![far()])], &[Recorded::standing(7, ahead(-0.5), 0.0)]);
    assert_eq!(world.entered_in_contact(), [(1, 7)]);
    for (x, touching) in [(20.2, true), (19.0, true), (19.1, false)] {
        move_to(&mut world, &[(1, at(x, 0.0, 0.0))]);
        assert_eq!(outcome(&world, 1).kind, OutcomeKind::Running);
        assert_eq!(!world.entered_in_contact().is_empty(), touching, "{x}");
    }
    move_to(&mut world, &[(1, at(20.0, 0.0, 0.0))]);
    assert_eq!((outcome(&world, 1).kind, outcome(&world, 1).partner), (OutcomeKind::Collision, Some(7)));
}

#[test]
fn who_appears_on_top_of_an_agent_is_noted_and_does_not_end_it() {
    let (before, after) = (
        Recorded::moving(0, [None, Some(at(21.0, 0.5, 0.0)), Some(at(21.0, 0.5, 0.0))]),
        Recorded::moving(7, [None, Some(at(19.0, -0.5, 0.0))]),
    );
    let mut world = world(vec![agent(3, at(20.0, 0.0, 0.0), vec![far()])], &[before, after]);
    assert_eq!(world.entered_in_contact(), []);
    move_to(&mut world, &[]);
    assert_eq!(world.entered_in_contact(), [(0, 3), (3, 7)], "not the recorded ones among each other");
    move_to(&mut world, &[]);
    assert_eq!(outcome(&world, 3).kind, OutcomeKind::Running);
}

#[test]
fn an_agent_that_enters_later_on_top_of_another_is_noted() {
    let late = Agent { start_time_step: 1, ..agent(3, at(20.0, 0.0, 0.0), vec![far()]) };
    let mut world = world(vec![late], &[Recorded::standing(7, 21.0, 0.0), Recorded::standing(8, 60.0, 0.0)]);
    assert_eq!(world.entered_in_contact(), []);
    move_to(&mut world, &[]);
    assert_eq!(world.entered_in_contact(), [(3, 7)]);
}

#[test]
fn leaving_the_road_is_a_collision_with_its_edge() {
    // The side of the agent, 1 m away from its centre, passes the edge at y = -1.75 m and what the map may be wrong.
    for velocity in [4.0, -4.0] {
        let mut world = world(vec![agent(1, at(50.0, 0.0, velocity), vec![far()])], &[]);
        move_to(&mut world, &[(1, at(50.0, -0.7, velocity))]);
        assert_eq!(outcome(&world, 1).kind, OutcomeKind::Running);
        move_to(&mut world, &[(1, at(50.0, -1.7, velocity))]);
        let found = outcome(&world, 1);
        assert_eq!(
            (found.kind, found.time_step, found.partner, found.off_road),
            (OutcomeKind::Collision, 2, None, true)
        );
        assert_eq!(found.impact_speed, 4.0);
    }
}

#[test]
fn leaving_the_road_counts_once_the_agent_has_been_on_it() {
    let mut world = world(vec![agent(1, at(50.0, -3.0, 0.0), vec![far()])], &[]);
    for y in [-3.0, -2.0, -1.0, 0.0] {
        move_to(&mut world, &[(1, at(50.0, y, 0.0))]);
        assert_eq!(outcome(&world, 1).kind, OutcomeKind::Running, "{y}");
    }
    move_to(&mut world, &[(1, at(50.0, -2.0, 0.0))]);
    assert!(outcome(&world, 1).off_road);
}

#[test]
fn a_contact_counts_before_the_edge_of_the_road_in_the_same_step() {
    // The agent goes 2 m to the right and 1 m ahead; it leaves the road after 0.4 to 0.5 of the step.
    for gap in [0.2, 0.8] {
        let recorded = [Recorded::standing(7, ahead(gap), 0.0)];
        let mut world = world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &recorded);
        move_to(&mut world, &[(1, at(21.0, -2.0, 10.0))]);
        let found = outcome(&world, 1);
        assert_eq!((found.off_road, found.partner), (false, Some(7)), "{gap}");
    }
}
