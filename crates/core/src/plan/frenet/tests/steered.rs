//! Steered samples: within the limits of the vehicle, and chosen where a quintic turns the wheels too fast.

use std::f64::consts::FRAC_PI_2;

use super::Drive;
use crate::geometry::shape::Lcg;
use crate::plan::frame::Start;
use crate::plan::frenet::feasibility::{Limits, Rejection};
use crate::plan::frenet::targets::Targets;
use crate::plan::frenet::whole::Whole;
use crate::plan::frenet::{Assumptions, FrenetMemory, FrenetSettings, Incumbent, attempt, end_velocity, plan, steered};
use crate::road::testing::{arc, lane, open, straight};
use crate::trajectory::PlanStatus;

/// An agent before or in a bend of 6 to 12 m radius, beside its path and askew, with its wheels turned.
fn askew(random: &mut Lcg) -> Drive {
    let radius = random.within(6.0, 12.0);
    let mut center = straight((0.0, 0.0), (30.0, 0.0));
    center.extend(arc((30.0, radius), radius, -FRAC_PI_2, 0.0).into_iter().skip(1));
    center.extend(straight((30.0 + radius, radius), (30.0 + radius, radius + 40.0)).into_iter().skip(1));
    let mut drive =
        Drive::on(open(vec![lane(1, &center)]), &center, random.within(20.0, 40.0), random.within(0.0, 6.0));
    drive.entry_velocity = 6.0;
    drive.state.y += random.within(-0.5, 0.5);
    drive.state.orientation += random.within(-0.2, 0.2);
    drive.state.yaw_rate = drive.state.velocity * random.within(-0.1, 0.1);
    drive
}

#[test]
fn steered_samples_begin_with_the_present_speed_and_keep_the_limits_of_steering() {
    let mut random = Lcg::new(17);
    let settings = FrenetSettings::default();
    let mut n = 0;
    for world in 0..60 {
        askew(&mut random).with_request(|request| {
            let mut memory = FrenetMemory::default();
            attempt(request, &settings, &mut memory, Assumptions::NOMINAL);
            let start = Start::new(request, true).expect("beside its path");
            let limits = Limits::new(request, 31, start.curvature, 1.0);
            let targets = Targets::new(request, &start, &settings);
            let FrenetMemory { wholes, obstacles, samples, .. } = &mut memory;
            let state = (&start, &targets, &limits);
            steered::steer_all((wholes, obstacles), request, state, samples, &settings.weights, Incumbent::NONE);
            for whole in wholes.iter() {
                let first = whole.points[0].velocity;
                assert!((first - request.state.velocity).abs() < 1e-9, "{world}: {first} m/s");
                for (i, pair) in whole.points.windows(2).enumerate() {
                    let found = limits.check(&pair[0], &pair[1], i + 1);
                    let turns_too_much =
                        [Rejection::Curvature, Rejection::SteeringRate, Rejection::YawRate].contains(&found);
                    assert!(!turns_too_much, "{world} {i}: {found:?}");
                    let mean = (pair[1].velocity - pair[0].velocity) / limits.dt;
                    let stated = [pair[0].acceleration, pair[1].acceleration];
                    let is_between = mean > stated[0].min(stated[1]) - 0.3 && mean < stated[0].max(stated[1]) + 0.3;
                    assert!(
                        is_between || pair[1].velocity == 0.0,
                        "{world} {i}: {mean} m/s² where {stated:?} are stated"
                    );
                }
                n += 1;
            }
        });
    }
    assert!(n > 600, "{n}");
}

#[test]
fn where_samples_of_the_grid_turn_the_wheels_too_fast_a_steered_one_goes_on() {
    let mut random = Lcg::new(5);
    let settings = FrenetSettings::default();
    let (mut memory, mut n_faster, mut n_rescued) = (FrenetMemory::default(), 0, 0);
    for world in 0..100 {
        askew(&mut random).with_request(|request| {
            let grid = attempt(request, &settings, &mut memory, Assumptions::NOMINAL);
            let best = plan(request, &settings, &mut memory);
            if grid.status == PlanStatus::Planned {
                assert!(best.cost <= grid.cost && end_velocity(&best) >= end_velocity(&grid), "world {world}");
                n_faster += usize::from(end_velocity(&best) > end_velocity(&grid) + 0.5);
            } else {
                n_rescued += usize::from(best.status == PlanStatus::Planned);
            }
        });
    }
    assert!(n_faster > 10 && n_rescued > 5, "{n_faster}, {n_rescued}");
}

#[test]
fn only_samples_that_are_cheaper_and_clearly_faster_are_missed() {
    let incumbent = Incumbent { cost: 10.0, velocity: 3.0, distance: 9.0 };
    for (cost, velocity, expected) in [(9.0, 4.5, true), (11.0, 4.5, false), (9.0, 3.5, false)] {
        assert_eq!(incumbent.is_held_by_limits(&[(cost, velocity)]), expected, "{cost} {velocity}");
    }
    assert!(Incumbent::NONE.is_held_by_limits(&[(50.0, 0.0)]), "any is better than no plan");
}

#[test]
fn the_driver_that_aims_inside_goes_through_a_bend_further_inside_than_the_other() {
    further_inside(1.0);
    further_inside(-1.0);
}

/// In a bend to the left or, mirrored, to the right.
fn further_inside(side: f64) {
    let settings = FrenetSettings::default();
    let radius = 6.0;
    let mut center = straight((0.0, 0.0), (30.0, 0.0));
    center.extend(arc((30.0, radius), radius, -FRAC_PI_2, 0.0).into_iter().skip(1));
    center.extend(straight((30.0 + radius, radius), (30.0 + radius, radius + 40.0)).into_iter().skip(1));
    center.iter_mut().for_each(|point| point.y *= side);
    // 3 m before the bend.
    let mut drive = Drive::on(open(vec![lane(1, &center)]), &center, 27.0, 5.0);
    drive.entry_velocity = 5.0;
    drive.with_request(|request| {
        let mut memory = FrenetMemory::default();
        attempt(request, &settings, &mut memory, Assumptions::NOMINAL);
        let start = Start::new(request, true).expect("on its path");
        let limits = Limits::new(request, 31, start.curvature, 1.0);
        let targets = Targets::new(request, &start, &settings);
        let FrenetMemory { wholes, obstacles, samples, .. } = &mut memory;
        let state = (&start, &targets, &limits);
        steered::steer_all((wholes, obstacles), request, state, samples, &settings.weights, Incumbent::NONE);
        let wholes: Vec<_> = wholes.iter().collect();
        let mut n = 0;
        // Each speed has two drivers, this one is the second; those that leave the path are missing.
        let speeds = |whole: &Whole| whole.points.iter().map(|point| point.velocity).collect::<Vec<_>>();
        let innermost =
            |whole: &Whole| whole.points.iter().map(|point| side * point.d).fold(f64::NEG_INFINITY, f64::max);
        for pair in wholes.windows(2).filter(|pair| speeds(pair[0]) == speeds(pair[1])) {
            if pair[0].points.iter().any(|point| side * point.curvature > 0.1) {
                let [other, inside] = [innermost(pair[0]), innermost(pair[1])];
                assert!(inside > other, "{other} and {inside} m");
                n += usize::from(inside > other + 0.1);
            }
        }
        assert!(n > 12, "{n}");
    });
}
