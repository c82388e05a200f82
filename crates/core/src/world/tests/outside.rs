//! Participants that are driven from outside.

use super::*;

/// Somebody new, a square of 2 m.
fn new(id: i64) -> (i64, ParticipantKind, Shape) {
    (id, ParticipantKind::Car, Shape::rectangle(2.0, 2.0))
}

fn driven(ids: &[i64], states: &[(i64, State)]) -> Outside {
    Outside { new: ids.iter().copied().map(new).collect(), states: states.to_vec(), jumped: Vec::new() }
}

fn alone() -> World {
    world(vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])], &[Recorded::standing(5, 150.0, 0.0)])
}

/// The agent goes on by 1 m among those from outside.
fn go_on(world: &mut World, outside: &Outside) -> Result<()> {
    let now = state(world, 1).expect("it drives");
    let plans = towards(world, &[(1, at(now.x + 1.0, 0.0, 10.0))]);
    world.step_among(&plans, outside, || ())
}

#[test]
fn a_newcomer_is_absent_before_it_comes_and_after_it_has_left() {
    let mut world = alone();
    go_on(&mut world, &Outside::default()).expect("nobody from outside");
    let before = world.recording().states();
    go_on(&mut world, &driven(&[9], &[(9, at(80.0, 3.5, 5.0))])).expect("somebody new");
    go_on(&mut world, &driven(&[], &[(9, at(80.5, 3.5, 5.0))])).expect("it moves");
    go_on(&mut world, &Outside::default()).expect("it has left");
    let states = world.recording().states();
    assert_eq!(states.ids, [1, 5, 9]);
    let there: Vec<bool> = (0..5).map(|step| states.get(2, step).is_some()).collect();
    assert_eq!(there, [false, false, true, true, false]);
    assert_eq!(states.get(2, 3).map(|state| state.x), Some(80.5));
    // What was recorded before is as it was.
    for row in 0..2 {
        assert_eq!((before.get(row, 0), before.get(row, 1)), (states.get(row, 0), states.get(row, 1)));
    }
}

#[test]
fn what_was_before_newcomers_is_as_without_them() {
    let drive = |comes: Option<i64>| {
        let settings = WorldSettings { record_views: true, ..WorldSettings::default() };
        let agents = vec![agent(1, at(20.0, 0.0, 10.0), vec![far()])];
        let passes = Recorded::moving(5, (0..20).map(|i| Some(at(60.0 + 0.5 * f64::from(i), 3.5, 5.0))));
        let mut world = world_with(agents, &[passes], settings);
        let mut scenes = Vec::new();
        for step in 0..8 {
            scenes.push(world.scene());
            let outside = match comes {
                Some(first) if step + 1 == first => {
                    driven(&[8, 9], &[(8, at(40.0, 3.5, 5.0)), (9, at(80.0, 3.5, 5.0))])
                }
                Some(first) if step + 1 > first => driven(&[], &[(9, at(80.0, 3.5, 5.0))]),
                _ => Outside::default(),
            };
            go_on(&mut world, &outside).expect("a step");
        }
        (world, scenes)
    };
    let first = 5;
    let ((with, scenes), (without, expected)) = (drive(Some(first)), drive(None));
    // Scenes that were held while others came, and whom agents see in them, as texts, since absent states are no numbers.
    let seen = |scene: &Scene| {
        let (visible, ids) = (scene.visible_from(0, &ViewLimits::default()), &scene.participants.ids);
        format!("{ids:?} {:?} {visible:?} {:?}", scene.present, scene.past)
    };
    for (scene, expected) in scenes[..first as usize].iter().zip(&expected) {
        assert_eq!(seen(scene), seen(expected));
    }
    assert_eq!(scenes[first as usize].participants.ids, [1, 5, 8, 9]);
    assert_ne!(seen(&scenes[first as usize]), seen(&expected[first as usize]));
    let (states, alone) = (with.recording().states(), without.recording().states());
    for (row, step) in (0..2).flat_map(|row| (0..9).map(move |step| (row, step))) {
        assert_eq!(states.get(row, step), alone.get(row, step), "row {row} at {step}");
    }
    let plans = |world: &World| format!("{:?}", world.recording().plans());
    assert_eq!(plans(&with), plans(&without));
    // The agent has seen those who were there for as long as without newcomers, and newcomers from then on.
    let sightings = |world: &World| world.recording().sightings().map(|one| (one.seen, one.first, one.last)).collect();
    let (found, before): (Vec<_>, Vec<_>) = (sightings(&with), sightings(&without));
    assert_eq!(before, [(5, 0, 7)]);
    assert_eq!(found, [(5, 0, 7), (8, first, first), (9, first, 7)]);
}

#[test]
fn without_anybody_from_outside_a_step_is_as_it_always_was() {
    let [mut among, mut plain] = [alone(), alone()];
    for _ in 0..5 {
        go_on(&mut among, &Outside::default()).expect("a step");
        let now = state(&plain, 1).expect("it drives");
        move_to(&mut plain, &[(1, at(now.x + 1.0, 0.0, 10.0))]);
    }
    let said = |world: &World| format!("{:?} {:?}", world.recording().states(), world.recording().plans());
    assert_eq!(said(&among), said(&plain));
    assert_eq!(among.participants().ids, [1, 5]);
}

#[test]
fn who_is_there_from_the_beginning_is_placed_before_the_first_step() {
    let mut world = alone();
    world.place_outside(&driven(&[9], &[(9, at(80.0, 3.5, 5.0))])).expect("before the first step");
    assert_eq!(world.scene().present, [0, 1, 2]);
    assert_eq!(world.recording().states().get(2, 0).map(|state| state.x), Some(80.0));
    go_on(&mut world, &Outside::default()).expect("it has left");
    assert_eq!(world.scene().present, [0, 1]);
    assert!(world.place_outside(&Outside::default()).is_err(), "after the first step");
}

#[test]
fn a_contact_with_somebody_from_outside_counts() {
    let mut world = alone();
    // Its rear is 0.25 m ahead of the agent's front, and stays there.
    let stands = at(20.0 + HALF + 1.25, 0.0, 0.0);
    world.place_outside(&driven(&[9], &[(9, stands)])).expect("before the first step");
    go_on(&mut world, &driven(&[], &[(9, stands)])).expect("a step");
    let found = outcome(&world, 1);
    assert_eq!((found.kind, found.partner), (OutcomeKind::Collision, Some(9)));
}

#[test]
fn who_jumps_hits_nobody_on_the_way() {
    for (jumped, expected) in [(vec![], OutcomeKind::Collision), (vec![9], OutcomeKind::Running)] {
        let mut world = alone();
        world.place_outside(&driven(&[9], &[(9, at(21.0, -8.0, 0.0))])).expect("before the first step");
        // Across the agent's lane in one step.
        let over = Outside { jumped, ..driven(&[], &[(9, at(21.0, 8.0, 0.0))]) };
        go_on(&mut world, &over).expect("a step");
        assert_eq!(outcome(&world, 1).kind, expected);
    }
}

#[test]
fn the_next_states_of_agents_are_those_of_the_step() {
    let mut world = alone();
    let plans = towards(&world, &[(1, at(21.0, 0.0, 10.0))]);
    let next = world.next_of(&plans).expect("plans of now");
    world.step(&plans).expect("plans of now");
    assert_eq!(next, [(1, state(&world, 1).expect("it drives"))]);
    // An agent without a plan ends.
    let none = Plans::none(world.time_step(), world.driving(), 2);
    assert_eq!(world.next_of(&none).expect("plans of now"), []);
}

#[test]
fn what_cannot_be_is_refused_and_changes_nothing() {
    let mut world = alone();
    let nan = at(f64::NAN, 0.0, 0.0);
    for (outside, word) in [
        (driven(&[5], &[]), "above 5"),
        (driven(&[9, 9], &[]), "above 9"),
        (driven(&[], &[(9, at(0.0, 0.0, 0.0))]), "9"),
        (driven(&[], &[(5, at(0.0, 0.0, 0.0))]), "5"),
        (driven(&[9], &[(9, nan)]), "not a number"),
    ] {
        let error = go_on(&mut world, &outside).expect_err("impossible");
        assert!(error.to_string().contains(word), "{error}");
    }
    assert_eq!((world.time_step(), world.participants().ids.len()), (0, 2));
}
