//! What the network is told in small worlds.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use super::feature_table::{MIRRORED_COLUMNS, N_AGENT, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH};
use super::paths::{FREE, LEFT, Memory, N_OWN, N_PATHS, RIGHT};
use super::{Feature, Inputs, agent_features, neighbour_features, path_features};
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::road::testing::{arc, fork, lane, open, parallel_lanes, straight, straight_road, with_successors};
use crate::road::{LaneletInput, RoadNetwork};
use crate::scene::{Participants, Scene};
use crate::trajectory::{State, States};
use crate::vehicle::ParticipantKind;

/// A participant of a test: kind and the states until now, `dt` apart, the last one is now; `None`: absent.
pub(super) struct Track(pub ParticipantKind, pub Vec<Option<State>>);

/// A car that drove straight at constant speed for `steps` steps.
pub(super) fn car(x: f64, y: f64, orientation: f64, velocity: f64, steps: usize, dt: f64) -> Track {
    let axis = Point::from_angle(orientation);
    let state = |k: usize| {
        let ago = (steps - k) as f64 * dt * velocity;
        Some(State { x: x - axis.x * ago, y: y - axis.y * ago, orientation, velocity, ..State::default() })
    };
    Track(ParticipantKind::Car, (0..=steps).map(state).collect())
}

/// A recording of these, ids from 1; parked vehicles are static.
pub(super) fn scene(tracks: &[Track], dt: f64) -> Scene {
    let n = tracks.len();
    let steps = tracks.iter().map(|track| track.1.len()).max().unwrap_or(1);
    let ids: Vec<i64> = (1..=n as i64).collect();
    let mut past = States::absent(ids.clone(), 1 - steps as i64, steps);
    for (row, Track(_, states)) in tracks.iter().enumerate() {
        for (k, state) in states.iter().enumerate() {
            if let Some(state) = state {
                past.set(row, steps - states.len() + k, state);
            }
        }
    }
    let participants = Participants {
        ids,
        kind: tracks.iter().map(|track| track.0).collect(),
        shape: vec![Shape::rectangle(4.5, 1.8); n],
        is_static: tracks.iter().map(|track| track.0 == ParticipantKind::ParkedVehicle).collect(),
        is_agent: vec![false; n],
        ..Participants::default()
    };
    let present: Vec<usize> = (0..n).filter(|row| past.get(*row, 0).is_some()).collect();
    let turns = vec![None; present.len()];
    Scene { time_step: 0, dt, participants: Arc::new(participants), present, turns, past }
}

fn inputs(tracks: &[Track], road: &RoadNetwork) -> Inputs {
    Inputs::of(&scene(tracks, 0.1), road)
}

/// A feature of a vehicle in its unit.
fn of_agent(inputs: &Inputs, i: usize, name: &str) -> f64 {
    let features = agent_features();
    let k = features.iter().position(|(known, _)| known == name).unwrap_or_else(|| panic!("no feature {name}"));
    f64::from(inputs.agent[i * N_AGENT + k]) * features[k].1.scale
}

/// A feature of a path in its unit.
fn of_path(inputs: &Inputs, i: usize, slot: usize, name: &str) -> f64 {
    let k = path_features().iter().position(|known| known.name == name).unwrap_or_else(|| panic!("no feature {name}"));
    f64::from(inputs.paths[(i * N_PATHS + slot) * N_PATH + k]) * path_features()[k].scale
}

/// A feature of a neighbour in its unit.
fn of_neighbour(inputs: &Inputs, i: usize, rank: usize, name: &str) -> f64 {
    let features = neighbour_features();
    let k = features.iter().position(|known| known.name == name).unwrap_or_else(|| panic!("no feature {name}"));
    f64::from(inputs.neighbours[(i * N_NEIGHBOURS + rank) * N_NEIGHBOUR + k]) * features[k].scale
}

fn slots(inputs: &Inputs, i: usize) -> Vec<usize> {
    (0..N_PATHS).filter(|slot| inputs.candidates[i][*slot].is_some()).collect()
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected}");
}

#[test]
fn on_one_straight_lane_there_are_the_lane_and_the_free_path() {
    let inputs = inputs(&[car(50.0, 0.4, 0.1, 10.0, 30, 0.1)], &straight_road(1));
    assert_eq!(slots(&inputs, 0), [0, FREE]);
    close(of_path(&inputs, 0, 0, "offset"), 0.4, 1e-5);
    close(of_path(&inputs, 0, 0, "heading_error"), 0.1, 1e-5);
    close(of_path(&inputs, 0, 0, "width"), 3.5, 1e-5);
    close(of_path(&inputs, 0, 0, "share"), 1.0, 1e-6);
    close(of_path(&inputs, 0, 0, "road_end"), 100.0, 1e-4);
    close(of_path(&inputs, 0, FREE, "offset"), 0.0, 0.0);
    let (ahead, heading) = inputs.candidates[0][0].as_ref().expect("the lane").world(30.0, -1.0);
    assert!(ahead.distance(Point::new(80.0, -1.0)) < 1e-9 && heading == 0.0, "{ahead:?}");
    let (ahead, _) = inputs.candidates[0][FREE].as_ref().expect("always").world(30.0, 0.0);
    assert!(ahead.distance(Point::new(50.0, 0.4) + Point::from_angle(0.1) * 30.0) < 1e-9);
}

#[test]
fn lanes_beside_are_paths_even_if_they_begin_ahead_and_oncoming_ones_are_not() {
    let inputs = |n, y| inputs(&[car(50.0, y, 0.0, 10.0, 30, 0.1)], &straight_road(n));
    assert_eq!(slots(&inputs(3, 3.5), 0), [0, LEFT, RIGHT, FREE]);
    assert_eq!(slots(&inputs(3, 0.0), 0), [0, LEFT, FREE]);
    close(of_path(&inputs(3, 3.5), 0, LEFT, "offset"), -3.5, 1e-5);
    close(of_path(&inputs(3, 3.5), 0, RIGHT, "offset"), 3.5, 1e-5);

    let beside = LaneletInput { adjacent_left: Some((3, true)), ..lane(2, &straight((50.0, 0.0), (150.0, 0.0))) };
    let road = open(vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]),
        beside,
        lane(3, &straight((50.0, 3.5), (150.0, 3.5))),
    ]);
    let at = |x| self::inputs(&[car(x, 0.0, 0.0, 10.0, 30, 0.1)], &road);
    assert_eq!(slots(&at(35.0), 0), [0, LEFT, FREE], "15 m ahead, 1.5 s");
    assert_eq!(slots(&at(20.0), 0), [0, FREE], "30 m ahead");
    close(of_path(&at(35.0), 0, LEFT, "offset"), -3.5, 1e-5);

    let mut both = parallel_lanes(1, 200.0);
    both.push(lane(2, &straight((200.0, 3.5), (0.0, 3.5))));
    assert_eq!(slots(&self::inputs(&[car(50.0, 0.0, 0.0, 10.0, 30, 0.1)], &open(both)), 0), [0, FREE]);
}

#[test]
fn every_branch_that_can_be_reached_is_a_path() {
    let inputs = |velocity| inputs(&[car(40.0 - velocity, 0.0, 0.0, velocity, 30, 0.1)], &fork());
    let near = inputs(0.0);
    assert_eq!(slots(&near, 0), [0, 1, FREE]);
    close(of_path(&near, 0, 0, "own_paths"), 2.0, 1e-5);
    close(of_path(&near, 0, 1, "share"), 0.5, 1e-6);
    let left = near.candidates[0][1].as_ref().expect("the branch");
    let (position, heading) = left.world(10.0 + 20.0 * FRAC_PI_2, 0.0);
    assert!(position.distance(Point::new(70.0, 20.0)) < 0.05, "{position:?}");
    close(heading, FRAC_PI_2, 0.05); // smoothed with what follows
    assert_eq!(slots(&inputs(10.0), 0), [0, 1, FREE], "20 m before the fork at 10 m/s");
    let slow = self::inputs(&[car(20.0, 0.0, 0.0, 4.0, 30, 0.1)], &fork());
    assert_eq!(slots(&slow, 0), [0, FREE], "15 m and 3.5 s at 4 m/s do not reach it from 30 m before");
}

#[test]
fn a_curve_is_told_by_its_curvature_and_the_speed_it_allows() {
    let road = open(vec![with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2]), {
        lane(2, &arc((50.0, 20.0), 20.0, -FRAC_PI_2, FRAC_PI_2))
    }]);
    let inputs = inputs(&[car(30.0, 0.0, 0.0, 10.0, 30, 0.1)], &road);
    close(of_path(&inputs, 0, 0, "curvature_10"), 0.0, 1e-4);
    close(of_path(&inputs, 0, 0, "curvature_40"), 0.05, 1e-3);
    close(of_path(&inputs, 0, 0, "curve_speed_40"), (3.0_f64 / 0.05).sqrt() - 10.0, 0.1);
    close(of_path(&inputs, 0, 0, "road_end"), 20.0 + 20.0 * PI, 0.1);
}

#[test]
fn who_is_off_the_road_or_on_rails_has_the_free_path_alone() {
    let off_road = inputs(&[car(50.0, 30.0, 0.0, 10.0, 30, 0.1)], &straight_road(2));
    assert_eq!(slots(&off_road, 0), [FREE]);
    let Track(_, states) = car(50.0, 0.0, 0.0, 10.0, 30, 0.1);
    assert_eq!(slots(&inputs(&[Track(ParticipantKind::Train, states)], &straight_road(2)), 0), [FREE]);
}

#[test]
fn leaders_and_followers_are_told_by_bumper_gaps_and_speeds() {
    let mut tracks = vec![car(50.0, 0.0, 0.0, 10.0, 30, 0.1)];
    // Listed out of order; the last one is in another lane.
    for (x, y, velocity) in [(95.0, 0.3, 6.0), (70.0, 0.2, 8.0), (30.0, 0.0, 13.0), (60.0, 3.5, 9.0)] {
        tracks.push(car(x, y, 0.0, velocity, 30, 0.1));
    }
    let inputs = inputs(&tracks, &straight_road(2));
    for (name, expected) in [
        ("leader_gap", 15.5),
        ("leader_velocity", 8.0),
        ("leader_relative_velocity", -2.0),
        ("leader_change", 0.0),
        ("leader_offset", 0.2),
        ("leader_length", 4.5),
        ("second_gap", 40.5),
        ("second_velocity", 6.0),
        ("follower_gap", 15.5),
        ("follower_relative_velocity", 3.0),
    ] {
        close(of_path(&inputs, 0, 0, name), expected, 1e-4);
    }
    close(of_path(&inputs, 0, LEFT, "leader_gap"), 5.5, 1e-4);
    close(of_path(&inputs, 0, LEFT, "has_follower"), 0.0, 0.0);
    let xs = [0, 1, 2, 3].map(|rank| of_neighbour(&inputs, 0, rank, "x"));
    assert_eq!(xs.map(|x| x.round() as i64), [10, -20, 20, 45], "nearest first");
    close(of_neighbour(&inputs, 0, 4, "is_present"), 0.0, 0.0);
}

#[test]
fn who_crosses_the_path_is_told_with_both_times() {
    let tracks = [car(50.0, 0.0, 0.0, 10.0, 30, 0.1), car(80.0, -12.0, FRAC_PI_2, 6.0, 30, 0.1)];
    let inputs = inputs(&tracks, &straight_road(1));
    for (name, expected) in [
        ("has_crossing", 1.0),
        ("crossing_distance", 30.0),
        ("crossing_time", 2.0),
        ("crossing_own_time", 3.0),
        ("crossing_speed", 6.0),
        ("crossing_cos", 0.0),
        ("crossing_sin", 1.0),
        ("has_leader", 0.0),
    ] {
        close(of_path(&inputs, 0, 0, name), expected, 1e-4);
    }
}

#[test]
fn the_past_is_told_against_constant_velocity() {
    // Braking with 2 m/s² from 14 to 10 m/s within 2 s.
    let states = (0..=30).map(|k| {
        let ago = f64::from(30 - k) * 0.1;
        let x = 50.0 - 10.0 * ago - ago * ago;
        Some(State { x, velocity: 10.0 + 2.0 * ago, ..State::default() })
    });
    let inputs = inputs(&[Track(ParticipantKind::Truck, states.collect())], &straight_road(1));
    close(of_agent(&inputs, 0, "past_x_2.0"), -4.0, 1e-4);
    close(of_agent(&inputs, 0, "past_velocity_1.0"), 2.0, 1e-4);
    close(of_agent(&inputs, 0, "acceleration_half_second"), -2.0, 1e-4);
    close(of_agent(&inputs, 0, "acceleration_second"), -2.0, 1e-4);
    close(of_agent(&inputs, 0, "seconds_known"), 2.0, 1e-6);
    close(of_agent(&inputs, 0, "is_truck"), 1.0, 0.0);
    close(of_agent(&inputs, 0, "is_car"), 0.0, 0.0);
}

#[test]
fn instants_do_not_depend_on_the_time_step() {
    let at = |dt: f64, steps: usize| {
        let states = (0..=steps).map(|k| {
            let ago = (steps - k) as f64 * dt;
            let orientation = 0.2 - 0.1 * ago;
            Some(State {
                x: 50.0 - 10.0 * ago - 0.5 * ago * ago,
                orientation,
                velocity: 10.0 + ago,
                ..State::default()
            })
        });
        Inputs::of(&scene(&[Track(ParticipantKind::Car, states.collect())], dt), &straight_road(1))
    };
    let expected = at(0.1, 30);
    for (dt, steps) in [(0.2, 15), (0.04, 70), (0.05, 60), (0.4, 8)] {
        for (k, (a, b)) in at(dt, steps).agent.iter().zip(&expected.agent).enumerate() {
            let name = &agent_features()[k].0;
            // Between steps of 0.4 s nothing is known of roughness.
            let b = if dt > 0.2 && name.starts_with("roughness") { 0.0 } else { *b };
            assert!((a - b).abs() < 5e-3, "dt {dt}: {name} is {a}, expected {b}");
        }
    }
}

#[test]
fn gaps_and_garbage_in_the_past_are_unknown_and_nothing_is_nan() {
    let Track(kind, mut states) = car(50.0, 0.0, 0.0, 10.0, 30, 0.1);
    states[30 - 4..30 - 1].fill(None); // absent 0.2 s to 0.4 s ago
    states[30 - 10] = Some(State { x: f64::NAN, ..State::default() });
    let gone = Track(kind, vec![None; 31]);
    let broken = Track(kind, vec![Some(State { velocity: f64::NAN, ..State::default() })]);
    let one_state = car(80.0, 0.0, 0.0, 12.0, 0, 0.1);
    let inputs = inputs(&[Track(kind, states), gone, broken, one_state], &straight_road(1));
    assert_eq!(inputs.rows, [0, 3], "absent participants and those with invalid states have no row");
    let known = |ago: &str| of_agent(&inputs, 0, &format!("past_known_{ago}"));
    assert_eq!(["0.2", "0.4", "0.6", "1.0", "1.2"].map(known), [0.0, 0.0, 1.0, 0.0, 1.0]);
    close(of_agent(&inputs, 0, "seconds_known"), 0.1, 1e-6);
    close(of_agent(&inputs, 1, "seconds_known"), 0.0, 0.0);
    assert!((1..=10).all(|k| of_agent(&inputs, 1, &format!("past_known_{:.1}", f64::from(k) * 0.2)) == 0.0));
    for values in [&inputs.agent, &inputs.neighbours, &inputs.paths] {
        assert!(values.iter().all(|value| value.is_finite() && value.abs() <= 10.0));
    }
}

#[test]
fn standing_is_seen_from_positions_and_from_speed_only_if_there_is_no_past() {
    let standing = |track: Track| inputs(&[track], &straight_road(1)).standing[0];
    assert!(standing(car(50.0, 0.0, 0.0, 0.0, 30, 0.1)));
    assert!(standing(car(50.0, 0.0, 0.0, 0.1, 0, 0.1)), "one state, 0.1 m/s");
    assert!(!standing(car(50.0, 0.0, 0.0, 1.0, 0, 0.1)), "one state, 1 m/s");
    assert!(!standing(car(50.0, 0.0, 0.0, 0.5, 30, 0.1)), "0.25 m in half a second");
    // It just stopped: 0.3 s ago it was half a metre away.
    let Track(kind, mut states) = car(50.0, 0.0, 0.0, 0.0, 30, 0.1);
    states[..28].iter_mut().flatten().for_each(|state| state.x -= 0.5);
    assert!(!standing(Track(kind, states)));
}

#[test]
fn only_wheeled_participants_that_do_not_reverse_have_a_row() {
    let at = |kind, velocity| Track(kind, car(50.0, 0.0, 0.0, velocity, 30, 0.1).1);
    let tracks = [
        at(ParticipantKind::Pedestrian, 1.0),
        at(ParticipantKind::ParkedVehicle, 0.0),
        at(ParticipantKind::Car, -2.0),
        at(ParticipantKind::Bicycle, 4.0),
        at(ParticipantKind::Unknown, 4.0),
    ];
    assert_eq!(inputs(&tracks, &straight_road(1)).rows, [3, 4]);
}

fn mirrored_point(point: Point) -> Point {
    Point::new(point.x, -point.y)
}

/// A world with a fork, lanes side by side and much traffic: lanelets, and states now of cars with a bent past.
fn busy_world() -> (Vec<LaneletInput>, Vec<Track>) {
    let mut lanelets = vec![
        with_successors(lane(1, &straight((0.0, 0.0), (50.0, 0.0))), &[2, 3]),
        lane(2, &straight((50.0, 0.0), (150.0, 0.0))),
        lane(3, &arc((50.0, 20.0), 20.0, -FRAC_PI_2, 0.0)),
        with_successors(lane(4, &straight((0.0, 3.5), (50.0, 3.5))), &[5]),
        lane(5, &straight((50.0, 3.5), (150.0, 3.5))),
        lane(6, &straight((90.0, -40.0), (90.0, 40.0))),
    ];
    lanelets[1].speed_limit = 13.9;
    let bent = |x: f64, y: f64, orientation: f64, velocity: f64| {
        let states = (0..=30).map(|k| {
            let ago = f64::from(30 - k) * 0.1;
            let axis = Point::from_angle(orientation - 0.03 * ago);
            let velocity = velocity * (1.0 + 0.1 * ago);
            let (x, y) = (x - axis.x * velocity * ago, y - axis.y * velocity * ago);
            Some(State { x, y, orientation: orientation - 0.05 * ago, velocity, ..State::default() })
        });
        Track(ParticipantKind::Car, states.collect())
    };
    let tracks = vec![
        bent(30.0, 0.3, 0.05, 9.0),
        bent(42.0, -0.2, 0.02, 7.0),
        bent(12.0, 3.2, -0.04, 12.0),
        bent(55.0, 3.9, 0.01, 6.0),
        bent(64.0, 5.9, 0.8, 5.0),
        bent(90.3, -22.0, 1.55, 8.0),
        bent(70.0, -30.0, 0.4, 8.0),
        Track(ParticipantKind::ParkedVehicle, car(75.0, -1.9, 0.1, 0.0, 30, 0.1).1),
    ];
    (lanelets, tracks)
}

fn moved(tracks: &[Track], change: impl Fn(&State) -> State) -> Vec<Track> {
    tracks
        .iter()
        .map(|Track(kind, states)| Track(*kind, states.iter().map(|s| s.as_ref().map(&change)).collect()))
        .collect()
}

#[test]
fn a_mirrored_world_has_mirrored_features() {
    let (lanelets, tracks) = busy_world();
    let mirrored_lanelets = lanelets.iter().map(|lanelet| LaneletInput {
        left: lanelet.right.iter().copied().map(mirrored_point).collect(),
        right: lanelet.left.iter().copied().map(mirrored_point).collect(),
        ..lanelet.clone()
    });
    let mirrored_tracks = moved(&tracks, |s| State { y: -s.y, orientation: -s.orientation, ..*s });
    let here = inputs(&tracks, &open(lanelets.clone()));
    let there = inputs(&mirrored_tracks, &open(mirrored_lanelets.collect()));
    let sign = |features: &[Feature]| features.iter().map(|f| f.mirror as f32).collect::<Vec<f32>>();
    let agent_sign: Vec<f32> = agent_features().iter().map(|(_, f)| f.mirror as f32).collect();
    let compare = |a: f32, b: f32, what: &str| assert!((a - b).abs() < 1e-4, "{what}: {a}, mirrored {b}");
    let mut n_lanes = 0;
    for i in 0..here.rows.len() {
        for (k, sign) in agent_sign.iter().enumerate() {
            let at = i * N_AGENT + k;
            compare(here.agent[at] * sign, there.agent[at], &agent_features()[k].0);
        }
        for k in 0..N_NEIGHBOURS * N_NEIGHBOUR {
            let (at, k) = (i * N_NEIGHBOURS * N_NEIGHBOUR + k, k % N_NEIGHBOUR);
            let sign = sign(neighbour_features())[k];
            compare(here.neighbours[at] * sign, there.neighbours[at], neighbour_features()[k].name);
        }
        for slot in 0..N_PATHS {
            let other = if slot == LEFT {
                RIGHT
            } else if slot == RIGHT {
                LEFT
            } else {
                slot
            };
            n_lanes += usize::from(slot < FREE && here.candidates[i][slot].is_some());
            for k in 0..N_PATH {
                let (a, b) = MIRRORED_COLUMNS;
                let column = if k == a {
                    b
                } else if k == b {
                    a
                } else {
                    k
                };
                let value = here.paths[(i * N_PATHS + slot) * N_PATH + k] * sign(path_features())[k];
                compare(value, there.paths[(i * N_PATHS + other) * N_PATH + column], path_features()[k].name);
            }
        }
    }
    assert!(n_lanes >= here.rows.len() + 4, "the world has forks and neighbours: {n_lanes} paths");
}

#[test]
fn features_do_not_depend_on_where_the_world_lies_and_how_it_is_turned() {
    let (lanelets, tracks) = busy_world();
    let frame = Pose::new(5300.0, -2100.0, 2.5);
    let turned_lanelets = lanelets.iter().map(|lanelet| LaneletInput {
        left: lanelet.left.iter().map(|point| frame.world_from_body(*point)).collect(),
        right: lanelet.right.iter().map(|point| frame.world_from_body(*point)).collect(),
        ..lanelet.clone()
    });
    let turned_tracks = moved(&tracks, |s| {
        let position = frame.world_from_body(s.pose().position);
        State { x: position.x, y: position.y, orientation: s.orientation + frame.orientation, ..*s }
    });
    let here = inputs(&tracks, &open(lanelets.clone()));
    let there = inputs(&turned_tracks, &open(turned_lanelets.collect()));
    for (a, b) in [(&here.agent, &there.agent), (&here.neighbours, &there.neighbours), (&here.paths, &there.paths)] {
        assert_eq!(a.len(), b.len());
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4));
    }
}

#[test]
fn rows_do_not_depend_on_each_other() {
    let (lanelets, tracks) = busy_world();
    let (road, scene) = (open(lanelets), scene(&tracks, 0.1));
    let all = Inputs::of(&scene, &road);
    let surroundings = super::surroundings::Surroundings::of(&scene);
    // In memory that has held others before.
    let (mut alone, mut memory) = (Inputs::default(), Memory::default());
    for (i, row) in all.rows.iter().enumerate() {
        alone.become_of([*row].into_iter(), (&scene, &road), &surroundings, &mut memory);
        assert_eq!(alone.agent, all.agent[i * N_AGENT..(i + 1) * N_AGENT]);
        assert_eq!(alone.paths, all.paths[i * N_PATHS * N_PATH..(i + 1) * N_PATHS * N_PATH]);
    }
}

#[test]
fn targets_are_the_path_coordinates_of_the_future_and_lead_back_to_it() {
    let inputs = inputs(&[car(40.0, 0.0, 0.0, 10.0, 30, 0.1)], &fork());
    let branch = inputs.candidates[0][1].as_ref().expect("the branch to the left");
    let mut future = [1, 2, 3, 4, 5, 6].map(|k| branch.world(5.0 * f64::from(k), 0.1 * f64::from(k)).0);
    future[4] = Point::new(f64::NAN, 0.0);
    let targets = inputs.targets(0, &future);
    for (k, (s, d)) in targets[1].iter().enumerate() {
        if k == 4 {
            assert!(s.is_nan() && d.is_nan());
            continue;
        }
        close(*s, 5.0 * (k + 1) as f64, 1e-4);
        close(*d, 0.1 * (k + 1) as f64, 1e-4);
    }
    // On the lane that goes straight on the same future lies farther and farther to the left.
    assert!(targets[0][5].1 > 5.0, "{:?}", targets[0][5]);
    assert!(targets[N_OWN - 1].iter().all(|(s, d)| s.is_nan() && d.is_nan()), "an empty slot");
    let far = inputs.targets(0, &[Point::new(60.0, 25.0); 6]);
    assert!(far[0].iter().all(|(s, _)| s.is_nan()), "25 m beside the path");
}

#[test]
fn an_offset_is_given_up_by_driving_not_by_standing() {
    let inputs = inputs(&[car(40.0, 1.0, 0.1, 10.0, 30, 0.1)], &straight_road(1));
    let settling = inputs.settling(0, 0).expect("the lane");
    assert_eq!(settling.length, 40.0);
    close(settling.at(0.0).0, 1.0, 1e-9);
    close(settling.at(0.0).1, 0.1_f64.tan(), 1e-9);
    let (offset, slope) = settling.at(40.0);
    assert!(offset == 0.0 && slope == 0.0);
    let (before, after) = (settling.at(11.999).0, settling.at(12.001).0);
    close(settling.at(12.0).1, (after - before) / 0.002, 1e-6);
}
