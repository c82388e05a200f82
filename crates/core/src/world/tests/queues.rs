//! Agents that wait in queues before the map.

use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::geometry::Point;
use crate::road::RoadNetwork;
use crate::road::testing::{arc, lane, merge};
use crate::world::Queue;

fn queued(id: i64, velocity: f64, lane: i64, until: i64) -> Agent {
    let y = 3.5 * lane as f64;
    let mut goal = GoalState { velocity: Some((0.0, 40.0)), ..stretch(180.0, 190.0, (5, 100)) };
    goal.areas = [PlacedShape { shape: Shape::rectangle(10.0, 3.5), pose: Pose::new(185.0, y, 0.0) }].into();
    Agent { queue: Some(Queue { lane, until }), ..agent(id, State { y, ..at(5.0, 0.0, velocity) }, vec![goal]) }
}

fn placed(position: Point, orientation: f64, velocity: f64) -> State {
    State { x: position.x, y: position.y, orientation, velocity, ..State::default() }
}

/// An agent that drives along a road to a place on it, from a queue or as it is.
fn driver(road: &RoadNetwork, id: i64, state: State, to: (f64, f64), queue: Option<i64>) -> Agent {
    let area = PlacedShape { shape: Shape::rectangle(4.0, 4.0), pose: Pose::new(to.0, to.1, 0.0) };
    let route = find_route(road, state.pose(), 10.0, &[area], &RouteSettings::default()).expect("a way");
    let queue = queue.map(|lane| Queue { lane, until: 50 });
    Agent { initial_state: state, route: Arc::new(route), queue, ..agent(id, at(0.0, 0.0, 0.0), vec![far()]) }
}

/// Who is there at the first time step.
fn present(road: RoadNetwork, agents: Vec<Agent>) -> Vec<i64> {
    let obstacles = Obstacles {
        kind: Vec::new(),
        shape: Vec::new(),
        is_static: Vec::new(),
        states: States::absent(Vec::new(), 0, 1),
    };
    let scenario = Scenario::new(0.1, Arc::new(road), obstacles).expect("a test's scenario");
    World::new(Arc::new(scenario), agents, WorldSettings::default()).expect("a test's world").driving()
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

#[test]
fn who_has_its_rear_in_the_way_of_an_entrant_is_ahead_of_it_whatever_its_lane() {
    // Beside the way by 2.6 m, with 2 m wide: its rear, turned towards the way, comes within 0.2 m of the entrant's side.
    let entry_speed = |turn: f64| {
        let slow = agent(9, State { y: 2.6, orientation: turn, ..at(16.0, 0.0, 2.0) }, vec![far()]);
        state(&world(vec![queued(1, 14.0, 0, 50), slow], &[]), 1).expect("it enters").velocity
    };
    assert_eq!(entry_speed(0.0), 14.0);
    // 6.5 m = 2 m + v 1 s + (v² - 2²) / 8
    assert!((entry_speed(0.2) - 3.48).abs() < 0.02);
}

#[test]
fn of_two_queues_whose_lanes_merge_at_once_one_enters() {
    // Lane 1 ends at (50, 0), and the quarter circle of lane 2 there, too: 25 m and 26 m from the heads of both queues.
    let on_circle = |angle: f64| Point::new(50.0 - 20.0 * angle.cos(), -20.0 + 20.0 * angle.sin());
    let entrants = |x: f64, angle: f64| {
        let straight = placed(Point::new(x, 0.0), 0.0, 10.0);
        let bend = placed(on_circle(angle), FRAC_PI_2 - angle, 10.0);
        let ways = [(1, straight), (2, bend)];
        ways.map(|(id, state)| driver(&merge(), id, state, (95.0, 0.0), Some(id))).to_vec()
    };
    assert_eq!(present(merge(), entrants(25.0, 0.27)), [1]);
    // The second one comes 22 m behind: 4.5 m, 2 m, and a second.
    assert_eq!(present(merge(), entrants(47.0, 0.27)), [1, 2]);
}

#[test]
fn who_joins_the_way_behind_the_entry_keeps_an_entrant_waiting_or_lets_it_go_before() {
    let on_circle = |angle: f64| Point::new(50.0 - 20.0 * angle.cos(), -20.0 + 20.0 * angle.sin());
    let with = |angle: f64, velocity: f64| {
        let entrant = driver(&merge(), 1, placed(Point::new(20.0, 0.0), 0.0, 12.0), (95.0, 0.0), Some(1));
        let other = placed(on_circle(angle), FRAC_PI_2 - angle, velocity);
        present(merge(), vec![entrant, driver(&merge(), 2, other, (95.0, 0.0), None)])
    };
    assert_eq!(with(0.5, 8.0), [2]);
    // In 3 s that one is not there yet.
    assert_eq!(with(0.0, 2.0), [1, 2]);
}

#[test]
fn nobody_enters_right_before_a_fast_vehicle_on_a_bend() {
    let radius = 60.0;
    let bend = || open(vec![lane(1, &arc((0.0, 0.0), radius, 0.0, 2.0 * FRAC_PI_2))]);
    let on = |angle: f64, velocity: f64| placed(Point::from_angle(angle) * radius, angle + FRAC_PI_2, velocity);
    let with = |behind: f64| {
        let entrant = driver(&bend(), 1, on(1.5, 8.0), (-radius, 1.0), Some(1));
        let other = driver(&bend(), 2, on(1.5 - behind / radius, 18.0), (-radius, 1.0), None);
        present(bend(), vec![entrant, other])
    };
    // Headed elsewhere by 0.8 rad; 4.5 m, 2 m, and 40.5 m to brake to a stop with 4 m/s².
    assert_eq!(with(46.5), [2]);
    assert_eq!(with(70.0), [1, 2]);
}

#[test]
fn an_entrant_waits_for_who_crosses_its_way_at_the_same_time() {
    let crossing = crate::road::testing::crossing;
    let with = |y: f64| {
        let entrant = driver(&crossing(), 1, placed(Point::new(-20.0, 0.0), 0.0, 10.0), (45.0, 0.0), Some(1));
        let other = driver(&crossing(), 2, placed(Point::new(0.0, y), FRAC_PI_2, 10.0), (0.0, 45.0), None);
        present(crossing(), vec![entrant, other])
    };
    assert_eq!(with(-20.0), [2]);
    assert_eq!(with(-30.0), [1, 2]);
    assert_eq!(with(-5.0), [1, 2]);
}
