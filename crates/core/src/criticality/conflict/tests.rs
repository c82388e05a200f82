use super::*;
use crate::criticality::tests::conflicts::{fork_before_a_crossing, straight_on, turning};
use crate::criticality::tests::{Actor, traffic};
use crate::criticality::traffic::tracks;

/// Ids of the connectors on the route of an actor that is recorded for `n` steps.
fn route(mut actor: Actor, n: usize) -> Vec<i64> {
    let (road, connectors) = fork_before_a_crossing();
    actor.states.truncate(n);
    let traffic = traffic(road, &[actor]);
    let conflicts = Conflicts::new(&traffic, &tracks(&traffic), &connectors, 0.1);
    conflicts.of_row[0].iter().map(|lanelet| traffic.road.lanelets()[*lanelet].id).collect()
}

#[test]
fn of_two_connectors_behind_one_lane_the_one_driven_longer_or_nearer_counts() {
    // Both leave lane 1 at x = -10, after 40 steps of 1 m. For 6 m the car is on both connectors, then on one only.
    for (n, driven) in [(44, "nearer"), (49, "longer"), (55, "longer"), (95, "to its end")] {
        assert_eq!(route(straight_on(1), n), [2], "{n}: {driven}");
        assert_eq!(route(turning(1, 40.0), n), [4], "{n}: {driven}");
    }
}

#[test]
fn a_connector_that_is_not_reached_or_neither_entered_nor_left_is_not_on_the_route() {
    assert!(route(straight_on(1), 30).is_empty());
    // From x = -5 to 15 it is on the connector only.
    let mut inside = straight_on(1);
    inside.states.drain(..45);
    assert!(route(inside, 20).is_empty());
    let mut parked = straight_on(1);
    parked.is_static = true;
    assert!(route(parked, 95).is_empty());
}
