//! Which sample is chosen, and that laziness does not change it.

use super::{Car, Drive};
use crate::geometry::shape::{Lcg, Shape};
use crate::geometry::{Point, Pose};
use crate::plan::frenet::search::{Evaluation, EvaluationMemory};
use crate::plan::frenet::{CostWeights, FrenetMemory, FrenetSettings, Problem, Rejection, candidates, plan};
use crate::plan::{self, IdmSettings, PlanRequest, Planner, PredictionIndex, Prepared};
use crate::road::testing::{arc, lane, open};
use crate::trajectory::{PlanStatus, Predictions};

fn eager() -> FrenetSettings {
    FrenetSettings { lazy: false, ..FrenetSettings::default() }
}

/// A footprint, often not around its position; what stands may have two parts.
fn shape(moving: bool, random: &mut Lcg) -> Shape {
    let (length, width) = (random.within(1.0, 9.0), random.within(0.6, 2.4));
    if random.within(0.0, 1.0) < 0.6 {
        return Shape::rectangle(length, width);
    }
    let shifted =
        Shape::rectangle_at(length, width, Point::new(random.within(-1.5, 1.5), random.within(-0.3, 0.3)), 0.0);
    if moving {
        shifted
    } else {
        Shape::group(vec![shifted, Shape::rectangle_at(1.0, 1.0, Point::new(0.0, -1.5), 0.5)])
    }
}

/// A three-lane road, straight or bent, with up to six cars around the agent.
pub(in crate::plan::frenet) fn random_drive(random: &mut Lcg) -> Drive {
    let bend = random.within(0.0, 1.0);
    let velocity = if random.within(0.0, 1.0) < 0.25 { random.within(0.0, 3.0) } else { random.within(3.0, 25.0) };
    let radius = random.within(40.0, 300.0);
    let mut drive = if bend < 0.5 {
        Drive::on_three_lanes(100.0, velocity)
    } else {
        let lanes = [radius + 3.5, radius, radius - 3.5].map(|r| arc((0.0, 0.0), r, 0.0, 280.0 / radius));
        let inputs = lanes.iter().enumerate().map(|(i, points)| lane(i as i64 + 1, points)).collect();
        Drive::on(open(inputs), &lanes[1], 100.0, velocity)
    };
    drive.state.orientation += random.within(-0.04, 0.04);
    drive.state.acceleration = random.within(-1.5, 1.5);
    drive.state.yaw_rate += random.within(-0.03, 0.03);
    let side = Point::from_angle(drive.state.orientation).left() * random.within(-1.0, 1.0);
    (drive.state.x, drive.state.y) = (drive.state.x + side.x, drive.state.y + side.y);
    for _ in 0..random.within(0.0, 6.99) as usize {
        let at = drive.route.path.at(100.0 + random.within(-20.0, 60.0));
        let position = at.offset(random.within(-4.5, 4.5));
        let orientation = at.theta + random.within(-0.2, 0.2);
        let moving = random.within(0.0, 1.0) < 0.7;
        let car = Car {
            pose: Pose { position, orientation },
            velocity: if moving { random.within(0.5, 20.0) } else { 0.0 },
            shape: shape(moving, random),
            is_static: !moving,
            sigma: (random.within(0.1, 1.5), random.within(0.1, 0.8)),
        };
        if (position - drive.state.pose().position).norm() > 7.0 {
            drive.cars.push(car);
        }
    }
    if random.within(0.0, 1.0) < 0.5 {
        let result = drive.plan(&FrenetSettings::default());
        drive.step(result);
    }
    drive
}

#[test]
fn lazy_planning_chooses_exactly_what_full_evaluation_chooses() {
    let mut random = Lcg::new(11);
    let (mut memory, mut n_planned) = (FrenetMemory::default(), 0);
    for world in 0..150 {
        let drive = random_drive(&mut random);
        let weights = if world % 10 == 0 {
            CostWeights {
                acceleration: 0.1,
                jerk: 0.01,
                orientation_offset: 1.0,
                distance_to_obstacles: 5.0,
                ..CostWeights::default()
            }
        } else {
            CostWeights::default()
        };
        let lazy = FrenetSettings { weights, ..FrenetSettings::default() };
        let full = FrenetSettings { weights, ..eager() };
        let (a, b) = (drive.with_request(|r| plan(r, &lazy, &mut memory)), drive.plan(&full));
        assert_eq!(
            (a.status, &a.trajectory, a.cost.to_bits()),
            (b.status, &b.trajectory, b.cost.to_bits()),
            "world {world}"
        );
        n_planned += usize::from(a.status == PlanStatus::Planned);
    }
    assert!(n_planned > 100, "{n_planned}");
}

#[test]
fn candidates_show_the_choice_of_the_plan() {
    let mut random = Lcg::new(5);
    for _ in 0..20 {
        let drive = random_drive(&mut random);
        let settings = FrenetSettings::default();
        let (result, all) = (drive.plan(&settings), drive.candidates(&settings));
        assert_eq!(result.status == PlanStatus::Planned, all.chosen.is_some());
        let Some(chosen) = all.chosen else { continue };
        assert_eq!(all.rejection[chosen], Rejection::Admissible);
        assert!((all.cost[chosen] - result.cost).abs() < 1e-9 * result.cost, "{} {}", all.cost[chosen], result.cost);
        for (i, point) in result.trajectory.points.iter().enumerate().skip(1) {
            assert_eq!((all.x[chosen * 31 + i], all.y[chosen * 31 + i]), (point.x, point.y));
        }
        assert!(all.terms.len() == all.len() * 13 && all.x.len() == all.len() * 31);
    }
}

#[test]
fn the_grid_has_eight_hundred_samples_at_the_default_level() {
    let mut drive = Drive::on_three_lanes(100.0, 10.3);
    drive.state.y = 0.2;
    for (level, n) in [(0, 48), (1, 180), (2, 800), (3, 3564)] {
        let settings = FrenetSettings { level, stop_targets: false, ..FrenetSettings::default() };
        let all = drive.candidates(&settings);
        let braking = 2 * ((2 << level) + 2);
        assert_eq!(all.len() - braking, n, "level {level}");
    }
}

#[test]
fn every_end_time_reaches_its_end_position() {
    let all = Drive::on_three_lanes(100.0, 10.0).candidates(&FrenetSettings::default());
    for (i, rejection) in all.rejection.iter().enumerate() {
        if *rejection == Rejection::Admissible && all.end_velocity[i] > 2.0 && all.end_time[i] <= 3.0 {
            let k = i * 31 + (all.end_time[i] / 0.1).round() as usize;
            assert!((all.y[k] - all.end_offset[i]).abs() < 1e-9, "{i}: {} {}", all.y[k], all.end_offset[i]);
        }
    }
}

#[test]
fn a_mirrored_world_gives_the_mirrored_plan() {
    let mut random = Lcg::new(23);
    for world in 0..30 {
        let mut drive = Drive::on_three_lanes(100.0, random.within(4.0, 18.0));
        drive.state.y = random.within(-0.8, 0.8);
        drive.state.orientation = random.within(-0.03, 0.03);
        drive.cars = (0..3)
            .map(|_| {
                Car::at(
                    random.within(85.0, 140.0),
                    random.within(-4.0, 4.0),
                    random.within(-0.1, 0.1),
                    random.within(1.0, 9.0),
                )
            })
            .filter(|car| (car.pose.position.x - drive.state.x).abs() > 6.0)
            .collect();
        let mut mirrored = drive.clone();
        (mirrored.state.y, mirrored.state.orientation) = (-drive.state.y, -drive.state.orientation);
        for car in &mut mirrored.cars {
            car.pose = Pose::new(car.pose.position.x, -car.pose.position.y, -car.pose.orientation);
        }
        let (a, b) = (drive.plan(&FrenetSettings::default()), mirrored.plan(&FrenetSettings::default()));
        assert_eq!(a.status, b.status, "world {world}");
        for (p, q) in a.trajectory.points.iter().zip(&b.trajectory.points) {
            let difference = [p.x - q.x, p.y + q.y, p.orientation + q.orientation, p.velocity - q.velocity];
            assert!(difference.iter().all(|d| d.abs() < 1e-6), "world {world}: {p:?} {q:?}");
        }
    }
}

#[test]
fn costs_from_the_tables_are_those_of_the_trajectories() {
    let (mut random, mut memory, mut n_samples) = (Lcg::new(2), EvaluationMemory::default(), 0);
    let settings = FrenetSettings::default();
    for _ in 0..10 {
        random_drive(&mut random).with_request(|request| {
            let Ok(problem) = Problem::new(request, &settings) else { return };
            let mut evaluation = Evaluation::new(&problem, &mut memory);
            for sample in (0..evaluation.samples().len()).step_by(17) {
                if evaluation.write(sample) != Rejection::Admissible {
                    continue;
                }
                let [speeds, offsets, ..] = evaluation.terms(sample);
                let (points, targets) = (evaluation.points(), &problem.targets);
                let speed = points.iter().map(|p| (p.velocity - targets.velocity).powi(2)).sum::<f64>().sqrt();
                let offset = points[16..].iter().map(|p| (p.d - targets.offset).powi(2)).sum::<f64>().sqrt();
                assert!((speeds - speed).abs() < 1e-9 && (offsets - offset).abs() < 1e-9, "{speed} {offset}");
                n_samples += 1;
            }
        });
    }
    assert!(n_samples > 100, "{n_samples}");
}

#[test]
fn other_horizons_and_shorter_or_older_predictions_give_the_full_choice_in_reused_memory() {
    let mut random = Lcg::new(21);
    let (mut memory, mut n_planned) = (FrenetMemory::default(), 0);
    for world in 0..80 {
        let mut drive = random_drive(&mut random);
        drive.dt = [0.04, 0.1, 0.2][world % 3];
        drive.n_predicted = random.within(0.0, 60.0) as usize;
        drive.prediction_age = random.within(0.0, 5.0) as i64;
        let horizon = random.within(1.5, 7.0);
        let level = random.within(0.0, 2.99) as usize;
        let lazy = FrenetSettings { horizon, level, ..FrenetSettings::default() };
        let full = FrenetSettings { lazy: false, ..lazy };
        let (a, b) = (drive.with_request(|request| plan(request, &lazy, &mut memory)), drive.plan(&full));
        assert_eq!((a.status, &a.trajectory), (b.status, &b.trajectory), "world {world}");
        n_planned += usize::from(a.status == PlanStatus::Planned);
    }
    assert!(n_planned > 50, "{n_planned}");
}

#[test]
fn an_improbable_mode_that_is_nowhere_dense_costs_nothing() {
    let beside = Car { sigma: (1.0, 1.0), ..Car::at(30.0, 2.6, 0.0, 10.0) };
    let drive = Drive::on_three_lanes(20.0, 10.0).with_cars(vec![beside]);
    // The other mode is far away.
    let cost = |probability: f64, least: f64| {
        let settings = FrenetSettings { expectation_density_min: least, ..eager() };
        let terms = drive.with_request(|request| {
            let one = request.predictions;
            let mut two = Predictions::empty(one.time_step, one.ids.clone(), 2, one.n_steps);
            (two.probability[0], two.probability[1]) = (1.0 - probability, probability);
            for mode in 0..2 {
                for k in 0..one.n_steps {
                    let to = two.offset(0, mode) + k;
                    (two.x[to], two.y[to]) = (one.x[k], one.y[k] + if mode == 0 { 500.0 } else { 0.0 });
                    (two.covariance_xx[to], two.covariance_yy[to]) = (one.covariance_xx[k], one.covariance_yy[k]);
                    (two.covariance_xy[to], two.valid[to]) = (one.covariance_xy[k], true);
                    (two.orientation[to], two.velocity[to]) = (one.orientation[k], one.velocity[k]);
                }
            }
            candidates(
                &PlanRequest {
                    predictions: &two,
                    prediction_index: &PredictionIndex::of(&two, &drive.positions()),
                    ..*request
                },
                &settings,
            )
            .terms
        });
        // Samples that are not admissible have none.
        terms.chunks_exact(13).map(|terms| terms[12]).filter(|term| term.is_finite()).sum::<f64>()
    };
    // The variance is 0.1 m² after the first step and 3 m² after the last: at a probability of 0.1 the density is 0.16
    // and 0.0053 per m².
    let whole = cost(0.1, 0.0);
    assert!(whole > 0.0 && cost(0.1, 0.005) == whole, "{whole}");
    assert!(0.0 < cost(0.1, 0.01) && cost(0.1, 0.01) < whole, "{} {whole}", cost(0.1, 0.01));
    assert!(cost(0.1, 0.17) == 0.0);
    // Modes that are probable enough to rule samples out count everywhere.
    assert!(cost(0.3, 0.17) == cost(0.3, 0.0) && cost(0.3, 0.0) > 0.0);
}

#[test]
fn effort_is_that_of_the_last_plan_and_of_no_other() {
    let drive = Drive::on_three_lanes(100.0, 15.0);
    let mut memory = FrenetMemory::default();
    let mut effort = || {
        drive.with_request(|request| plan(request, &FrenetSettings::default(), &mut memory));
        memory.effort()
    };
    let first = effort();
    assert!(first > 0 && effort() == first);
    let mut all_planners = plan::PlanningMemory { frenet: memory, effort: first, ..plan::PlanningMemory::default() };
    let idm = Planner::Idm(IdmSettings::default());
    drive.with_request(|request| plan::plan(&idm, &Prepared::Nothing, request, &mut all_planners));
    assert_eq!(all_planners.effort(), 0);
    let frenet = Planner::Frenet(Box::default());
    drive.with_request(|request| plan::plan(&frenet, &Prepared::Nothing, request, &mut all_planners));
    assert_eq!(all_planners.effort(), first);
}
