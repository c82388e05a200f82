use super::testing::*;
use super::*;
use crate::error::Error;
use crate::geometry::shape::{OrientedBox, Shape};
use std::f64::consts::{FRAC_PI_2, PI};

const NO_EXTENSION: RoadSettings = RoadSettings {
    gap_tolerance: 0.1,
    open_end_length: 0.0,
    judge: RoadJudge::Body,
    turn_tolerance: 0.3,
    overhang_max: 0.8,
};

fn ids(road: &RoadNetwork, indices: &[usize]) -> Vec<i64> {
    indices.iter().map(|i| road.lanelets()[*i].id).collect()
}

fn edge_length(road: &RoadNetwork) -> f64 {
    road.road_edges().iter().map(|edge| edge.a.distance(edge.b)).sum()
}

fn shifted(mut lanelet: LaneletInput, x: f64, y: f64) -> LaneletInput {
    for point in lanelet.left.iter_mut().chain(&mut lanelet.right) {
        *point = *point + Point::new(x, y);
    }
    lanelet
}

/// A car footprint at a place.
fn is_covered(road: &RoadNetwork, x: f64, y: f64, orientation: f64) -> bool {
    let pose = Pose::new(x, y, orientation);
    let by_shape = road.covers(&Shape::rectangle(4.5, 1.8), pose);
    let by_box = road.box_is_covered(&OrientedBox::new(pose, 4.5, 1.8));
    assert_eq!(by_shape, by_box, "both tests agree at {pose:?}");
    by_shape
}

// --- input and relations ---

#[test]
fn impossible_lanelets_are_refused_by_id() {
    let good = lane(5, &straight((0.0, 0.0), (10.0, 0.0)));
    let short = LaneletInput { left: vec![Point::default()], ..good.clone() };
    let nan = LaneletInput { right: vec![Point::default(), Point::new(f64::NAN, 0.0)], ..good.clone() };
    let point = LaneletInput { left: vec![Point::default(); 2], right: vec![Point::default(); 2], ..good.clone() };
    for lanelets in [vec![short], vec![nan], vec![point], vec![good.clone(), good.clone()]] {
        let Err(Error::InvalidInput(message)) = RoadNetwork::new(lanelets, NO_EXTENSION) else { panic!("accepted") };
        assert!(message.contains("lanelet 5"), "{message}");
    }
    assert!(RoadNetwork::new(vec![], NO_EXTENSION).is_err());
    assert!(RoadNetwork::new(vec![good], RoadSettings { gap_tolerance: -1.0, ..NO_EXTENSION }).is_err());
}

#[test]
fn relations_stated_on_one_side_are_completed_and_unknown_ids_dropped() {
    let mut first = with_successors(lane(20, &straight((0.0, 0.0), (10.0, 0.0))), &[10, 99]);
    first.adjacent_left = Some((30, true));
    let second = lane(10, &straight((10.0, 0.0), (20.0, 0.0)));
    let mut beside = lane(30, &straight((0.0, 3.5), (10.0, 3.5)));
    beside.predecessors = vec![98];
    let road = closed(vec![first, second, beside]);
    let [a, b, c] = [20, 10, 30].map(|id| road.index_of(id).expect("known"));
    assert_eq!(road.lanelets()[a].successors, [b]);
    assert_eq!(road.lanelets()[b].predecessors, [a]);
    assert_eq!(road.lanelets()[c].adjacent_right, Some((a, true)));
    assert!(road.lanelets()[c].predecessors.is_empty());
}

#[test]
fn neighbours_are_found_by_their_shared_bound_if_the_file_names_none() {
    let mut lanelets = parallel_lanes(2, 50.0);
    lanelets.push(lane(3, &straight((50.0, -3.5), (0.0, -3.5))));
    let road = closed(lanelets);
    let [one, two, oncoming] = [0, 1, 2].map(|i| &road.lanelets()[i]);
    assert_eq!((one.adjacent_left, two.adjacent_right), (Some((1, true)), Some((0, true))));
    // The lane to the right of lane 1 drives on the wrong side, so their right bounds touch.
    assert_eq!((one.adjacent_right, oncoming.adjacent_right), (Some((2, false)), Some((0, false))));
}

#[test]
fn a_successor_that_starts_elsewhere_is_not_one() {
    let road = closed(vec![with_successors(lane(1, &straight((0.0, 0.0), (20.0, 0.0))), &[1])]);
    assert!(road.lanelets()[0].successors.is_empty());
    assert!(!ring().lanelets()[3].successors.is_empty(), "but a ring may close");
}

// --- what is here ---

#[test]
fn a_point_is_in_all_lanelets_that_overlap_there() {
    let road = crossing();
    for (x, y, expected) in [(0.0, 0.0, vec![1, 2]), (20.0, 1.0, vec![1]), (0.5, -30.0, vec![2]), (20.0, 20.0, vec![])]
    {
        assert_eq!(ids(&road, &road.lanelets_at(Point::new(x, y))), expected, "({x}, {y})");
    }
    assert_eq!(ids(&road, &road.lanelets_near(Point::new(20.0, 3.0), 1.5)), [1]);
}

#[test]
fn a_lanelet_whose_bounds_cross_still_contains_its_points() {
    let mut twisted = lane(1, &straight((0.0, 0.0), (30.0, 0.0)));
    for i in 20..=30 {
        std::mem::swap(&mut twisted.left[i], &mut twisted.right[i]);
    }
    let road = closed(vec![twisted]);
    for x in [5.0, 15.0, 25.0] {
        assert_eq!(road.lanelets_at(Point::new(x, 1.2)), [0], "x = {x}");
    }
    assert!(is_covered(&road, 25.0, 0.0, 0.0) && !is_covered(&road, 25.0, 1.5, 0.0));
}

#[test]
fn the_best_lanelet_for_a_pose_contains_it_and_has_its_direction() {
    let road = crossing();
    let found = road.matching(Pose::new(0.5, 0.3, 0.1), 1.5, PI);
    assert_eq!(ids(&road, &[found[0].lanelet, found[1].lanelet]), [1, 2]);
    let best = found[0];
    assert!((best.s - 50.5).abs() < 1e-9 && (best.d - 0.3).abs() < 1e-9 && (best.heading_error - 0.1).abs() < 1e-9);
    assert!((found[1].heading_error + FRAC_PI_2 - 0.1).abs() < 1e-9);
    assert_eq!(road.matching(Pose::new(0.5, 0.3, 0.1), 1.5, 0.5).len(), 1);
    assert_eq!(road.matching(Pose::new(20.0, 3.0, 0.0), 1.5, 0.5).len(), 1, "beside the lane, within tolerance");
    assert!(road.matching(Pose::new(20.0, 4.0, 0.0), 1.5, 0.5).is_empty());
}

// --- road edges ---

#[test]
fn the_edge_of_two_lanes_is_their_common_outline() {
    assert!((edge_length(&closed(parallel_lanes(2, 100.0))) - (2.0 * 100.0 + 2.0 * 7.0)).abs() < 1e-6);
}

#[test]
fn hairline_gaps_and_overlaps_between_neighbours_leave_no_edge() {
    for gap in [-0.4, -0.05, 0.0, 0.05, 0.095] {
        let mut lanelets = parallel_lanes(2, 100.0);
        lanelets[1] = shifted(lanelets[1].clone(), 0.15, gap);
        let inner =
            closed(lanelets).road_edges().iter().filter(|e| e.a.y > 0.5 && e.b.y < 3.0 && e.a.x != e.b.x).count();
        assert_eq!(inner, 0, "gap of {gap} m");
    }
}

#[test]
fn a_wide_gap_between_lanes_has_edges_on_both_sides() {
    let mut lanelets = parallel_lanes(2, 100.0);
    lanelets[1] = shifted(lanelets[1].clone(), 0.0, 1.0);
    let road = closed(lanelets);
    assert!((edge_length(&road) - 2.0 * (200.0 + 7.0)).abs() < 1e-6);
    assert!(!is_covered(&road, 50.0, 2.25, 0.0));
}

#[test]
fn lanelets_that_start_from_the_same_bounds_keep_the_outer_edge() {
    let road = fork();
    let at = |x: f64, y: f64| {
        let (point, mut near) = (Point::new(x, y), Vec::new());
        road.edges_near(&Aabb { min: point, max: point }.grown(0.2), &mut near);
        !near.is_empty()
    };
    assert!(at(53.0, -1.75), "right of the fork, where both branches lie");
    assert!(!at(58.0, 1.75), "the left border of the straight branch lies in the other branch");
    assert!(!at(50.0, 0.0), "no edge across a joint");
    assert!(at(90.0, 1.75) && at(71.2, 15.0));
}

#[test]
fn crossing_roads_have_no_edge_inside_the_crossing() {
    let road = crossing();
    let mut near = Vec::new();
    road.edges_near(&Aabb { min: Point::new(-1.6, -1.6), max: Point::new(1.6, 1.6) }, &mut near);
    assert!(near.is_empty());
    assert!(is_covered(&road, 0.0, 0.0, 0.4));
}

#[test]
fn edges_near_a_box_are_listed_once_in_ascending_order() {
    let road = straight_road(3);
    let mut near = vec![42];
    road.edges_near(&Aabb { min: Point::new(20.0, -5.0), max: Point::new(60.0, 20.0) }, &mut near);
    assert!(near.len() >= 80 && near.is_sorted_by(|a, b| a < b));
}

// --- covering ---

#[test]
fn a_footprint_may_touch_the_edge_but_not_pass_it_by_more_than_the_tolerance() {
    let road = straight_road(1);
    // Half the lane is 1.75 m, half the car 0.9 m.
    for (y, expected) in
        [(0.0, true), (0.84, true), (0.94, true), (0.96, false), (-0.94, true), (-0.96, false), (9.0, false)]
    {
        assert_eq!(is_covered(&road, 100.0, y, 0.0), expected, "y = {y}");
    }
    assert!(!is_covered(&road, 100.0, 0.0, FRAC_PI_2), "a car across the lane is too long");
}

#[test]
fn small_footprints_and_circles_are_covered_by_the_same_rule() {
    let road = straight_road(1);
    for (shape, y_max) in [(Shape::circle(0.4), 1.45), (Shape::rectangle(0.1, 0.1), 1.85)] {
        assert!(road.covers(&shape, Pose::new(50.0, y_max - 0.02, 0.3)));
        assert!(!road.covers(&shape, Pose::new(50.0, y_max + 0.02, 0.3)));
    }
}

#[test]
fn far_from_every_road_nothing_is_covered() {
    let road = straight_road(1);
    for (x, y) in [(1e7, 0.0), (50.0, -1e7), (f64::NAN, 0.0)] {
        assert!(!road.is_on_road(Point::new(x, y)) && !is_covered(&road, x, y, 0.0));
    }
}

// --- open ends ---

#[test]
fn beyond_the_end_of_the_map_the_road_goes_on_straight() {
    let road = straight_road(2);
    for x in [-115.0, -1.0, 0.0, 200.0, 201.0, 315.0] {
        assert!(is_covered(&road, x, 1.75, 0.0), "x = {x}, between both lanes");
        assert!(!is_covered(&road, x, 6.0, 0.0), "x = {x}, beside the road");
    }
    assert!(!is_covered(&road, 325.0, 0.0, 0.0) && road.lanelets_at(Point::new(210.0, 0.0)).is_empty());
}

#[test]
fn lanes_that_fan_out_at_their_end_continue_side_by_side() {
    let bent =
        |id: i64, y: f64, dy: f64| lane(id, &[Point::new(0.0, y), Point::new(45.0, y), Point::new(50.0, y + dy)]);
    let mut lanelets = vec![bent(1, 0.0, -0.05), bent(2, 3.5, 0.05)];
    lanelets[0].adjacent_left = Some((2, true));
    let road = open(lanelets);
    assert!((0..110).all(|i| is_covered(&road, 52.0 + f64::from(i), 1.75, 0.0)));
}

#[test]
fn an_end_whose_neighbour_goes_on_is_a_dead_end() {
    let mut lanelets = parallel_lanes(2, 100.0);
    lanelets[0].successors = vec![3];
    lanelets.push(lane(3, &straight((100.0, 0.0), (150.0, 0.0))));
    let road = open(lanelets);
    assert!(is_covered(&road, 160.0, 0.0, 0.0) && !is_covered(&road, 104.0, 3.5, 0.0));
}

#[test]
fn an_end_inside_another_lanelet_is_no_open_end() {
    let side_road = lane(9, &straight((30.0, -40.0), (30.0, -1.0)));
    let mut lanelets = parallel_lanes(1, 100.0);
    lanelets.push(side_road);
    let road = open(lanelets);
    assert!(!road.is_on_road(Point::new(30.0, 10.0)) && road.is_on_road(Point::new(30.0, -60.0)));
}

#[test]
fn a_small_gap_before_a_successor_is_road() {
    let road = closed(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
        lane(2, &straight((51.5, 0.2), (100.0, 0.2))),
    ]);
    assert!((45..60).all(|x| is_covered(&road, f64::from(x), 0.0, 0.0)));
    assert!(!is_covered(&road, 50.7, 1.2, 0.0), "but the gap has sides");
}

// --- following lanes ---

#[test]
fn chains_list_the_straightest_branch_first_and_stop_when_long_enough() {
    let road = fork();
    let chains = |distance: f64, max: usize| -> Vec<Vec<i64>> {
        road.paths_from(0, 10.0, distance, max).iter().map(|chain| ids(&road, chain)).collect()
    };
    assert_eq!(chains(39.0, 9), [vec![1]]);
    assert_eq!(chains(60.0, 9), [vec![1, 2], vec![1, 3]]);
    assert_eq!(chains(500.0, 1), [vec![1, 2]]);
    assert!(chains(60.0, 0).is_empty());
}

#[test]
fn a_chain_may_go_round_a_ring_again() {
    let road = ring();
    let round = 2.0 * PI * 20.0;
    assert_eq!(ids(&road, &road.paths_from(0, 0.0, 1.2 * round, 4)[0]), [1, 2, 3, 4, 1]);
}

#[test]
fn poses_and_curvatures_along_a_chain_are_those_of_the_lane() {
    let road = ring();
    let chain = road.paths_from(0, 5.0, 120.0, 1).remove(0);
    for distance in [0.0, 10.0, 26.3, 26.5, 40.0, 90.0] {
        let (pose, axis) = road.chain_pose(&chain, 5.0, distance, 1.0);
        let curvature = road.chain_curvature(&chain, 5.0, distance);
        let angle = (5.0 + distance) / 20.0;
        assert!(pose.position.distance(Point::from_angle(angle) * 19.0) < 0.05, "{distance}: {pose:?}");
        assert!(wrap_angle(pose.orientation - angle - FRAC_PI_2).abs() < 0.01, "{distance}: {pose:?}");
        assert!(axis.distance(Point::from_angle(pose.orientation)) < 1e-12);
        assert!((curvature - 1.0 / 20.0).abs() < 0.002, "{distance}: {curvature}");
    }
}

#[test]
fn beyond_its_ends_a_chain_goes_on_straight() {
    let road = straight_road(1);
    for distance in [-30.0, 100.0, 180.0] {
        let (pose, axis) = road.chain_pose(&[0], 50.0, distance, -0.5);
        assert!(pose.position.distance(Point::new(50.0 + distance, -0.5)) < 1e-9 && axis == Point::new(1.0, 0.0));
        assert!(road.chain_curvature(&[0], 50.0, distance) == 0.0);
    }
}

#[test]
fn a_stretch_of_lane_runs_into_its_straightest_neighbours() {
    let road = fork();
    let stretch = road.lane_stretch(0, 45.0, 10.0, 20.0);
    let spans: Vec<(f64, f64)> = stretch
        .iter()
        .map(|outline| {
            let aabb = Aabb::around(outline.iter().copied());
            (aabb.min.x, aabb.max.x)
        })
        .collect();
    assert_eq!(spans, [(35.0, 50.0), (50.0, 65.0)]);
    assert_eq!(road.lane_stretch(1, 5.0, 10.0, 2.0).len(), 2);
}

#[test]
fn behind_a_merge_a_stretch_of_lane_comes_from_the_straight_branch() {
    let road = merge();
    assert_eq!(ids(&road, road.predecessors_straightest_first(2)), [1, 2]);
    let first = Aabb::around(road.lane_stretch(2, 5.0, 20.0, 5.0).remove(0));
    assert_eq!((first.min.x, first.max.x, first.max.y), (35.0, 50.0, 1.75));
}

#[test]
fn a_slit_between_lanes_is_no_edge_but_a_median_is() {
    // Two lanes that part from x = 20 to 24, up to `width`, and meet again.
    let parting = |width: f64| {
        let mut lanelets = parallel_lanes(2, 50.0);
        for (x, share) in [(21, 0.5), (22, 1.0), (23, 0.5)] {
            lanelets[1].right[x].y += share * width;
        }
        closed(lanelets)
    };
    let inner = |road: &RoadNetwork| {
        road.road_edges().iter().filter(|e| e.a.y > 1.0 && e.a.y < 4.0 && e.a.x > 1.0 && e.a.x < 49.0).count()
    };
    assert_eq!(inner(&parting(0.3)), 0);
    assert!(inner(&parting(2.0)) > 3);
    assert!(is_covered(&parting(0.3), 22.0, 1.75, 0.0) && !is_covered(&parting(2.0), 22.0, 1.75, 0.0));
}

// --- peculiar maps ---

#[test]
fn coordinates_of_five_million_metres_change_nothing() {
    let near = fork();
    let far = |lanelet: &Lanelet| LaneletInput {
        successors: lanelet.successors.iter().map(|i| near.lanelets()[*i].id).collect(),
        ..shifted(
            LaneletInput {
                left: lanelet.left.clone(),
                right: lanelet.right.clone(),
                ..lane(lanelet.id, &straight((0.0, 0.0), (1.0, 0.0)))
            },
            691_000.0,
            5_334_000.0,
        )
    };
    let road = open(near.lanelets().iter().map(far).collect());
    assert_eq!(road.road_edges().len(), near.road_edges().len());
    assert!((edge_length(&road) - edge_length(&near)).abs() < 1e-3);
    assert!(is_covered(&road, 691_053.0, 5_334_000.5, 0.1) && !is_covered(&road, 691_080.0, 5_334_004.0, 0.0));
}

#[test]
fn bounds_with_different_numbers_of_vertices_are_paired_by_relative_length() {
    let mut lanelet = lane(1, &straight((0.0, 0.0), (40.0, 0.0)));
    lanelet.left = vec![lanelet.left[0], lanelet.left[10], lanelet.left[40]];
    let road = closed(vec![lanelet]);
    let lanelet = &road.lanelets()[0];
    assert_eq!(lanelet.left.len(), lanelet.right.len());
    assert!((lanelet.length - 40.0).abs() < 1e-9 && (lanelet.width_at(17.3) - LANE_WIDTH).abs() < 1e-9);
    assert!((edge_length(&road) - 87.0).abs() < 1e-6);
}

#[test]
fn near_duplicate_vertices_and_very_short_lanelets_are_harmless() {
    let mut first = with_successors(lane(1, &straight((0.0, 0.0), (30.0, 0.0))), &[2]);
    for bound in [&mut first.left, &mut first.right] {
        let twin = bound[7] + Point::new(1e-9, 0.0);
        bound.insert(8, twin);
    }
    let short = with_successors(lane(2, &straight((30.0, 0.0), (30.15, 0.0))), &[3]);
    let road = closed(vec![first, short, lane(3, &straight((30.15, 0.0), (60.0, 0.0)))]);
    assert!((5..55).all(|x| is_covered(&road, f64::from(x), 0.9, 0.0) && !is_covered(&road, f64::from(x), 1.1, 0.0)));
    let (pose, _) = road.chain_pose(&[0, 1, 2], 10.0, 20.1, 0.0);
    let curvature = road.chain_curvature(&[0, 1, 2], 10.0, 20.1);
    assert!(
        pose.position.distance(Point::new(30.1, 0.0)) < 1e-6 && pose.orientation.abs() < 1e-9 && curvature.abs() < 1e-9
    );
}

#[test]
fn lanelets_beyond_the_limits_are_refused_by_name() {
    for (x, reason) in [(2e5, "is longer than 100000 m"), (1.1e9, "is not a number up to 1e9")] {
        let mut lanelet = lane(7, &straight((0.0, 0.0), (50.0, 0.0)));
        lanelet.left[0].x = -x;
        lanelet.right[0].x = -x;
        let error = RoadNetwork::new(vec![lanelet], RoadSettings::default()).expect_err("refused").to_string();
        assert!(error.starts_with("lanelet 7: ") && error.ends_with(reason), "{error}");
    }
}

#[test]
fn a_lanelet_of_micrometres_has_the_heading_of_its_chord() {
    let road = closed(vec![lane(1, &[Point::new(0.0, 0.0), Point::new(0.0, 2e-6)])]);
    assert!((road.heading_at(0, 1e-6) - FRAC_PI_2).abs() < 1e-9);
}
