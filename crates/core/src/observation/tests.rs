//! One observer on a straight road along x: 200 m, lanes of 3.5 m, the right one at y = 0, road edges at y = -1.75 m and
//! 5.25 m.

use super::*;
use crate::geometry::Pose;
use crate::geometry::shape::{PlacedShape, Shape};
use crate::road::RoadNetwork;
use crate::road::testing::{open, parallel_lanes};
use crate::route::{RouteSettings, find_route};
use crate::scenario::GoalState;

const CAR: Vehicle = Vehicle::BMW_320I;

/// The road, turned by an angle around the origin, then moved.
fn road(turn: f64, shift: Point) -> RoadNetwork {
    let mut lanelets = parallel_lanes(2, 200.0);
    for lanelet in &mut lanelets {
        for point in lanelet.left.iter_mut().chain(&mut lanelet.right) {
            *point = moved(*point, turn, shift);
        }
    }
    open(lanelets)
}

fn moved(point: Point, turn: f64, shift: Point) -> Point {
    let axis = Point::from_angle(turn);
    axis * point.x + axis.left() * point.y + shift
}

struct World {
    road: RoadNetwork,
    route: Route,
    goal: Goal,
    turn: f64,
    shift: Point,
}

impl World {
    fn new(turn: f64, shift: Point) -> Self {
        let road = road(turn, shift);
        let center = moved(Point::new(150.0, 0.0), turn, shift);
        let pose = Pose { position: center, orientation: turn };
        let area = PlacedShape { shape: Shape::rectangle(10.0, 3.5), pose };
        let state = GoalState {
            areas: vec![area],
            time_step: (50, 100),
            velocity: Some((4.0, 12.0)),
            orientation: Some((turn - 0.1, turn + 0.3)),
        };
        let start = Pose { position: moved(Point::new(20.0, 0.0), turn, shift), orientation: turn };
        let areas: Vec<_> = state.areas.clone();
        let route = find_route(&road, start, 10.0, &areas, &RouteSettings::default()).expect("a straight road");
        Self { road, route, goal: Goal { states: vec![state] }, turn, shift }
    }

    fn state(&self, x: f64, y: f64, orientation: f64, velocity: f64, yaw_rate: f64) -> State {
        let Point { x, y } = moved(Point::new(x, y), self.turn, self.shift);
        State { x, y, orientation: orientation + self.turn, velocity, acceleration: 1.0, yaw_rate }
    }

    fn body(&self, id: i64, x: f64, y: f64, heading: f64, velocity: f64, class: usize) -> Body {
        let position = moved(Point::new(x, y), self.turn, self.shift);
        Body { id, position, axis: Point::from_angle(heading + self.turn), velocity, size: (4.0, 1.6), class }
    }

    fn observed(&self, state: &State, bodies: &[Body]) -> Vec<f32> {
        let settings = ObservationSettings::default();
        let mut out = vec![9.0; layout::length(&settings)];
        let table = PathTable::new(&self.route, &self.goal, &self.road);
        let axle = CAR.rear_axle_from_center(state.pose());
        let observer = Observer {
            state,
            vehicle: &CAR,
            route: &self.route,
            table: &table,
            limits: &SpeedLimits::default(),
            goal: &self.goal,
            s: self.route.path.project(axle).expect("beside the path").0,
            time_step: 40,
            dt: 0.1,
            last_time_step: Some(170),
        };
        observe(&observer, bodies.iter(), &settings, &mut ObservationMemory::default(), &mut out);
        out
    }
}

fn plain() -> World {
    World::new(0.0, Point::default())
}

fn close(found: &[f32], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((f64::from(*found) - expected).abs() < 1e-4, "{i}: {found}, expected {expected}");
    }
}

#[test]
fn the_observer_is_told_its_state_its_place_on_the_path_and_the_road_edges_beside_it() {
    let world = plain();
    let found = world.observed(&world.state(60.0, 0.5, 0.0, 10.0, 0.2), &[]);
    let steering = (CAR.wheelbase * 0.02).atan() / CAR.steering_angle_max;
    let forward = CAR.forward_acceleration_max(10.0) / 12.0;
    #[rustfmt::skip]
    let expected = [
        0.25, 0.1, 0.2, steering, 0.05, 0.0, 1.0, 0.0, 2.0 / 8.0, forward, 4.508 / 20.0, 1.61 / 4.0,
        0.475, 0.225, // 4.75 m to the left, 2.25 m to the right
        1.0, 0.0,
    ];
    close(&found[..16], &expected);
}

#[test]
fn the_goal_is_told_along_the_path_in_the_own_frame_and_in_time() {
    let world = plain();
    let found = world.observed(&world.state(60.0, 0.0, 0.0, 10.0, 0.0), &[]);
    let heading = 0.1_f64;
    #[rustfmt::skip]
    let expected = [
        0.425, 0.475, // enters at 145 m, leaves at 155 m
        0.45, 0.0, // 90 m ahead
        0.05, 0.3, 0.65, // 1 s, 6 s, 13 s
        -0.15, 0.05, // 4 to 12 m/s at 10 m/s
        heading.sin(), heading.cos(), 1.0,
    ];
    close(&found[16..28], &expected);
}

#[test]
fn places_on_the_path_are_told_until_it_ends() {
    let world = plain();
    let end = world.route.path.length();
    let found = world.observed(&world.state(60.0, 0.0, 0.0, 10.0, 0.0), &[]);
    // The first one is 2 m ahead, with 5.25 m of road to its left and 1.75 m to its right.
    close(&found[28..36], &[1.0, 0.02, 0.0, 0.0, 1.0, 0.0, 0.525, 0.175]);
    close(&found[28 + 15 * 8..28 + 16 * 8], &[1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.525, 0.175]);
    let start = world.route.path.at(0.0).position.x;
    let late = world.observed(&world.state(start + end - 10.0, 0.0, 0.0, 10.0, 0.0), &[]);
    assert_eq!(late[28..][..128].iter().step_by(8).sum::<f32>(), 4.0, "2, 4, 6 and 9 m are left");
}

#[test]
fn others_are_told_by_distance_then_id_in_the_own_frame_and_missing_ones_are_zero() {
    let world = plain();
    let quarter = std::f64::consts::FRAC_PI_2;
    // The observer faces +y; 8 m/s.
    let me = world.state(60.0, 0.0, quarter, 8.0, 0.0);
    let found = world.observed(
        &me,
        &[
            world.body(1, 60.0, 40.0, quarter, 6.0, 0),
            world.body(7, 68.0, 0.0, 0.0, 4.0, 1),
            world.body(5, 60.0, 8.0, quarter, 0.0, 2),
        ],
    );
    let partner = |i: usize| &found[156 + 14 * i..156 + 14 * (i + 1)];
    // Both are 8 m away, 5 has the smaller id.
    close(partner(0), &[1.0, 0.1, 0.0, 0.0, 1.0, 0.0, -0.2, 0.0, 0.2, 0.4, 0.0, 0.0, 1.0, 0.0]);
    // It is to the right and drives to the right at 4 m/s.
    close(partner(1), &[1.0, 0.0, -0.1, -1.0, 0.0, 0.1, -0.2, -0.1, 0.2, 0.4, 0.0, 1.0, 0.0, 0.0]);
    close(partner(2), &[1.0, 0.5, 0.0, 0.0, 1.0, 0.15, -0.05, 0.0, 0.2, 0.4, 1.0, 0.0, 0.0, 0.0]);
    assert!(found[156 + 42..].iter().all(|value| *value == 0.0));
}

#[test]
fn of_more_participants_than_there_is_room_for_the_nearest_are_told() {
    let world = plain();
    let bodies: Vec<_> =
        (0..40).map(|i| world.body(i, 60.0 + ((i * 17) % 40) as f64 + 1.0, 0.0, 0.0, 0.0, 0)).collect();
    let found = world.observed(&world.state(60.0, 0.0, 0.0, 0.0, 0.0), &bodies);
    let ahead: Vec<f32> = found[156..].iter().skip(1).step_by(14).map(|x| (x * 80.0).round()).collect();
    assert_eq!(ahead, (1..=12).map(|x| x as f32).collect::<Vec<_>>());
}

#[test]
fn nothing_changes_if_the_world_is_turned_and_moved() {
    let (here, there) = (plain(), World::new(2.3, Point::new(3_000.0, -7_000.0)));
    let [here, there] = [&here, &there].map(|world| {
        let bodies = [world.body(1, 90.0, 3.0, 0.2, 5.0, 0), world.body(2, 40.0, 0.5, -0.1, 15.0, 3)];
        world.observed(&world.state(60.0, 0.7, 0.15, 12.0, -0.1), &bodies)
    });
    close(&there, &here.iter().map(|value| f64::from(*value)).collect::<Vec<_>>());
}
