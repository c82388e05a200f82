//! How near participants come to one another, in time and in space.

use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::criticality::approach::{Approach, approach};
use crate::road::testing::straight_road;

fn approached(actors: &[Actor], steps_most: usize) -> Approach {
    approach(&traffic(straight_road(1), actors), 0, &vec![(5.0, 2.0); actors.len()], steps_most)
}

#[test]
fn who_crosses_behind_uses_the_same_ground_some_steps_later() {
    // The first car is at the crossing at 2.0 s, the second one at 2.5 s; both move 1 m per step.
    let cars =
        [Actor::going(1, state(-20.0, 0.0, 0.0, 10.0), 40), Actor::going(2, state(0.0, -25.0, FRAC_PI_2, 10.0), 40)];
    let found = approached(&cars, 30);
    // Within 2 m of each other's way, one meets the place of the other from 2 m before it on.
    assert_eq!(found.steps_between, Some(3));
    // On their diagonal both are nearest halfway between 2.0 s and 2.5 s.
    assert!((found.distance - (2.5_f64.powi(2) * 2.0).sqrt() + 5.0).abs() < 0.1, "{found:?}");
    assert_eq!(approached(&cars, 2).steps_between, None, "three steps are more than two");
}

#[test]
fn who_follows_is_at_the_same_place_after_its_time_gap() {
    let cars = [Actor::going(1, state(0.0, 0.0, 0.0, 10.0), 40), Actor::going(2, state(12.0, 0.0, 0.0, 10.0), 40)];
    let found = approached(&cars, 30);
    assert_eq!(found.steps_between, Some(10), "12 m apart, 2 m of which are within the width");
    assert!((found.distance - 7.0).abs() < 1e-9);
}

#[test]
fn of_several_the_nearest_one_counts_and_who_is_not_there_does_not() {
    let mut gone = Actor::going(3, state(0.0, 1.0, 0.0, 10.0), 5);
    gone.states.iter_mut().for_each(|at| *at = None);
    let beside = Actor::going(4, state(0.0, 1.5, 0.0, 10.0), 5);
    let cars = [Actor::going(1, state(0.0, 0.0, 0.0, 10.0), 5), Actor::going(2, state(60.0, 0.0, 0.0, 10.0), 5), gone];
    let found = approached(&cars, 30);
    assert_eq!((found.distance, found.steps_between), (55.0, None));
    let found = approached(&[cars[0].clone(), cars[1].clone(), beside], 30);
    assert_eq!((found.distance, found.steps_between), (-3.5, Some(0)));
}
