//! Agents that wait in queues before the map.

use super::*;
use crate::world::Queue;

fn queued(id: i64, velocity: f64, lane: i64, until: i64) -> Agent {
    let y = 3.5 * lane as f64;
    let goal = GoalState { velocity: Some((0.0, 40.0)), ..stretch(180.0, 190.0, (5, 100)) };
    Agent { queue: Some(Queue { lane, until }), ..agent(id, State { y, ..at(5.0, 0.0, velocity) }, vec![goal]) }
}

/// Keeps everybody's speed.
fn drive(world: &mut World) {
    let next: Vec<(i64, State)> = world
        .driving()
        .into_iter()
        .map(|id| (id, state(world, id).expect("it drives")))
        .map(|(id, now)| (id, State { x: now.x + 0.1 * now.velocity, ..now }))
        .collect();
    move_to(world, &next);
}

#[test]
fn an_agent_enters_a_free_lane_at_once_at_the_speed_that_it_wants() {
    let world = world(vec![queued(1, 14.0, 0, 50)], &[]);
    assert_eq!(state(&world, 1).map(|state| state.velocity), Some(14.0));
}

#[test]
fn the_second_of_a_queue_waits_for_the_gap_and_the_time_of_its_goal_with_it() {
    let mut world = world(vec![queued(1, 10.0, 0, 50), queued(2, 10.0, 0, 50), queued(3, 10.0, 1, 50)], &[]);
    assert_eq!(world.driving(), [1, 3]);
    let mut entered = 0;
    while state(&world, 2).is_none() {
        drive(&mut world);
        entered = world.time_step();
    }
    // 4.5 m, the gap of 2 m, and 9 m for a second at nine tenths of the speed of the first one.
    assert_eq!(entered, 16);
    let second = world.agent(2).expect("an agent");
    assert_eq!((second.start_time_step, second.goal.states[0].time_step), (16, (21, 116)));
    let speed = state(&world, 2).expect("it is there").velocity;
    assert!((speed - 9.5).abs() < 1e-9, "{speed}");
}

#[test]
fn who_finds_no_gap_in_time_does_not_enter() {
    let mut world = world(vec![queued(1, 10.0, 0, 3)], &[Recorded::standing(9, 9.5, 0.0)]);
    while !world.is_done() {
        drive(&mut world);
    }
    let ended = outcome(&world, 1);
    assert_eq!((ended.kind, ended.time_step), (OutcomeKind::TimeLimit, 3));
    assert_eq!(ended.message, "found no room to enter within 0.3 s");
}

#[test]
fn nobody_enters_right_before_a_fast_vehicle() {
    let fast = |x: f64| Recorded::moving(9, (0..80).map(|i| Some(at(x + 2.0 * f64::from(i), 0.0, 20.0))));
    let free = world(vec![queued(1, 10.0, 0, 3)], &[fast(-70.0)]);
    assert!(state(&free, 1).is_some());
    let busy = world(vec![queued(1, 10.0, 0, 3)], &[fast(-30.0)]);
    assert!(state(&busy, 1).is_none());
}
