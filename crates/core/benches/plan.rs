//! One plan of the Frenet planner on a three-lane road: 800 samples and more, one thread.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use interdrive_core::geometry::shape::Shape;
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::plan::frenet::{FrenetMemory, FrenetSettings, plan};
use interdrive_core::plan::{LaneChange, Other, PlanRequest, PredictionIndex};
use interdrive_core::road::{LaneletInput, RoadNetwork, RoadSettings};
use interdrive_core::route::{Route, RouteSettings, find_route};
use interdrive_core::rules::{Indicator, Rules};
use interdrive_core::scenario::{Goal, GoalState};
use interdrive_core::trajectory::{Predictions, State};
use interdrive_core::vehicle::{ParticipantKind, Vehicle};

/// Three lanes of 3.5 m along a bend of 400 m radius; the middle one has id 2.
fn road() -> RoadNetwork {
    let lane = |id: i64, radius: f64| {
        let along = |r: f64| (0..=200).map(|i| Point::from_angle(f64::from(i) * 0.005) * r).collect::<Vec<_>>();
        LaneletInput::between(id, along(radius - 1.75), along(radius + 1.75))
    };
    RoadNetwork::new(vec![lane(1, 403.5), lane(2, 400.0), lane(3, 396.5)], RoadSettings::default()).expect("a road")
}

/// A car: metres ahead of the agent, metres to the left, speed.
type Place = (f64, f64, f64);

struct Bench {
    road: RoadNetwork,
    route: Route,
    state: State,
    goal: Goal,
    poses: Vec<(Pose, f64)>,
    predictions: Predictions,
    prediction_index: PredictionIndex,
    shape: Shape,
}

impl Bench {
    fn new(velocity: f64, cars: &[Place]) -> Self {
        let road = road();
        let start = Pose::new(400.0 * 0.3_f64.cos(), 400.0 * 0.3_f64.sin(), 0.3 + std::f64::consts::FRAC_PI_2);
        let route = find_route(&road, start, velocity, &[], &RouteSettings::default()).expect("a route");
        let s = route.path.project(start.position).expect("on the path").0;
        let state = State {
            x: start.position.x + 0.2,
            y: start.position.y,
            orientation: start.orientation,
            velocity,
            acceleration: 0.0,
            yaw_rate: velocity / 400.0,
        };
        let poses: Vec<(Pose, f64)> = cars
            .iter()
            .map(|(ahead, left, speed)| {
                let at = route.path.at(s + ahead);
                (Pose { position: at.offset(*left), orientation: at.theta }, *speed)
            })
            .collect();
        let goal = Goal {
            states: vec![GoalState { areas: [].into(), time_step: (0, 500), velocity: None, orientation: None }],
            pace: None,
        };
        let shape = Shape::rectangle(4.5, 1.8);
        let predictions = predictions(&poses);
        let positions: Vec<Point> = poses.iter().map(|(pose, _)| pose.position).collect();
        let prediction_index = PredictionIndex::of(&predictions, &positions);
        Self { predictions, prediction_index, road, route, state, goal, poses, shape }
    }

    fn run(&self, settings: &FrenetSettings, memory: &mut FrenetMemory) -> f64 {
        let vehicle = Vehicle::BMW_320I;
        let others: Vec<Other> = self
            .poses
            .iter()
            .enumerate()
            .map(|(row, (pose, velocity))| Other {
                row,
                pose: *pose,
                velocity: *velocity,
                braking: 0.0,
                shape: &self.shape,
                is_static: false,
                kind: ParticipantKind::Car,
            })
            .collect();
        let request = PlanRequest {
            time_step: 0,
            dt: 0.1,
            state: self.state,
            entry: self.state,
            vehicle: &vehicle,
            shape: &self.shape,
            route: &self.route,
            s_hint: self.route.start_s,
            goal: &self.goal,
            road: &self.road,
            was_on_road: true,
            others: &others,
            predictions: &self.predictions,
            prediction_index: &self.prediction_index,
            previous: None,
            previous_age: 0,
            standing: 0.0,
            rules: Rules::default(),
            last_time_step: None,
            lane_change: LaneChange::default(),
            indicator: Indicator::default(),
            line: None,
        };
        plan(black_box(&request), settings, memory).cost
    }
}

/// All participants keep speed and heading; two modes, the second one slower.
fn predictions(poses: &[(Pose, f64)]) -> Predictions {
    let ids = (0..poses.len() as i64).collect();
    let mut out = Predictions::empty(0, ids, 2, 30);
    for (row, (pose, velocity)) in poses.iter().enumerate() {
        for mode in 0..2 {
            out.probability[2 * row + mode] = [0.8, 0.2][mode];
            for step in 0..30 {
                let (k, time) = (out.offset(row, mode) + step, (step + 1) as f64 * 0.1);
                let axis = Point::from_angle(pose.orientation);
                let position = pose.position + axis * (velocity * time * [1.0, 0.8][mode]);
                let (along, across) = (0.04 + (0.4 * time * time).powi(2), (0.15 + 0.15 * time).powi(2));
                (out.x[k], out.y[k], out.orientation[k]) = (position.x, position.y, pose.orientation);
                out.velocity[k] = *velocity;
                out.covariance_xx[k] = along * axis.x * axis.x + across * axis.y * axis.y;
                out.covariance_xy[k] = (along - across) * axis.x * axis.y;
                out.covariance_yy[k] = along * axis.y * axis.y + across * axis.x * axis.x;
                out.valid[k] = true;
            }
        }
    }
    out
}

fn benches(c: &mut Criterion) {
    let crowd: Vec<Place> = (0..60)
        .map(|i| (f64::from(i / 3) * 9.0 - 60.0, f64::from(i % 3 - 1) * 3.5, 9.0))
        .filter(|(ahead, left, _)| left.abs() > 1.0 || ahead.abs() > 8.0)
        .collect();
    let three = [(14.0, 0.0, 8.0), (4.0, 3.5, 11.0), (18.0, -3.5, 9.0)];
    let mut group = c.benchmark_group("frenet");
    for (name, velocity, cars) in [
        ("alone", 12.0, &[][..]),
        ("alone, slow", 1.0, &[]),
        ("three in reach", 12.0, &three),
        ("three in reach, slow", 1.5, &[(7.5, 0.0, 0.5), (3.0, 3.5, 3.0), (12.0, -3.5, 2.0)]),
        ("standing car 9 m ahead", 12.0, &[(14.0, 0.0, 0.0)]),
        ("crowd of 60", 10.0, &crowd),
    ] {
        let bench = Bench::new(velocity, cars);
        let mut memory = FrenetMemory::default();
        let settings = FrenetSettings::default();
        group.bench_function(name, |b| b.iter(|| bench.run(&settings, &mut memory)));
    }
    let bench = Bench::new(12.0, &three);
    let mut memory = FrenetMemory::default();
    let settings = FrenetSettings { lazy: false, ..FrenetSettings::default() };
    group.bench_function("three in reach, full evaluation", |b| b.iter(|| bench.run(&settings, &mut memory)));
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
