//! Lanes are 3.5 m wide, the strips of vehicles 2.2 m.

use super::*;
use crate::control::Priorities;
use crate::road::LaneletInput;
use crate::road::testing::{arc, crossing, fork, lane, merge, open, straight, straight_road, with_successors};
use crate::turn::Turn;

fn junctions(road: &RoadNetwork, priorities: Priorities) -> Junctions {
    Junctions::of(road, &Control { priorities, ..Control::default() })
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
}

/// A T-junction with arms to the west, east and north; two lanes of 3.5 m each, right-hand traffic. Lanelets 1, 2, 3 lead
/// in from west, east and north, 11 to 13 lead out there; 21 is from west to east, and so on.
fn t_junction() -> Vec<LaneletInput> {
    let (near, far, lane_y) = (10.0, 60.0, 1.75);
    let (pi, half) = (std::f64::consts::PI, std::f64::consts::FRAC_PI_2);
    let wide = near + lane_y;
    let narrow = near - lane_y;
    vec![
        with_successors(lane(1, &straight((-far, -lane_y), (-near, -lane_y))), &[21, 22]),
        with_successors(lane(2, &straight((far, lane_y), (near, lane_y))), &[23, 24]),
        with_successors(lane(3, &straight((-lane_y, far), (-lane_y, near))), &[25, 26]),
        lane(11, &straight((-near, lane_y), (-far, lane_y))),
        lane(12, &straight((near, -lane_y), (far, -lane_y))),
        lane(13, &straight((lane_y, near), (lane_y, far))),
        with_successors(lane(21, &straight((-near, -lane_y), (near, -lane_y))), &[12]),
        with_successors(lane(22, &arc((-near, near), wide, -half, 0.0)), &[13]),
        with_successors(lane(23, &straight((near, lane_y), (-near, lane_y))), &[11]),
        with_successors(lane(24, &arc((near, near), narrow, -half, -pi)), &[13]),
        with_successors(lane(25, &arc((near, near), wide, pi, 1.5 * pi)), &[12]),
        with_successors(lane(26, &arc((-near, near), narrow, 0.0, -half)), &[11]),
    ]
}

/// Ids of the lanelets that go first and that wait, and why, for every area.
fn orders(road: &RoadNetwork, found: &Junctions) -> Vec<(i64, i64, Reason)> {
    let id = |area: &Area, side: usize| road.lanelets()[area.sides[side].lanelet].id;
    found
        .areas
        .iter()
        .filter_map(|area| area.first.map(|first| (id(area, first), id(area, 1 - first), area.reason)))
        .collect()
}

#[test]
fn two_lanes_that_cross_share_the_width_of_their_strips() {
    let found = junctions(&crossing(), Priorities::default());
    let [area] = &found.areas[..] else { panic!("{:?}", found.areas) };
    assert_eq!((area.kind, found.n_junctions), (AreaKind::Cross, 1));
    for side in area.sides {
        near(side.entry, 50.0 - 1.1);
        near(side.exit, 50.0 + 1.1);
    }
    near(area.hull.center().norm(), 0.0);
    assert_eq!(found.of_lanelet(1), [(0, 1)]);
}

#[test]
fn a_merge_lasts_from_where_the_strips_meet_to_the_end_of_both() {
    let road = merge();
    let found = junctions(&road, Priorities::default());
    let [area] = &found.areas[..] else { panic!("{:?}", found.areas) };
    assert_eq!((area.kind, area.sides[0].exit), (AreaKind::Merge, 50.0));
    // The arc of 20 m is 2.2 m below the lane, edge to edge, about 9 m before its end.
    assert!((39.0..42.0).contains(&area.sides[0].entry), "{:?}", area.sides);
    assert_eq!(orders(&road, &found), [(2, 1, Reason::Side)], "it comes from the right");
}

#[test]
fn neighbours_and_forks_have_no_area() {
    assert!(junctions(&straight_road(3), Priorities::default()).areas.is_empty());
    assert!(junctions(&fork(), Priorities::default()).areas.is_empty());
}

#[test]
fn lanes_against_each_other_on_the_same_ground_are_opposed() {
    let road = open(vec![lane(1, &straight((0.0, 0.0), (40.0, 0.0))), lane(2, &straight((40.0, 0.5), (0.0, 0.5)))]);
    let found = junctions(&road, Priorities::default());
    let [area] = &found.areas[..] else { panic!("{:?}", found.areas) };
    assert_eq!((area.kind, area.first), (AreaKind::Opposed, None));
    near(area.width, 3.5 + 0.5);
    near(area.sides[0].exit - area.sides[0].entry, 40.0);
}

#[test]
fn without_signs_a_left_turn_waits_for_oncoming_traffic_and_all_for_the_right() {
    use Reason::{Oncoming, Side};
    let road = open(t_junction());
    let found = junctions(&road, Priorities::default());
    assert_eq!(found.n_junctions, 1);
    // West's left turn (22) waits for east (23, 24), east (23) for north (25, 26), north's left turn (25) for west.
    let mut expected =
        [(21, 25, Side), (22, 25, Side), (25, 23, Side), (26, 23, Side), (23, 22, Oncoming), (24, 22, Oncoming)];
    let mut found = orders(&road, &found);
    expected.sort_by_key(|order| (order.0, order.1));
    found.sort_by_key(|order| (order.0, order.1));
    assert_eq!(found, expected);
}

#[test]
fn two_opposite_stop_signs_do_not_change_who_of_both_goes_first() {
    let road = open(t_junction());
    let stops_at = |lanelets: &[usize]| {
        let ranks = lanelets.iter().map(|lanelet| (*lanelet, [1, 1, 1])).collect();
        let found = junctions(&road, Priorities { ranks, ..Priorities::default() });
        let oncoming = |order: &&(i64, i64, Reason)| order.2 == Reason::Oncoming;
        (orders(&road, &found).iter().filter(oncoming).count(), orders(&road, &found).len())
    };
    assert_eq!(stops_at(&[0, 1]), (2, 6), "west and east, but not north");
    assert_eq!(stops_at(&[0, 1, 2]), (0, 0), "at an all-way stop the first to arrive goes");
}

#[test]
fn where_main_roads_are_derived_the_stem_of_a_t_waits() {
    let road = open(t_junction());
    let found = junctions(&road, Priorities { derives_main_road: true, ..Priorities::default() });
    let main: Vec<_> = orders(&road, &found).into_iter().filter(|order| order.2 == Reason::MainRoad).collect();
    let expected = [(21, 25), (22, 25), (23, 25), (23, 26)].map(|(first, second)| (first, second, Reason::MainRoad));
    assert_eq!(main, expected);
}

#[test]
fn signs_and_minor_roads_come_before_the_right_and_faster_roads_too() {
    let road = crossing();
    // Lane 2 comes from the right of lane 1.
    let order = |priorities: Priorities, road: &RoadNetwork| orders(road, &junctions(road, priorities))[0];
    assert_eq!(order(Priorities::default(), &road), (2, 1, Reason::Side));
    let left = Priorities { priority_side: -1, ..Priorities::default() };
    assert_eq!(order(left, &road), (1, 2, Reason::Side));
    let signs = Priorities { ranks: [(1, [2, 2, 2])].into(), ..Priorities::default() };
    assert_eq!(order(signs, &road), (1, 2, Reason::Sign));
    let minor = Priorities { minor: [1].into(), ..Priorities::default() };
    assert_eq!(order(minor, &road), (1, 2, Reason::Minor));
    let stops = Priorities { ranks: [(0, [1, 1, 1]), (1, [1, 1, 1])].into(), ..Priorities::default() };
    assert_eq!(junctions(&road, stops).areas[0].first, None, "an all-way stop");
    let mut lanes = [lane(1, &straight((-50.0, 0.0), (50.0, 0.0))), lane(2, &straight((0.0, -50.0), (0.0, 50.0)))];
    (lanes[0].speed_limit, lanes[1].speed_limit) = (14.0, 10.0);
    assert_eq!(order(Priorities::default(), &open(lanes.to_vec())), (1, 2, Reason::MainRoad));
}

#[test]
fn a_stated_turn_counts_more_than_the_shape() {
    let road = open(t_junction());
    let index = road.index_of(22).expect("a lanelet");
    let found = junctions(&road, Priorities { turns: [(index, Turn::Straight)].into(), ..Priorities::default() });
    assert!(!orders(&road, &found).iter().any(|order| order.1 == 22 && order.2 == Reason::Oncoming));
}
