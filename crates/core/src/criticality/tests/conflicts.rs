//! Encroachment, post-encroachment, and stopping before conflict areas.

use super::*;

fn crossing_scene(y: f64, n: usize, crash: Option<usize>) -> Criticality {
    let (road, connectors) = right_angles();
    let mut actors = crossing_cars(y, n);
    if let Some(last) = crash {
        for actor in &mut actors {
            actor.states.iter_mut().skip(last + 1).for_each(|state| *state = None);
        }
    }
    let mut wanted = request(&[1, 2]);
    wanted.conflict_areas = ConflictAreas::Stated(connectors);
    evaluate(&traffic(road, &actors), &wanted).expect("valid")
}

#[test]
fn encroachment_lasts_from_the_first_to_the_last_overlap() {
    let found = crossing_scene(-64.55, 90, None);
    for (row, enter) in [(0, 31), (1, 61)] {
        let et = &found.extremes[Measure::Et as usize][row];
        near(et.value, 0.9, 1e-9);
        assert_eq!(et.time_step, enter);
        assert_eq!(
            found.ways[et.way as usize],
            LaneletPath { lanelets: [[2, 12], [12, 2]][row].to_vec(), is_conflict_area: true }
        );
    }
    for (column, expected) in [(0, 0.9), (31, 0.9), (35, 0.5), (39, 0.1), (40, INF)] {
        near(at(&found, Measure::Et, column), expected, 1e-9);
    }
    assert!(!found.exposure[0].et_left_censored);
}

#[test]
fn the_second_one_follows_after_the_post_encroachment_time() {
    let found = crossing_scene(-64.55, 90, None);
    for row in 0..2 {
        let pet = &found.extremes[Measure::Pet as usize][row];
        near(pet.value, 2.1, 1e-9);
        assert_eq!((pet.partner, found.exposure[row].pet_first), ([2, 1][row], 1));
        assert_eq!(pet.time_step, 40, "when the first one has left");
    }
    for (column, expected) in [(0, 2.1), (40, 2.1), (41, INF)] {
        near(at(&found, Measure::Pet, column), expected, 1e-9);
    }
}

#[test]
fn who_is_there_at_the_same_time_has_no_post_encroachment_time() {
    let found = crossing_scene(-34.55, 90, None);
    assert_eq!(extreme(&found, Measure::Pet), 0.0);
    let crashed = crossing_scene(-34.55, 90, Some(32));
    assert_eq!(extreme(&crashed, Measure::Pet), 0.0);
    assert!(extreme(&crashed, Measure::Et).is_nan(), "entered, never left");
    assert!(at(&crashed, Measure::Et, 0).is_nan() && at(&crashed, Measure::Et, 32).is_nan());
    assert_eq!(at(&crashed, Measure::Psd, 32), 0.0, "inside to the end");
    // Out again at the last step, 40.
    let just_out = crossing_scene(-34.55, 41, None);
    near(at(&just_out, Measure::Et, 39), 0.1, 1e-9);
    assert_eq!(at(&just_out, Measure::Psd, 39), 0.0);
}

#[test]
fn who_is_removed_inside_frees_the_area_one_step_later() {
    let (road, connectors) = right_angles();
    let mut actors = crossing_cars(-64.55, 90);
    actors[0].states.iter_mut().skip(36).for_each(|state| *state = None);
    let mut wanted = request(&[2]);
    wanted.conflict_areas = ConflictAreas::Stated(connectors);
    let found = evaluate(&traffic(road, &actors), &wanted).expect("valid");
    near(extreme(&found, Measure::Pet), 0.1 * f64::from(61 - 36), 1e-9);
}

#[test]
fn stopping_before_the_area_is_a_share_of_the_way_that_is_left() {
    let found = crossing_scene(-64.55, 90, None);
    for (column, expected) in [(0, 6.9), (20, 2.3), (30, 0.0), (35, 0.0), (40, INF)] {
        near(at(&found, Measure::Psd, column), expected, 1e-9);
    }
    near(at(&found, Measure::Msd, 0), 100.0 / 23.0, 1e-9);
    // RD < MSD = 4.35 m for columns 26 to 30 of the 31 before it enters.
    near(found.exposure[0].psd_below_one, 5.0 / 31.0, 1e-12);
}

#[test]
fn who_never_enters_or_has_no_partner_has_no_conflict() {
    let alone = crossing_scene(-64.55, 25, None);
    for measure in [Measure::Et, Measure::Pet, Measure::Psd] {
        assert_eq!(extreme(&alone, measure), INF, "{measure:?}: no participant reached the area");
        assert_eq!(alone.extremes[measure as usize][0].time_step, 0);
    }
    let (road, connectors) = right_angles();
    let mut wanted = request(&[1]);
    wanted.conflict_areas = ConflictAreas::Stated(connectors);
    let only = traffic(road, &crossing_cars(-64.55, 90)[..1]);
    let found = evaluate(&only, &wanted).expect("valid");
    assert_eq!((extreme(&found, Measure::Et), extreme(&found, Measure::Psd)), (INF, INF));
    assert!(found.exposure[0].psd_below_one.is_nan());
}

#[test]
fn who_starts_inside_has_a_flag() {
    let (road, connectors) = right_angles();
    let mut actors = crossing_cars(-64.55, 90);
    actors[0].states.iter_mut().take(34).for_each(|state| *state = None);
    let mut wanted = request(&[1]);
    wanted.conflict_areas = ConflictAreas::Stated(connectors);
    let found = evaluate(&traffic(road, &actors), &wanted).expect("valid");
    near(extreme(&found, Measure::Et), 0.6, 1e-9);
    assert!(found.exposure[0].et_left_censored);
}

#[test]
fn crossing_lanelets_are_found_where_no_intersection_is_stated() {
    let (road, _) = right_angles();
    let mut wanted = request(&[1]);
    wanted.conflict_areas = ConflictAreas::Crossing;
    let found = evaluate(&traffic(road.clone(), &crossing_cars(-64.55, 90)), &wanted).expect("valid");
    near(extreme(&found, Measure::Et), 0.9, 1e-9);
    near(extreme(&found, Measure::Pet), 2.1, 1e-9);
    wanted.conflict_areas = ConflictAreas::Stated(Vec::new());
    let found = evaluate(&traffic(road, &crossing_cars(-64.55, 90)), &wanted).expect("valid");
    assert_eq!(extreme(&found, Measure::Et), INF);
}

/// Straight on (lanelet 2) and a turn to the left (4) start in the same lane; the crossing road (12) cuts only the
/// straight one.
pub(in crate::criticality) fn fork_before_a_crossing() -> (RoadNetwork, Vec<Connector>) {
    let lane = |id, points: &[Point], next: &[i64]| with_successors(tapered_lane(id, points, 4.0, 4.0), next);
    let turn: Vec<Point> = (0..=16)
        .map(|i| {
            Point::new(-10.0, 10.0)
                + Point::from_angle((f64::from(i) / 16.0 - 1.0) * std::f64::consts::FRAC_PI_2) * 10.0
        })
        .collect();
    let road = open(vec![
        lane(1, &straight((-60.0, 0.0), (-10.0, 0.0)), &[2, 4]),
        lane(2, &straight((-10.0, 0.0), (30.0, 0.0)), &[3]),
        lane(3, &straight((30.0, 0.0), (80.0, 0.0)), &[]),
        lane(4, &turn, &[5]),
        lane(5, &straight((0.0, 10.0), (0.0, 60.0)), &[]),
        lane(11, &straight((20.0, -60.0), (20.0, -10.0)), &[12]),
        lane(12, &straight((20.0, -10.0), (20.0, 10.0)), &[13]),
        lane(13, &straight((20.0, 10.0), (20.0, 60.0)), &[]),
    ]);
    let connector = |id, incoming| Connector { lanelet: road.index_of(id).expect("a lanelet"), incoming };
    let connectors = vec![connector(2, 0), connector(4, 0), connector(12, 1)];
    (road, connectors)
}

pub(in crate::criticality) fn straight_on(id: i64) -> Actor {
    Actor::car(id, (0..100).map(|k| state(-50.0 + f64::from(k), 0.0, 0.0, 10.0)))
}

/// Turns to the left after `after` steps.
pub(in crate::criticality) fn turning(id: i64, after: f64) -> Actor {
    let at = |k: u32| {
        let s = f64::from(k) - after;
        let angle = (s / 10.0).clamp(0.0, std::f64::consts::FRAC_PI_2);
        let p = Point::new(-10.0, 10.0) + Point::from_angle(angle - std::f64::consts::FRAC_PI_2) * 10.0;
        let rest = if s < 0.0 { Point::new(s, 0.0) } else { Point::new(0.0, (s - 15.707963).max(0.0)) };
        state(p.x + rest.x, p.y + rest.y, angle, 10.0)
    };
    Actor::car(id, (0..95).map(at))
}

#[test]
fn of_the_connectors_behind_one_lane_the_followed_one_counts() {
    let (road, connectors) = fork_before_a_crossing();
    let other = Actor::car(2, (0..100).map(|k| state(20.0, -50.0 + f64::from(k), std::f64::consts::FRAC_PI_2, 10.0)));
    for (own, expected) in [(straight_on(1), true), (turning(1, 40.0), false)] {
        let mut wanted = request(&[1]);
        wanted.conflict_areas = ConflictAreas::Stated(connectors.clone());
        let found = evaluate(&traffic(road.clone(), &[own, other.clone()]), &wanted).expect("valid");
        assert_eq!(extreme(&found, Measure::Et).is_finite(), expected);
    }
}

#[test]
fn connectors_from_the_same_incoming_have_no_conflict_area() {
    let (road, mut connectors) = fork_before_a_crossing();
    let both = traffic(road, &[straight_on(1), turning(2, 60.0)]);
    for (incoming, is_conflict) in [(0, false), (7, true)] {
        connectors[1].incoming = incoming;
        let mut wanted = request(&[1]);
        wanted.conflict_areas = ConflictAreas::Stated(connectors.clone());
        let found = evaluate(&both, &wanted).expect("valid");
        assert_eq!(extreme(&found, Measure::Et).is_finite(), is_conflict, "{incoming}");
    }
}

/// Lanelet and incoming of every connector that is found in a road without intersections.
fn found_connectors(road: &RoadNetwork) -> Vec<(usize, i64)> {
    let overlaps = crate::criticality::overlap::Overlaps::new(road, 0.3, 0.1);
    let connectors = crate::criticality::conflict::crossing_connectors(road, &overlaps);
    connectors.into_iter().map(|connector| (connector.lanelet, connector.incoming)).collect()
}

#[test]
fn connectors_are_lanelets_that_cross_or_join_one_per_lane_that_leads_in() {
    use crate::road::testing::{crossing, fork, merge};
    let (road, _) = right_angles();
    let index = |id| road.index_of(id).expect("a lanelet");
    let expected = [(index(2), index(1) as i64), (index(12), index(11) as i64)];
    assert_eq!(found_connectors(&road), expected);
    // Where nothing leads in, a lanelet is an incoming of its own, with a number that no lanelet has.
    assert_eq!(found_connectors(&crossing()), [(0, -1), (1, -2)]);
    assert_eq!(found_connectors(&merge()), [(0, -1), (1, -2)]);
    // Lanelets that part overlap, and so does a lanelet with its own successor on a map that is not exact.
    assert_eq!(found_connectors(&fork()), []);
    let lane = |id, from, to, next: &[i64]| with_successors(tapered_lane(id, &straight(from, to), 4.0, 4.0), next);
    let overlapping = open(vec![lane(1, (0.0, 0.0), (50.0, 0.0), &[2]), lane(2, (45.0, 0.0), (90.0, 0.0), &[])]);
    assert_eq!(found_connectors(&overlapping), []);
}
