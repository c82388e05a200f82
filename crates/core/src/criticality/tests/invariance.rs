//! What must not change the values: where the world lies, how it is turned, the order of participants, the threads; and
//! what they converge to.

use super::*;
use crate::geometry::shape::Lcg;
use crate::road::LaneletInput;
use crate::road::testing::lane;

/// A way to move the world.
type Motion = fn(Point) -> Point;

fn moved_state(state: &State, motion: Motion) -> State {
    let (from, to) = (motion(Point::default()), motion(Point::from_angle(state.orientation)));
    let position = motion(Point::new(state.x, state.y));
    State { x: position.x, y: position.y, orientation: (to - from).angle(), ..*state }
}

fn moved_lane(input: &LaneletInput, motion: Motion, mirrored: bool) -> LaneletInput {
    let moved = |bound: &[Point]| bound.iter().map(|point| motion(*point)).collect();
    let (left, right) = (moved(&input.left), moved(&input.right));
    let (left, right) = if mirrored { (right, left) } else { (left, right) };
    LaneletInput { left, right, ..input.clone() }
}

/// A road along x that bends away in two branches, and one across it.
fn lanes() -> Vec<LaneletInput> {
    let bend = |side: f64| -> Vec<Point> {
        (0..=30).map(|i| Point::new(50.0 + f64::from(i), side * 0.004 * f64::from(i * i))).collect()
    };
    vec![
        with_successors(lane(1, &straight((-60.0, 0.0), (50.0, 0.0))), &[2, 3]),
        lane(2, &bend(1.0)),
        lane(3, &bend(-1.0)),
        with_successors(lane(4, &straight((20.0, -60.0), (20.0, -8.0))), &[5]),
        with_successors(lane(5, &straight((20.0, -8.0), (20.0, 8.0))), &[6]),
        lane(6, &straight((20.0, 8.0), (20.0, 60.0))),
    ]
}

fn actors(seed: u64) -> Vec<Actor> {
    let mut random = Lcg::new(seed);
    (0..8)
        .map(|i| {
            let across = i % 3 == 0;
            let along = random.within(-50.0, 15.0);
            let beside = random.within(-1.2, 1.2);
            let turn = random.within(-0.15, 0.15);
            let speed = random.within(3.0, 14.0);
            let mut start = if across {
                state(20.0 + beside, along, std::f64::consts::FRAC_PI_2 + turn, speed)
            } else {
                state(along, beside, turn, speed)
            };
            start.acceleration = random.within(-2.0, 1.0);
            Actor::going(i + 1, start, 30)
        })
        .collect()
}

fn evaluated(lanes: Vec<LaneletInput>, actors: &[Actor], threads: usize) -> Criticality {
    let mut wanted = request(&actors.iter().map(|actor| actor.id).collect::<Vec<_>>());
    wanted.conflict_areas = ConflictAreas::Crossing;
    wanted.threads = threads;
    evaluate(&traffic(open(lanes), actors), &wanted).expect("valid")
}

#[track_caller]
fn same_values(a: &Criticality, b: &Criticality, tolerance: f64) {
    let mut finite = 0;
    for (first, second) in a.series.iter().zip(&b.series) {
        for (x, y) in first.value.iter().zip(&second.value) {
            near(*x, *y, tolerance * x.abs().max(1.0));
            finite += usize::from(x.is_finite() && *x != 0.0);
        }
        assert_eq!(first.partner, second.partner);
    }
    assert!(finite > 300, "{finite}");
}

#[test]
fn values_do_not_change_when_the_world_is_turned_shifted_or_mirrored() {
    let turned: Motion = |p| Point::new(0.6 * p.x - 0.8 * p.y, 0.8 * p.x + 0.6 * p.y);
    let shifted: Motion = |p| Point::new(p.x + 310.0, p.y - 270.0);
    let far: Motion = |p| Point::new(p.x + 691_234.5, p.y + 5_330_123.25);
    let mirror: Motion = |p| Point::new(p.x, -p.y);
    for seed in 0..12 {
        let actors = actors(seed);
        let here = evaluated(lanes(), &actors, 1);
        for (motion, mirrored, tolerance) in
            [(turned, false, 1e-8), (shifted, false, 1e-9), (far, false, 1e-5), (mirror, true, 1e-9)]
        {
            let there: Vec<LaneletInput> = lanes().iter().map(|lane| moved_lane(lane, motion, mirrored)).collect();
            let moved: Vec<Actor> = actors
                .iter()
                .map(|actor| Actor {
                    states: actor.states.iter().map(|s| s.as_ref().map(|s| moved_state(s, motion))).collect(),
                    ..actor.clone()
                })
                .collect();
            same_values(&here, &evaluated(there, &moved, 1), tolerance);
        }
    }
}

#[test]
fn values_belong_to_vehicles_and_not_to_their_ids() {
    let actors = actors(3);
    let here = evaluated(lanes(), &actors, 1);
    let mut renamed: Vec<Actor> = actors.iter().map(|actor| Actor { id: 100 - actor.id, ..actor.clone() }).collect();
    renamed.reverse();
    let there = evaluated(lanes(), &renamed, 1);
    for measure in 0..Measure::ALL.len() {
        for row in 0..8 {
            for column in 0..30 {
                let (a, b) = (row * 30 + column, (7 - row) * 30 + column);
                near(here.series[measure].value[a], there.series[measure].value[b], 1e-12);
            }
        }
    }
}

#[test]
fn pairs_agree_about_distance_and_post_encroachment() {
    // Which paths meet depends on the judged vehicle.
    let mut wanted = request(&[1, 2]);
    wanted.settings.oncoming_filter = false;
    wanted.conflict_areas = ConflictAreas::Crossing;
    for seed in 0..20 {
        let found = evaluate(&traffic(open(lanes()), &actors(seed)[..2]), &wanted).expect("valid");
        for measure in [Measure::Dce, Measure::Ttce, Measure::Pet] {
            let values = &found.series[measure as usize].value;
            for column in 0..30 {
                near(values[column], values[30 + column], 1e-9);
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let actors = actors(5);
    let one = evaluated(lanes(), &actors, 1);
    for threads in [2, 5] {
        let more = evaluated(lanes(), &actors, threads);
        for (a, b) in one.series.iter().zip(&more.series) {
            assert!(a.value.iter().zip(&b.value).all(|(x, y)| x.to_bits() == y.to_bits()));
            assert_eq!((&a.partner, &a.way), (&b.partner, &b.way));
        }
        assert_eq!(one.ways, more.ways);
    }
}

#[test]
fn finer_time_steps_converge() {
    let measured = |dt: f64| {
        let n = (9.0 / dt).round() as usize;
        let car = |id: i64, x: f64, y: f64, heading: f64| {
            let way = Point::from_angle(heading);
            Actor::car(
                id,
                (0..n).map(move |k| {
                    let s = 10.0 * dt * k as f64;
                    state(x + s * way.x, y + s * way.y, heading, 10.0)
                }),
            )
        };
        let (road, connectors) = right_angles();
        let mut scene = traffic(road, &[car(1, -34.55, 0.0, 0.0), car(2, 0.0, -62.31, std::f64::consts::FRAC_PI_2)]);
        scene.dt = dt;
        let mut wanted = request(&[1]);
        wanted.conflict_areas = ConflictAreas::Stated(connectors);
        let found = evaluate(&scene, &wanted).expect("valid");
        [Measure::Dce, Measure::Et, Measure::Pet].map(|measure| extreme(&found, measure))
    };
    // Continuous: ET (4 + 5) / 10; PET: the second one is 27.76 m later and the first one takes 9 m. The distance is
    // smallest when both are equally far from the crossing point, up to their length and width.
    let exact = measured(0.0005);
    near(exact[1], 0.9, 6e-4);
    near(exact[2], 2.776 - 0.9, 2e-3);
    for (dt, bound) in [(0.1, 0.1), (0.05, 0.05), (0.01, 0.01)] {
        for (coarse, fine) in measured(dt).iter().zip(exact) {
            near(*coarse, fine, 1.5 * bound);
        }
    }
}
