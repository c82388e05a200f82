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

fn all(bodies: &[ObservedBody]) -> Vec<usize> {
    (0..bodies.len()).collect()
}

impl World {
    fn new(turn: f64, shift: Point) -> Self {
        let road = road(turn, shift);
        let center = moved(Point::new(150.0, 0.0), turn, shift);
        let pose = Pose { position: center, orientation: turn };
        let area = PlacedShape { shape: Shape::rectangle(10.0, 3.5), pose };
        let state = GoalState {
            areas: [area].into(),
            time_step: (50, 100),
            velocity: Some((4.0, 12.0)),
            orientation: Some((turn - 0.1, turn + 0.3)),
        };
        let start = Pose { position: moved(Point::new(20.0, 0.0), turn, shift), orientation: turn };
        let areas: Vec<_> = state.areas.to_vec();
        let route = find_route(&road, start, 10.0, &areas, &RouteSettings::default()).expect("a straight road");
        Self { road, route, goal: Goal { states: vec![state], pace: None }, turn, shift }
    }

    fn state(&self, x: f64, y: f64, orientation: f64, velocity: f64, yaw_rate: f64) -> State {
        let Point { x, y } = moved(Point::new(x, y), self.turn, self.shift);
        State { x, y, orientation: orientation + self.turn, velocity, acceleration: 1.0, yaw_rate }
    }

    fn body(&self, id: i64, x: f64, y: f64, heading: f64, velocity: f64, class: usize) -> ObservedBody {
        let position = moved(Point::new(x, y), self.turn, self.shift);
        let axis = Point::from_angle(heading + self.turn);
        ObservedBody { id, position, axis, velocity, size: (4.0, 1.6), class, predicted: None, before: None }
    }

    /// Calls a function with an observer.
    fn with_observer<T>(&self, state: &State, predictions: Option<&Predictions>, call: impl Fn(&Observer) -> T) -> T {
        let table = PathTable::new(&self.route, &self.goal, &self.road);
        let axle = CAR.rear_axle_from_center(state.pose());
        call(&Observer {
            state,
            vehicle: &CAR,
            route: &self.route,
            table: &table,
            limits: &SpeedLimits::default(),
            goal: &self.goal,
            road: &self.road,
            predictions,
            s: self.route.path.project(axle).expect("beside the path").0,
            time_step: 40,
            dt: 0.1,
            last_time_step: Some(170),
        })
    }

    fn observed(&self, state: &State, bodies: &[ObservedBody]) -> Vec<f32> {
        self.observed_with(&ObservationSettings::default(), state, bodies, None)
    }

    fn observed_with(
        &self,
        settings: &ObservationSettings,
        state: &State,
        bodies: &[ObservedBody],
        predictions: Option<&Predictions>,
    ) -> Vec<f32> {
        self.with_observer(state, predictions, |observer| {
            let mut out = vec![9.0; layout::length(settings)];
            observe(observer, bodies, &all(bodies), settings, &mut ObservationMemory::default(), &mut out);
            out
        })
    }

    fn picture(&self, state: &State, bodies: &[ObservedBody]) -> Vec<u8> {
        self.with_observer(state, None, |observer| {
            let mut out = vec![9; PIXELS];
            draw(observer, bodies, &all(bodies), &mut out);
            out
        })
    }

    /// A point of this world in the observer's frame.
    fn point(&self, x: f64, y: f64) -> Point {
        moved(Point::new(x, y), self.turn, self.shift)
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

/// A body with a row of predictions, and where it was half a second ago.
fn expected(body: ObservedBody, row: usize, before: Point) -> ObservedBody {
    ObservedBody { predicted: Some(row), before: Some((before, body.axis)), ..body }
}

/// What is expected of one participant: it drives along x at 5 m/s from 70 m on, more surely than that it stands.
fn predictions(world: &World) -> Predictions {
    let mut table = Predictions::empty(40, vec![7], 2, 25);
    table.probability.copy_from_slice(&[0.3, 0.7]);
    for step in 0..25 {
        let at = table.offset(0, 1) + step;
        let place = world.point(70.0 + 0.5 * (step + 1) as f64, 3.5);
        (table.x[at], table.y[at], table.valid[at]) = (place.x, place.y, true);
        (table.covariance_xx[at], table.covariance_xy[at], table.covariance_yy[at]) = (1.5, 0.0, 0.5);
    }
    table
}

#[test]
fn the_nearest_pieces_of_road_edges_are_told_with_the_road_on_their_right() {
    let world = plain();
    let settings = ObservationSettings { edges: 3, route: 0, partners: 0, ..ObservationSettings::default() };
    let found = world.observed_with(&settings, &world.state(60.0, 1.0, 0.0, 10.0, 0.0), &[], None);
    let edge = |i: usize| &found[28 + 6 * i..28 + 6 * (i + 1)];
    // Pieces of 5 m; two of them meet 2.75 m to the right, where the edge runs back along the road.
    for i in 0..2 {
        close(edge(i), &[1.0, 0.0, -2.75 / 50.0, 0.0, -1.0, 0.5]);
    }
    close(edge(2), &[1.0, 0.0, 4.25 / 50.0, 0.0, 1.0, 0.5]);
}

#[test]
fn edges_farther_than_50_m_are_not_told() {
    let world = plain();
    let settings = ObservationSettings { edges: 256, route: 0, partners: 0, ..ObservationSettings::default() };
    let found = world.observed_with(&settings, &world.state(100.0, 0.0, 0.0, 10.0, 0.0), &[], None);
    let told: Vec<_> = found[28..].chunks(6).filter(|edge| edge[0] == 1.0).collect();
    // 100 m on both sides in pieces of 5 m, and those that begin where the others end.
    assert!((40..=44).contains(&told.len()), "{}", told.len());
    assert!(told.iter().all(|edge| edge[1].hypot(edge[2]) <= 1.0), "distances up to 50 m");
    assert!(
        told.windows(2).all(|pair| pair[0][1].hypot(pair[0][2]) <= pair[1][1].hypot(pair[1][2]) + 1e-6),
        "nearest first"
    );
}

#[test]
fn the_most_probable_drive_is_told_in_the_order_of_the_partners_as_far_as_it_is_expected() {
    let world = plain();
    let settings = ObservationSettings { predictions: true, route: 0, partners: 3, ..ObservationSettings::default() };
    let bodies =
        [world.body(9, 62.0, 3.5, 0.0, 5.0, 0), expected(world.body(7, 70.0, 3.5, 0.0, 5.0, 0), 0, Point::default())];
    let table = predictions(&world);
    let found = world.observed_with(&settings, &world.state(60.0, 0.0, 0.0, 10.0, 0.0), &bodies, Some(&table));
    let rows = &found[28 + 3 * 14..];
    // Nothing is expected of the nearest one, and there is no third one.
    close(&rows[..10], &[0.0; 10]);
    let beside = 3.5 / 80.0;
    close(&rows[10..20], &[0.7, 15.0 / 80.0, beside, 0.1, 20.0 / 80.0, beside, 0.1, 0.0, 0.0, 0.0]);
    close(&rows[20..], &[0.0; 10]);
}

#[test]
fn edges_and_predictions_do_not_change_if_the_world_is_turned_and_moved() {
    let (here, there) = (plain(), World::new(2.3, Point::new(3_000.0, -7_000.0)));
    let settings = ObservationSettings { edges: 9, predictions: true, ..ObservationSettings::default() };
    let [here, there] = [&here, &there].map(|world| {
        let body = expected(world.body(7, 70.0, 3.5, 0.0, 5.0, 0), 0, Point::default());
        world.observed_with(&settings, &world.state(61.0, 0.7, 0.15, 12.0, -0.1), &[body], Some(&predictions(world)))
    });
    close(&there, &here.iter().map(|value| f64::from(*value)).collect::<Vec<_>>());
}

/// Row and column of a point ahead of the observer and to its left [m].
fn pixel_at(ahead: f64, left: f64) -> usize {
    ((72.0 - ahead / 0.75).round() as usize) * 96 + (48.0 - left / 0.75).round() as usize
}

#[test]
fn a_picture_shows_the_road_the_own_way_and_others_now_and_half_a_second_ago() {
    let world = plain();
    let body = expected(world.body(7, 85.0, 3.5, 0.0, 10.0, 0), 0, world.point(80.0, 3.5));
    let picture = world.picture(&world.state(60.0, 0.0, 0.0, 10.0, 0.0), &[body]);
    let layers: Vec<&[u8]> = picture.chunks(96 * 96).collect();
    assert!(picture.iter().all(|value| [0, 255].contains(value)));
    let is_set = |layer: usize, ahead: f64, left: f64| layers[layer][pixel_at(ahead, left)] == 255;
    // Two lanes, to 5.25 m on the left and 1.75 m on the right: pixels from 5.25 m to -1.5 m.
    for (left, expected) in [(6.0, false), (5.25, true), (0.0, true), (-1.5, true), (-2.25, false)] {
        assert_eq!(is_set(0, 30.0, left), expected, "{left} m to the left");
    }
    // The path is as wide as the car, 1.61 m; the goal, 10 m by 3.5 m around 90 m ahead, is out of the picture.
    let on_path: Vec<_> = [1.5, 0.75, 0.0, -0.75, -1.5].map(|left| is_set(1, 30.0, left)).to_vec();
    assert_eq!(on_path, [false, true, true, true, false]);
    // 4 m by 1.6 m around 25 m ahead and 3.5 m to the left; half a second ago around 20 m ahead.
    for (layer, ahead) in [(2, 25.0), (3, 20.0)] {
        assert_eq!(layers[layer].iter().filter(|value| **value == 255).count(), 6 * 2, "pixels of layer {layer}");
        assert!(is_set(layer, ahead, 3.5) && !is_set(layer, ahead + 3.0, 3.5));
    }
}

#[test]
fn a_picture_shows_the_goal_that_is_near() {
    let world = plain();
    let picture = world.picture(&world.state(120.0, 0.0, 0.0, 10.0, 0.0), &[]);
    let way = &picture[96 * 96..2 * 96 * 96];
    // It is wider than the path: 1.5 m to the left is inside from 25 m to 35 m ahead.
    let inside: Vec<_> = [24.0, 25.5, 30.0, 34.5, 36.0].map(|ahead| way[pixel_at(ahead, 1.5)] == 255).to_vec();
    assert_eq!(inside, [false, true, true, true, false]);
}

#[test]
fn turned_and_moved_worlds_look_the_same_but_for_points_on_borders() {
    let (here, there) = (plain(), World::new(2.3, Point::new(3_000.0, -7_000.0)));
    let [here, there] = [&here, &there].map(|world| {
        let body = expected(world.body(7, 70.0, 3.6, 0.1, 5.0, 0), 0, world.point(67.0, 3.3));
        world.picture(&world.state(61.1, 0.7, 0.15, 12.0, -0.1), &[body])
    });
    let different = here.iter().zip(&there).filter(|(here, there)| here != there).count();
    assert_eq!(different, 0, "of {} pixels", here.len());
}
