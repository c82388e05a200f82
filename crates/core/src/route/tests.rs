use super::*;
use crate::geometry::shape::Shape;
use crate::road::testing::*;
use crate::road::{LaneletInput, Users};
use crate::vehicle::ParticipantKind;
use std::f64::consts::{FRAC_PI_2, PI};

const SPEED: f64 = 10.0;

fn box_at(x: f64, y: f64, length: f64, width: f64) -> PlacedShape {
    PlacedShape { shape: Shape::rectangle(length, width), pose: Pose::new(x, y, 0.0) }
}

fn find(road: &RoadNetwork, start: Pose, areas: &[PlacedShape]) -> Result<Route> {
    find_route(road, start, SPEED, areas, &RouteSettings::default())
}

fn route(road: &RoadNetwork, start: Pose, areas: &[PlacedShape]) -> Route {
    find(road, start, areas).expect("there is a route")
}

fn ids(road: &RoadNetwork, route: &Route) -> Vec<i64> {
    route.lanelets.iter().map(|i| road.lanelets()[*i].id).collect()
}

fn positions(route: &Route) -> Vec<(f64, Point)> {
    (0..route.path.length() as usize).map(|i| (i as f64, route.path.at(i as f64).position)).collect()
}

/// Sections of three parallel lanes: ids 11, 12, 13 (right to left) from x = 0, then 21, 22, 23, and so on.
fn sections(n: i64, length: f64) -> RoadNetwork {
    let mut lanelets: Vec<LaneletInput> = Vec::new();
    for section in 1..=n {
        let (from, to) = ((section - 1) as f64 * length, section as f64 * length);
        for lane_number in 1..=3 {
            let y = (lane_number - 1) as f64 * LANE_WIDTH;
            let id = 10 * section + lane_number;
            lanelets.push(with_successors(lane(id, &straight((from, y), (to, y))), &[id + 10]));
        }
    }
    open(lanelets)
}

#[test]
fn on_one_lane_the_path_is_its_middle_and_reaches_beyond_start_and_goal() {
    let road = straight_road(1);
    let route = route(&road, Pose::new(60.0, 0.4, 0.02), &[box_at(120.0, 0.0, 10.0, 3.0)]);
    assert_eq!((ids(&road, &route), route.lane_changes), (vec![1], 0));
    assert!(positions(&route).iter().all(|(_, p)| p.y.abs() < 1e-6));
    assert!(route.start_s >= 30.0 && route.path.length() >= route.goal_exit_s + 149.0);
    assert!(
        (route.goal_entry_s - route.start_s - 55.0).abs() < 0.15
            && (route.goal_exit_s - route.goal_entry_s - 10.0).abs() < 0.2
    );
}

#[test]
fn at_a_fork_the_branch_with_the_goal_is_taken() {
    let road = fork();
    for (x, y, branch) in [(80.0, 0.0, 2), (69.0, 14.0, 3)] {
        let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(x, y, 3.0, 3.0)]);
        assert_eq!(ids(&road, &found), [1, branch]);
    }
}

#[test]
fn a_goal_that_is_a_lanelet_is_reached_on_it_rather_than_on_one_that_overlaps_it() {
    let road = fork();
    for branch in [2, 3] {
        let outline = road.lanelets().iter().find(|lanelet| lanelet.id == branch).expect("a branch").polygon.clone();
        let area = PlacedShape { shape: Shape::polygon(&outline).expect("a polygon"), pose: Pose::new(0.0, 0.0, 0.0) };
        let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[area]);
        assert_eq!(ids(&road, &found), [1, branch]);
    }
}

#[test]
fn two_roads_lead_into_a_merge() {
    let road = merge();
    for (start, first) in [(Pose::new(5.0, 0.0, 0.0), 1), (Pose::new(30.0, -19.0, FRAC_PI_2), 2)] {
        let found = route(&road, start, &[box_at(90.0, 0.0, 5.0, 3.0)]);
        assert_eq!(ids(&road, &found), [first, 3]);
        assert!((found.path.at(found.start_s).position.distance(start.position)) < 0.5);
    }
}

#[test]
fn a_start_beside_the_road_belongs_to_the_nearest_lane() {
    let road = straight_road(2);
    for (y, lane_id) in [(-3.2, 1), (-1.75, 1), (1.74, 1), (1.76, 2), (6.7, 2)] {
        let found = route(&road, Pose::new(50.0, y, 0.1), &[]);
        assert_eq!(ids(&road, &found), [lane_id], "y = {y}");
    }
    assert!(matches!(find(&road, Pose::new(50.0, -3.4, 0.0), &[]), Err(Error::NoRoute(_))));
    assert!(matches!(find(&road, Pose::new(50.0, 0.0, PI), &[]), Err(Error::NoRoute(_))), "against the direction");
}

#[test]
fn of_overlapping_lanes_the_start_takes_the_one_that_leads_to_the_goal() {
    let road = crossing();
    let start = Pose::new(0.3, -0.2, 0.7);
    assert_eq!(ids(&road, &route(&road, start, &[box_at(40.0, 0.0, 3.0, 3.0)])), [1]);
    assert_eq!(ids(&road, &route(&road, start, &[box_at(0.0, 40.0, 3.0, 3.0)])), [2]);
}

#[test]
fn a_lane_change_blends_from_one_middle_to_the_other_within_its_length() {
    let road = straight_road(2);
    let found = route(&road, Pose::new(50.0, 0.0, 0.0), &[box_at(180.0, 3.5, 6.0, 2.0)]);
    assert_eq!((ids(&road, &found), found.lane_changes), (vec![1, 2], 1));
    for (s, p) in positions(&found) {
        let (before, after) = (p.x < 48.0, p.x > 50.0 + 4.0 * SPEED + 2.0);
        assert!(p.y > -0.05 && p.y < 3.55, "no overshoot at {s}");
        assert!(!(before && p.y > 0.05 || after && p.y < 3.45), "not outside the blend at {s}");
    }
    assert!(found.path.curvature().iter().all(|k| k.abs() < 0.02));
}

#[test]
fn three_lanes_are_crossed_one_after_the_other_before_the_goal() {
    for (road, expected) in [(straight_road(3), vec![1, 2, 3]), (sections(1, 150.0), vec![11, 12, 13])] {
        let found = route(&road, Pose::new(20.0, 0.0, 0.0), &[box_at(120.0, 7.0, 6.0, 2.0)]);
        assert_eq!((ids(&road, &found), found.lane_changes), (expected, 2));
        assert!((found.path.at(found.goal_entry_s).position.y - 7.0).abs() < 0.1);
        assert!(found.path.curvature().iter().all(|k| k.abs() < 0.05));
    }
}

#[test]
fn a_blend_may_run_over_several_short_lanelets_of_the_same_lanes() {
    let road = sections(10, 15.0);
    let found = route(&road, Pose::new(5.0, 0.0, 0.0), &[box_at(130.0, 3.5, 6.0, 2.0)]);
    assert_eq!(found.lane_changes, 1);
    assert!(found.path.curvature().iter().all(|k| k.abs() < 0.02), "40 m long, although the lanelets are 15 m");
}

#[test]
fn a_blend_stays_within_the_stretch_that_both_lanes_share() {
    // Lane 2 begins at x = 60 and lane 1 ends at x = 90.
    let road = open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (60.0, 0.0))), &[2]),
        lane(2, &straight((60.0, 0.0), (90.0, 0.0))),
        with_successors(lane(3, &straight((60.0, 3.5), (90.0, 3.5))), &[4]),
        lane(4, &straight((90.0, 3.5), (200.0, 3.5))),
    ]);
    let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(180.0, 3.5, 6.0, 2.0)]);
    assert_eq!(ids(&road, &found), [1, 2, 3, 4]);
    for (_, p) in positions(&found) {
        assert!(!(p.x < 59.0 && p.y > 0.1 || p.x > 91.0 && p.y < 3.4), "{p:?}");
    }
}

#[test]
fn fewer_lane_changes_count_more_than_length() {
    // From lane 1 the goal on lane 4 is 100 m away over the neighbour 2, or 180 m by the detour 3.
    let detour: Vec<Point> =
        [(50.0, 0.0), (50.0, -60.0), (140.0, -60.0), (140.0, 3.5)].map(|(x, y)| Point::new(x, y)).to_vec();
    let road = open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[3]),
        with_successors(lane(2, &straight((0.0, 3.5), (50.0, 3.5))), &[4]),
        with_successors(lane(3, &detour), &[5]),
        with_successors(lane(4, &straight((50.0, 3.5), (140.0, 3.5))), &[5]),
        lane(5, &straight((140.0, 3.5), (200.0, 3.5))),
    ]);
    let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(190.0, 3.5, 4.0, 3.0)]);
    assert_eq!(ids(&road, &found), [1, 3, 5]);
}

#[test]
fn a_goal_behind_the_start_on_a_ring_is_reached_once_around() {
    let road = ring();
    let found = route(&road, Pose::new(14.2, 14.1, 2.356), &[box_at(19.5, 5.0, 2.0, 2.0)]);
    assert_eq!(ids(&road, &found), [1, 2, 3, 4, 1]);
    assert!(found.goal_entry_s - found.start_s > 100.0);
}

#[test]
fn a_goal_behind_the_start_on_a_road_without_return_has_no_route() {
    let road = straight_road(2);
    let Err(Error::NoRoute(message)) = find(&road, Pose::new(100.0, 0.0, 0.0), &[box_at(40.0, 0.0, 4.0, 3.0)]) else {
        panic!("found one")
    };
    assert_eq!(message, "the goal lies 60 m behind the start in the same lanelet");
    assert!(find(&road, Pose::new(40.0, 0.0, 0.0), &[box_at(40.0, 0.0, 4.0, 3.0)]).is_ok(), "inside it, it has");
}

#[test]
fn a_goal_off_every_lanelet_has_no_route() {
    assert!(matches!(
        find(&straight_road(1), Pose::default(), &[box_at(50.0, 30.0, 3.0, 3.0)]),
        Err(Error::NoRoute(_))
    ));
}

#[test]
fn a_goal_area_beside_the_path_is_reached_at_its_foot() {
    let road = straight_road(1);
    let found = route(&road, Pose::new(20.0, 0.0, 0.0), &[box_at(100.0, 1.2, 4.0, 1.0)]);
    assert_eq!(found.goal_entry_s, found.goal_exit_s);
    assert!((found.goal_entry_s - found.start_s - 80.0).abs() < 0.01);
}

#[test]
fn of_several_goal_areas_the_span_from_first_to_last_counts() {
    let road = straight_road(1);
    let found = route(&road, Pose::new(20.0, 0.0, 0.0), &[box_at(110.0, 0.0, 4.0, 2.0), box_at(100.0, 0.0, 4.0, 2.0)]);
    assert!((found.goal_entry_s - found.start_s - 78.0).abs() < 0.15);
    assert!((found.goal_exit_s - found.start_s - 92.0).abs() < 0.15);
}

#[test]
fn without_a_goal_position_the_lane_is_followed_straight_on() {
    let road = fork();
    let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[]);
    assert_eq!(ids(&road, &found), [1, 2]);
    assert!(found.goal_entry_s.is_nan() && found.goal_exit_s.is_nan());
    assert!(found.path.length() - found.start_s > 200.0);
}

/// For bicycles alone.
const BICYCLES: Users = Users::from_bits(1 << ParticipantKind::Bicycle as u32);

/// Lane 1 along x to (50, 0); from there lane 2 straight on to (100, 0), and lane 4, which is as long, aside; both lead to
/// lane 3 from (100, 0) to (150, 0).
fn short_cut(users_of_straight: Users) -> RoadNetwork {
    let aside = [Point::new(50.0, 0.0), Point::new(75.0, 8.0), Point::new(100.0, 0.0)];
    open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 4]),
        LaneletInput {
            users: users_of_straight,
            ..with_successors(lane(2, &straight((50.0, 0.0), (100.0, 0.0))), &[3])
        },
        lane(3, &straight((100.0, 0.0), (150.0, 0.0))),
        with_successors(lane(4, &aside), &[3]),
    ])
}

fn route_of(user: ParticipantKind, road: &RoadNetwork, start: Pose, areas: &[PlacedShape]) -> Route {
    let settings = RouteSettings { user, ..RouteSettings::default() };
    find_route(road, start, SPEED, areas, &settings).expect("there is a route")
}

#[test]
fn a_car_goes_round_a_bicycle_lane_that_a_bicycle_takes() {
    let road = short_cut(BICYCLES);
    let way = |user| ids(&road, &route_of(user, &road, Pose::new(10.0, 0.0, 0.0), &[box_at(140.0, 0.0, 5.0, 3.0)]));
    assert_eq!(way(ParticipantKind::Car), [1, 4, 3]);
    assert_eq!(way(ParticipantKind::Truck), [1, 4, 3]);
    assert_eq!(way(ParticipantKind::Bicycle), [1, 2, 3]);
}

#[test]
fn a_goal_that_only_a_bicycle_lane_leads_to_is_reached_over_it() {
    let road = short_cut(BICYCLES);
    let found = route(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(80.0, 0.0, 5.0, 1.0)]);
    assert_eq!(ids(&road, &found), [1, 2]);
}

#[test]
fn a_free_route_follows_the_lane_although_a_bicycle_lane_is_straighter() {
    let road = short_cut(BICYCLES);
    assert_eq!(ids(&road, &route(&road, Pose::new(10.0, 0.0, 0.0), &[])), [1, 4, 3]);
    assert_eq!(ids(&short_cut(Users::ALL), &route(&short_cut(Users::ALL), Pose::new(10.0, 0.0, 0.0), &[])), [1, 2, 3]);
}

#[test]
fn a_car_that_starts_on_a_sidewalk_uses_the_lane_beside_it() {
    let mut lanelets = parallel_lanes(2, 200.0);
    lanelets[0].users = Users::from_bits(0);
    let road = open(lanelets);
    // 0.85 m from the lane, and too far from it.
    let goals = [box_at(150.0, LANE_WIDTH, 5.0, 3.0)];
    assert_eq!(ids(&road, &route(&road, Pose::new(20.0, 0.9, 0.0), &goals)), [2]);
    assert_eq!(ids(&road, &route(&road, Pose::new(20.0, 0.0, 0.0), &goals)), [1, 2]);
}

/// Lane 1 from (0, 0) along x for 60 m; lane 2 leaves it there at an angle [rad], offset to the left [m]; lane 3 follows 2
/// and leads to the end of 1 on a long way; 4 follows both.
fn overlapping(angle: f64, offset: f64) -> RoadNetwork {
    let far = Point::new(0.0, offset) + Point::from_angle(angle) * 60.0;
    let around = [far, far + Point::new(40.0, 20.0), Point::new(160.0, 40.0), Point::new(180.0, 0.0)];
    open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (60.0, 0.0))), &[5]),
        with_successors(lane(2, &straight((0.0, offset), (far.x, far.y))), &[3]),
        with_successors(lane(3, &around), &[4]),
        lane(4, &straight((180.0, 0.0), (240.0, 0.0))),
        with_successors(lane(5, &straight((60.0, 0.0), (180.0, 0.0))), &[4]),
    ])
}

#[test]
fn the_start_lanelet_is_the_one_that_the_start_fits_although_another_one_is_shorter() {
    let goals = [box_at(220.0, 0.0, 5.0, 3.0)];
    for (angle, offset, first) in [(0.4, 0.0, 2), (0.2, 0.0, 2), (0.1, 0.0, 1)] {
        let road = overlapping(angle, offset);
        let found = route(&road, Pose::new(0.5, 0.5 * angle, angle), &goals);
        assert_eq!(ids(&road, &found)[0], first, "{angle} rad");
    }
    // In the same direction the offset decides.
    let road = overlapping(0.0, 1.4);
    assert_eq!(ids(&road, &route(&road, Pose::new(10.0, 1.4, 0.0), &goals))[0], 2);
    assert_eq!(ids(&road, &route(&road, Pose::new(10.0, 0.7, 0.0), &goals))[0], 1);
}

#[test]
fn a_start_lanelet_that_fits_less_counts_where_no_other_leads_to_the_goal() {
    let road = overlapping(0.4, 0.0);
    let goals = [box_at(50.0, 0.0, 5.0, 3.0)];
    assert_eq!(ids(&road, &route(&road, Pose::new(2.0, 0.8, 0.4), &goals)), [1]);
}

#[test]
fn no_route_leads_over_a_gap_of_more_than_3_m() {
    for (gap, connected) in [(0.0, true), (2.9, true), (3.1, false), (200.0, false)] {
        let road = open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
            lane(2, &straight((50.0 + gap, 0.0), (100.0 + gap, 0.0))),
        ]);
        let found = find(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(80.0 + gap, 0.0, 5.0, 3.0)]);
        assert_eq!(found.is_ok(), connected, "{gap} m");
    }
    // A lane's width aside.
    let road = open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
        lane(2, &straight((50.0, 3.5), (100.0, 3.5))),
    ]);
    assert!(find(&road, Pose::new(10.0, 0.0, 0.0), &[box_at(80.0, 3.5, 5.0, 3.0)]).is_err());
}

#[test]
fn where_lanelets_overlap_the_path_goes_on_without_turning_back() {
    for overlap in [2.0, 5.0, 12.0, 40.0] {
        let road = open(vec![
            with_successors(lane(1, &straight((0.0, 0.0), (100.0 + overlap, 0.0))), &[2]),
            lane(2, &straight((100.0, 0.0), (250.0, 0.0))),
        ]);
        let found = route(&road, Pose::new(30.0, 0.0, 0.0), &[box_at(200.0, 0.0, 10.0, 3.0)]);
        assert!((found.goal_entry_s - found.start_s - 165.0).abs() < 0.5, "{overlap} m: {}", found.goal_entry_s);
        assert!(positions(&found).windows(2).all(|pair| pair[1].1.x > pair[0].1.x), "{overlap} m");
    }
}

#[test]
fn branches_that_begin_before_the_end_of_their_lanelet_are_cut_alone() {
    let road = open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (100.0, 0.0))), &[2, 3]),
        lane(2, &straight((92.0, 0.0), (250.0, 0.0))),
        lane(3, &arc((100.0, 30.0), 30.0, -FRAC_PI_2, 0.0)),
    ]);
    let length = |id: i64| road.lanelets()[road.index_of(id).expect("a lanelet")].length;
    assert!((length(1) - 100.0).abs() < 1e-9 && (length(2) - 150.0).abs() < 1e-9, "{} {}", length(1), length(2));
    assert!(road.is_on_road(Point::new(95.0, 1.7)));
}

#[test]
fn what_is_cut_off_stays_drivable() {
    let road = closed(vec![
        with_successors(tapered_lane(1, &straight((0.0, 0.0), (105.0, 0.0)), 8.0, 8.0), &[2]),
        lane(2, &straight((100.0, 0.0), (250.0, 0.0))),
    ]);
    assert!(road.is_on_road(Point::new(104.0, 3.8)) && !road.is_on_road(Point::new(106.0, 3.8)));
}

/// Ids of the lanelets of the pieces, and where the path changes from one lane into the next [x, m].
fn pieces(road: &RoadNetwork, route: &Route) -> (Vec<i64>, Vec<f64>) {
    let ids = route.pieces.iter().map(|piece| road.lanelets()[piece.lanelet].id).collect();
    let changes = route.pieces.iter().filter(|piece| piece.from.is_finite());
    (ids, changes.map(|piece| route.path.at(piece.from).position.x).collect())
}

#[test]
fn the_pieces_of_a_path_are_the_lanelets_in_which_it_lies_whatever_the_route_names() {
    // Lanes of 50 m; a change takes 40 m at 10 m/s.
    let road = sections(5, 50.0);
    for (start, goal, expected, changes) in [
        (10.0, (240.0, 0.0), vec![11, 21, 31, 41, 51], vec![]),
        // It begins at once: half-way at 30 m.
        (10.0, (240.0, LANE_WIDTH), vec![11, 12, 22, 32, 42, 52], vec![30.0]),
        // The route changes before 50 m, the path at 55 m.
        (35.0, (240.0, LANE_WIDTH), vec![11, 21, 22, 32, 42, 52], vec![55.0]),
        (35.0, (240.0, 2.0 * LANE_WIDTH), vec![11, 21, 22, 23, 33, 43, 53], vec![55.0, 95.0]),
    ] {
        let found = route(&road, Pose::new(start, 0.0, 0.0), &[box_at(goal.0, goal.1, 10.0, 3.0)]);
        let (ids, places) = pieces(&road, &found);
        assert_eq!(ids, expected, "from {start} m");
        assert_eq!(places.len(), changes.len());
        assert!(places.iter().zip(changes).all(|(place, x)| (place - x).abs() < 0.5), "{places:?}");
        for pair in found.pieces.windows(2) {
            assert!(pair[0].to == pair[1].from || (pair[0].to.is_infinite() && pair[1].from.is_infinite()));
        }
        let lies_in = |s: f64, piece: &PathPiece| {
            piece.has(s) && road.lanelets_at(found.path.at(s).position).contains(&piece.lanelet)
        };
        let on_road = (0..(240.0 - start) as usize).map(|i| found.start_s + i as f64);
        assert!(on_road.into_iter().all(|s| found.pieces.iter().any(|piece| lies_in(s, piece))));
    }
}

#[test]
fn pieces_know_where_their_lanelets_are_though_these_do_not_end_beside_each_other() {
    // A narrow and a wide lane, cut at 61 and at 59 m; half of the change lies at 60 m.
    let widths = |id: i64, (from, to): (f64, f64), (low, high): (f64, f64)| LaneletInput {
        left: straight((from, high), (to, high)),
        right: straight((from, low), (to, low)),
        ..lane(id, &straight((from, 0.5 * (low + high)), (to, 0.5 * (low + high))))
    };
    let beside = |mut lanelet: LaneletInput, left: Option<i64>, right: Option<i64>| {
        (lanelet.adjacent_left, lanelet.adjacent_right) = (left.map(|id| (id, true)), right.map(|id| (id, true)));
        lanelet
    };
    let (right, left) = ((-1.5, 1.5), (1.5, 6.5));
    let road = open(vec![
        beside(with_successors(widths(1, (0.0, 61.0), right), &[11]), Some(2), None),
        beside(with_successors(widths(2, (0.0, 59.0), left), &[12]), None, Some(1)),
        beside(widths(11, (61.0, 300.0), right), Some(12), None),
        beside(widths(12, (59.0, 300.0), left), None, Some(11)),
    ]);
    let found = route(&road, Pose::new(40.0, 0.0, 0.0), &[box_at(250.0, 4.0, 10.0, 3.0)]);
    let (ids, places) = pieces(&road, &found);
    assert_eq!(ids, [1, 12]);
    assert!((places[0] - 60.0).abs() < 0.5, "{places:?}");
    for (piece, (start, end)) in found.pieces.iter().zip([(0.0, 61.0), (59.0, 300.0)]) {
        let x = |s: f64| found.path.at(s).position.x;
        assert!((x(piece.start) - start).abs() < 0.5 && (x(piece.end) - end).abs() < 0.5, "{piece:?}");
    }
}

fn along(road: &RoadNetwork, start: Pose, track: &[Point], keeps_lane: bool) -> Vec<i64> {
    let settings = RouteSettings { free_length: 200.0, ..RouteSettings::default() };
    let route = route_along(road, start, SPEED, track, keeps_lane, &settings).expect("there is a route");
    assert!(route.goal_entry_s.is_nan() && route.start_s >= 0.0);
    ids(road, &route)
}

#[test]
fn a_route_along_a_track_takes_its_turn_and_goes_straight_on_where_the_track_ends() {
    let road = fork();
    let start = Pose::new(10.0, 0.0, 0.0);
    let ahead: Vec<Point> = (10..50).map(|x| Point::new(f64::from(x), 0.3)).collect();
    let turn = (0..15).map(|i| f64::from(i) / 10.0).map(|a| Point::new(50.0 + 20.0 * a.sin(), 20.0 - 20.0 * a.cos()));
    let turning: Vec<Point> = ahead.iter().copied().chain(turn).collect();
    let straight: Vec<Point> = (10..90).map(|x| Point::new(f64::from(x), -0.4)).collect();
    assert_eq!(along(&road, start, &turning, true), [1, 3]);
    assert_eq!(along(&road, start, &straight, true), [1, 2]);
    assert_eq!(along(&road, start, &ahead, true), [1, 2]);
    assert_eq!(along(&road, start, &[], true), [1, 2]);
}

#[test]
fn a_route_along_a_track_changes_lanes_with_it_unless_it_keeps_its_lane() {
    let road = sections(3, 60.0);
    let start = Pose::new(10.0, 0.0, 0.0);
    let track: Vec<Point> =
        (10..170).map(f64::from).map(|x| Point::new(x, if x < 80.0 { 0.0 } else { LANE_WIDTH })).collect();
    assert_eq!(along(&road, start, &track, true), [11, 21, 31]);
    assert_eq!(along(&road, start, &track, false), [11, 21, 22, 32]);
}

#[test]
fn a_route_leaves_a_lane_that_ends() {
    let mut lanelets = parallel_lanes(2, 60.0);
    let left = with_successors(lanelets.remove(1), &[3]);
    lanelets.push(left);
    lanelets.push(lane(3, &straight((60.0, LANE_WIDTH), (200.0, LANE_WIDTH))));
    let road = open(lanelets);
    assert_eq!(along(&road, Pose::new(10.0, 0.0, 0.0), &[], true), [1, 2, 3]);
}

#[test]
fn a_route_along_a_track_needs_a_lane_to_start_on() {
    let error = route_along(&fork(), Pose::new(10.0, 30.0, 0.0), SPEED, &[], true, &RouteSettings::default());
    assert!(error.expect_err("beside the road").to_string().contains("no lanelet within 1.5 m of the start"));
}
