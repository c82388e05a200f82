//! Small invented worlds for the tests of planners: an agent on its road, other cars, and all that a request needs.

use super::{LaneChange, Other, PlanRequest, PlanResult, PredictionIndex};
use crate::conduct::STANDSTILL_SPEED;
use crate::control::Control;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::{PlacedShape, Shape};
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;
use crate::road::testing::{lane, open, straight};
use crate::route::{PathPiece, Route};
use crate::rules::{Indicator, Rules, RulesSettings};
use crate::scenario::{Goal, GoalState};
use crate::trajectory::{Predictions, State, Trajectory};
use crate::vehicle::{ParticipantKind, Vehicle};

/// Another participant that keeps its speed and heading, and is predicted to.
#[derive(Debug, Clone)]
pub(super) struct Car {
    pub(super) pose: Pose,
    pub(super) velocity: f64,
    pub(super) shape: Shape,
    pub(super) is_static: bool,
    /// Standard deviation of its predicted position [m], along and across its heading, growing with the root of time.
    pub(super) sigma: (f64, f64),
}

impl Car {
    pub(super) fn at(x: f64, y: f64, orientation: f64, velocity: f64) -> Self {
        let shape = Shape::rectangle(4.508, 1.61);
        Self { pose: Pose::new(x, y, orientation), velocity, shape, is_static: velocity == 0.0, sigma: (0.4, 0.2) }
    }

    fn after(&self, time: f64) -> Pose {
        let position = self.pose.position + Point::from_angle(self.pose.orientation) * (self.velocity * time);
        Pose { position, ..self.pose }
    }
}

/// An agent on its road, and all that a request needs.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    pub(super) dt: f64,
    pub(super) time_step: i64,
    pub(super) state: State,
    pub(super) entry_velocity: f64,
    pub(super) vehicle: Vehicle,
    pub(super) shape: Shape,
    pub(super) route: Route,
    pub(super) goal: Goal,
    pub(super) road: RoadNetwork,
    pub(super) cars: Vec<Car>,
    pub(super) previous: Option<(Trajectory, usize)>,
    /// Steps for which it has stood.
    pub(super) standing: usize,
    /// Predicted steps, and how many steps ago they were predicted.
    pub(super) n_predicted: usize,
    pub(super) prediction_age: i64,
    /// What it obeys, with lines; nothing if there is none.
    pub(super) rules: Option<(Control, RulesSettings)>,
}

/// Somewhere, at any time in the next 100 s.
fn anywhere() -> Goal {
    Goal {
        states: vec![GoalState { areas: [].into(), time_step: (0, 1000), velocity: None, orientation: None }],
        pace: None,
    }
}

impl Drive {
    /// In the middle of a lane around the points, `width` wide, at `s` with a speed; goal: anywhere.
    pub(super) fn along(center: &[Point], s: f64, velocity: f64) -> Self {
        Self::on(open(vec![lane(1, center)]), center, s, velocity)
    }

    pub(super) fn on(road: RoadNetwork, center: &[Point], s: f64, velocity: f64) -> Self {
        let path = ReferencePath::through(center).expect("a test's path");
        let vehicle = Vehicle::BMW_320I;
        let at = path.at(s);
        let mid = at.position + Point::from_angle(at.theta) * vehicle.rear_axle_to_center;
        let yaw_rate = at.curvature * velocity;
        Self {
            dt: 0.1,
            time_step: 0,
            state: State { x: mid.x, y: mid.y, orientation: at.theta, velocity, acceleration: 0.0, yaw_rate },
            entry_velocity: velocity,
            vehicle,
            shape: Shape::rectangle(vehicle.length, vehicle.width),
            route: Route {
                lanelets: vec![0],
                pieces: vec![PathPiece::whole(0, 0.0, s + 1000.0)],
                path,
                start_s: s,
                goal_entry_s: f64::NAN,
                goal_exit_s: f64::NAN,
                lane_changes: 0,
                user: ParticipantKind::Car,
            },
            goal: anywhere(),
            road,
            cars: vec![],
            previous: None,
            standing: 0,
            n_predicted: 30,
            prediction_age: 0,
            rules: None,
        }
    }

    /// 300 m along x, three lanes at y = -3.5, 0, 3.5; the path is the middle one.
    pub(super) fn on_three_lanes(s: f64, velocity: f64) -> Self {
        let center = |y: f64| straight((0.0, y), (300.0, y));
        let lanes = vec![lane(1, &center(-3.5)), lane(2, &center(0.0)), lane(3, &center(3.5))];
        Self::on(open(lanes), &center(0.0), s, velocity)
    }

    /// The goal is the stretch of the path between two arc lengths, in an interval of time steps.
    pub(super) fn with_goal(mut self, s: (f64, f64), time_step: (i64, i64), velocity: Option<(f64, f64)>) -> Self {
        let middle = self.route.path.at(0.5 * (s.0 + s.1));
        let pose = Pose { position: middle.position, orientation: middle.theta };
        let areas = [PlacedShape { shape: Shape::rectangle(s.1 - s.0, 3.5), pose }].into();
        self.goal = Goal { states: vec![GoalState { areas, time_step, velocity, orientation: None }], pace: None };
        (self.route.goal_entry_s, self.route.goal_exit_s) = s;
        self
    }

    pub(super) fn with_cars(mut self, cars: Vec<Car>) -> Self {
        self.cars = cars;
        self
    }

    fn predictions(&self) -> Predictions {
        let n_steps = self.n_predicted;
        let ids = (0..self.cars.len() as i64).map(|i| 100 + i).collect();
        let mut out = Predictions::empty(self.time_step - self.prediction_age, ids, 1, n_steps);
        for (row, car) in self.cars.iter().enumerate() {
            out.probability[row] = 1.0;
            for step in 0..n_steps {
                let (k, time) = (out.offset(row, 0) + step, (step as i64 + 1 - self.prediction_age) as f64 * self.dt);
                let pose = car.after(time);
                let (sin, cos) = pose.orientation.sin_cos();
                let spread = (step + 1) as f64 * self.dt;
                let (along, across) = (car.sigma.0.powi(2) * spread, car.sigma.1.powi(2) * spread);
                (out.x[k], out.y[k], out.orientation[k]) = (pose.position.x, pose.position.y, pose.orientation);
                out.velocity[k] = car.velocity;
                out.covariance_xx[k] = along * cos * cos + across * sin * sin;
                out.covariance_xy[k] = (along - across) * sin * cos;
                out.covariance_yy[k] = along * sin * sin + across * cos * cos;
                out.valid[k] = true;
            }
        }
        out
    }

    /// Where the cars are.
    pub(super) fn positions(&self) -> Vec<Point> {
        self.cars.iter().map(|car| car.pose.position).collect()
    }

    pub(super) fn with_request<R>(&self, use_it: impl FnOnce(&PlanRequest) -> R) -> R {
        let others: Vec<Other> = self
            .cars
            .iter()
            .enumerate()
            .map(|(row, car)| Other {
                row,
                pose: car.pose,
                velocity: car.velocity,
                braking: 0.0,
                shape: &car.shape,
                is_static: car.is_static,
                kind: ParticipantKind::Car,
            })
            .collect();
        let predictions = self.predictions();
        use_it(&PlanRequest {
            time_step: self.time_step,
            dt: self.dt,
            state: self.state,
            entry: State { velocity: self.entry_velocity, ..self.state },
            vehicle: &self.vehicle,
            shape: &self.shape,
            route: &self.route,
            s_hint: f64::NAN,
            goal: &self.goal,
            road: &self.road,
            was_on_road: self.road.covers(&self.shape, self.state.pose()),
            others: &others,
            predictions: &predictions,
            prediction_index: &PredictionIndex::of(&predictions, &self.positions()),
            previous: self.previous.as_ref().map(|(plan, _)| plan),
            previous_age: self.previous.as_ref().map_or(0, |(_, age)| *age),
            standing: self.standing as f64 * self.dt,
            rules: self.rules.as_ref().map_or_else(Rules::default, |(control, settings)| Rules {
                control,
                settings,
                ..Rules::default()
            }),
            last_time_step: None,
            lane_change: LaneChange::default(),
            indicator: Indicator::default(),
            line: None,
        })
    }

    /// Drives the first step of the plan; all others move on.
    pub(super) fn step(&mut self, result: PlanResult) {
        self.state = result.trajectory.points[1];
        self.previous = Some((result.trajectory, 1));
        self.standing = if self.state.velocity.abs() < STANDSTILL_SPEED { self.standing + 1 } else { 0 };
        self.time_step += 1;
        for car in &mut self.cars {
            car.pose = car.after(self.dt);
        }
    }

    /// Arc length of the rear axle and lateral offset [m].
    pub(super) fn place(&self) -> (f64, f64) {
        let rear_axle = self.vehicle.rear_axle_from_center(self.state.pose());
        self.route.path.project(rear_axle).expect("beside the path")
    }

    pub(super) fn is_in_contact(&self) -> bool {
        self.cars.iter().any(|car| self.shape.overlaps(self.state.pose(), &car.shape, car.pose))
    }
}
