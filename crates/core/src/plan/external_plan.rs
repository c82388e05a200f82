//! Checks of plans from outside the core before they are driven.

use crate::error::{Error, Result};
use crate::geometry::{Point, wrap_angle};
use crate::limits::NUMBER_MAX;
use crate::trajectory::State;
use crate::vehicle::Vehicle;

/// A plan's point 0 may differ from the present state by this much: [m] ...
const START_GAP_MAX: f64 = 0.1;
/// ... [rad] and [m/s]; planners with models of their own smooth the start.
const START_TURN_MAX: f64 = 0.2;
const START_VELOCITY_MAX: f64 = 1.0;
/// Numbers of a vehicle are round; a plan may exceed its top speed by this share ...
const VELOCITY_SHARE: f64 = 1.1;
/// ... and a step may be longer than at that speed by this much [m].
const STEP_MARGIN: f64 = 0.1;

/// Most points of a plan: a thousand seconds at 0.1 s.
pub const PLAN_POINTS_MAX: usize = 10_000;
/// A plan may move this much less or more than its speeds say [m], ...
const MOTION_GAP: f64 = 0.05;
/// ... and by this share of the distance: models differ in where a vehicle's speed is measured.
const MOTION_SHARE: f64 = 0.1;
/// A step may go sideways by this share of its length, at the centre or at the rear axle: simple planners shift a vehicle
/// to the next lane without turning it.
const SIDEWAYS_SHARE: f64 = 0.5;

/// A plan as stated: one slice per field, all of the same length, point 0 is now. Acceleration [m/s²] and yaw rate
/// [rad/s] may be missing.
#[derive(Debug, Clone, Copy)]
pub struct StatedPlan<'a> {
    /// Footprint centres [m], world frame.
    pub x: &'a [f64],
    /// Footprint centres [m], world frame.
    pub y: &'a [f64],
    /// Headings [rad].
    pub orientation: &'a [f64],
    /// Speeds along the heading [m/s].
    pub velocity: &'a [f64],
    /// Along the heading [m/s²]; otherwise differences of the speed.
    pub acceleration: Option<&'a [f64]>,
    /// [rad/s]; otherwise differences of the heading.
    pub yaw_rate: Option<&'a [f64]>,
}

impl StatedPlan<'_> {
    /// The points, `dt` [s] apart. Missing fields are derived: central differences, one-sided at both ends, headings by
    /// the shorter way round.
    ///
    /// # Errors
    /// `InvalidInput` naming the field: another length, fewer than two points, more than [`PLAN_POINTS_MAX`], a value
    /// that is not a number.
    pub fn points(&self, dt: f64) -> Result<Vec<State>> {
        let n = self.x.len();
        let given = [
            ("x", Some(self.x)),
            ("y", Some(self.y)),
            ("orientation", Some(self.orientation)),
            ("velocity", Some(self.velocity)),
            ("acceleration", self.acceleration),
            ("yaw_rate", self.yaw_rate),
        ];
        if n < 2 {
            return Err(Error::invalid(format!("the plan has {n} points, at least two are expected")));
        }
        if n > PLAN_POINTS_MAX {
            return Err(Error::invalid(format!("the plan has {n} points, at most {PLAN_POINTS_MAX} are allowed")));
        }
        for (name, values) in given.into_iter().filter_map(|(name, values)| Some((name, values?))) {
            if values.len() != n {
                return Err(Error::invalid(format!("{name} has {} values, x has {n}", values.len())));
            }
            if let Some(i) = values.iter().position(|value| !value.is_finite()) {
                return Err(Error::invalid(format!("{name} is not a number at point {i} ({})", values[i])));
            }
        }
        let rate = |i: usize, difference: &dyn Fn(usize, usize) -> f64| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            difference(a, b) / ((b - a) as f64 * dt)
        };
        Ok((0..n)
            .map(|i| State {
                x: self.x[i],
                y: self.y[i],
                orientation: self.orientation[i],
                velocity: self.velocity[i],
                acceleration: self
                    .acceleration
                    .map_or_else(|| rate(i, &|a, b| self.velocity[b] - self.velocity[a]), |values| values[i]),
                yaw_rate: self.yaw_rate.map_or_else(
                    || rate(i, &|a, b| (a..b).map(|j| wrap_angle(self.orientation[j + 1] - self.orientation[j])).sum()),
                    |values| values[i],
                ),
            })
            .collect())
    }
}

/// Whether a plan starts at the present state, never jumps, and claims no speed that the vehicle does not have.
///
/// # Errors `InvalidInput` with the fault, for the author of the planner.
pub fn check_plan(points: &[State], now: &State, vehicle: &Vehicle, dt: f64) -> Result<()> {
    let Some(first) = points.first() else { return Err(Error::invalid("the plan has no points")) };
    let gap = first.pose().position.distance(now.pose().position);
    if gap > START_GAP_MAX {
        return Err(Error::invalid(format!("the plan jumps: it starts {gap:.2} m away from the agent")));
    }
    let turn = wrap_angle(first.orientation - now.orientation);
    if turn.abs() > START_TURN_MAX {
        return Err(Error::invalid(format!("the plan starts with a heading {turn:.2} rad off the agent's")));
    }
    let change = first.velocity - now.velocity;
    if change.abs() > START_VELOCITY_MAX {
        return Err(Error::invalid(format!("the plan starts {change:.2} m/s off the agent's speed")));
    }
    if let Some(i) = points.iter().position(|point| !point.is_possible()) {
        return Err(Error::invalid(format!("the plan has a value beyond {NUMBER_MAX:e} at point {i}")));
    }
    let reach = VELOCITY_SHARE * vehicle.velocity_max * dt + STEP_MARGIN;
    for (i, pair) in points.windows(2).enumerate() {
        let distance = pair[0].pose().position.distance(pair[1].pose().position);
        if distance > reach {
            let j = i + 1;
            return Err(Error::invalid(format!(
                "the plan jumps by {distance:.2} m between points {i} and {j}; the vehicle gets at most {reach:.2} m far \
                 in {dt} s"
            )));
        }
    }
    let fastest = points.iter().map(|point| point.velocity.abs()).fold(0.0, f64::max);
    if fastest > VELOCITY_SHARE * vehicle.velocity_max {
        let top = vehicle.velocity_max;
        return Err(Error::invalid(format!("the plan claims {fastest:.1} m/s, the vehicle reaches {top:.1} m/s")));
    }
    Ok(())
}

/// Whether positions, headings and speeds of a plan tell of the same motion. From point 0 to any other, it must move along
/// its headings as far as its speeds say (at one end of each step or the other, whichever allows more), and hardly
/// sideways: the centre does where a vehicle turns about its rear axle, so that the axle counts, too.
///
/// # Errors
/// `InvalidInput` with the first stretch where they contradict each other.
pub fn check_motion(points: &[State], vehicle: &Vehicle, dt: f64) -> Result<()> {
    let (mut along, mut least, mut most, mut driven) = (0.0, 0.0, 0.0, 0.0);
    for (i, pair) in points.windows(2).enumerate() {
        let [a, b] = [pair[0], pair[1]];
        let heading = a.orientation + 0.5 * wrap_angle(b.orientation - a.orientation);
        let step = b.pose().position - a.pose().position;
        let axis = Point::from_angle(heading);
        let turn = (Point::from_angle(b.orientation) - Point::from_angle(a.orientation)) * vehicle.rear_axle_to_center;
        let sideways = axis.cross(step).abs().min(axis.cross(step - turn).abs());
        along += axis.dot(step);
        least += a.velocity.min(b.velocity) * dt;
        most += a.velocity.max(b.velocity) * dt;
        let length = a.velocity.abs().max(b.velocity.abs()) * dt;
        driven += length;
        let margin = MOTION_GAP + MOTION_SHARE * driven;
        let (distance, way, first) = if along < least - margin || along > most + margin {
            (along + 0.0, "", 0)
        } else if sideways > MOTION_GAP + SIDEWAYS_SHARE * length {
            (sideways, "sideways ", i)
        } else {
            continue;
        };
        let (last, n) = (i + 1, (i + 1 - first) as f64);
        let speed = points[first..=last].iter().map(|point| point.velocity).sum::<f64>() / (n + 1.0);
        return Err(Error::invalid(format!(
            "the plan moves {distance:.1} m {way}in {} s but states {speed:.1} m/s (points {first} to {last}); positions \
             are footprint centres, the rear axle is {:.1} m behind",
            (n * dt * 1e3).round() / 1e3,
            vehicle.rear_axle_to_center,
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::ParticipantKind;
    use std::f64::consts::PI;

    fn straight(velocity: f64, n: usize) -> Vec<State> {
        (0..n).map(|i| State { x: i as f64 * 0.1 * velocity, velocity, ..State::default() }).collect()
    }

    fn car() -> Vehicle {
        Vehicle::for_footprint(ParticipantKind::Car, 4.5, 1.8).unwrap()
    }

    #[test]
    fn missing_rates_are_differences_and_headings_go_the_shorter_way_round() {
        let plan = StatedPlan {
            x: &[0.0, 1.0, 2.0],
            y: &[0.0; 3],
            orientation: &[PI - 0.1, PI, -PI + 0.1],
            velocity: &[10.0, 10.5, 12.0],
            acceleration: None,
            yaw_rate: None,
        };
        let points = plan.points(0.1).unwrap();
        for (point, acceleration, yaw_rate) in [(0, 5.0, 1.0), (1, 10.0, 1.0), (2, 15.0, 1.0)] {
            assert!((points[point].acceleration - acceleration).abs() < 1e-9, "m/s² at point {point}");
            assert!((points[point].yaw_rate - yaw_rate).abs() < 1e-9, "rad/s at point {point}");
        }
    }

    #[test]
    fn a_plan_that_keeps_speed_is_driven() {
        assert_eq!(check_plan(&straight(10.0, 31), &straight(10.0, 1)[0], &car(), 0.1), Ok(()));
    }

    #[test]
    fn a_plan_that_cannot_be_driven_is_named() {
        let now = straight(10.0, 1)[0];
        let bent = |change: &dyn Fn(&mut [State])| {
            let mut points = straight(10.0, 5);
            change(&mut points);
            check_plan(&points, &now, &car(), 0.1).unwrap_err().to_string()
        };
        assert!(bent(&|p| p[0].y = 0.5).contains("starts 0.50 m away"));
        assert!(bent(&|p| p[0].orientation = 0.4).contains("0.40 rad off"));
        assert!(bent(&|p| p[0].velocity = 4.0).contains("-6.00 m/s off"));
        assert!(bent(&|p| p[3].y = 30.0).contains("between points 2 and 3"));
        assert!(bent(&|p| p[4].velocity = 300.0).contains("claims 300.0 m/s"));
    }

    #[test]
    fn a_plan_whose_positions_contradict_its_speeds_is_named() {
        let refusal = |change: &dyn Fn(usize, &mut State)| {
            let mut points = straight(12.8, 31);
            points.iter_mut().enumerate().for_each(|(i, point)| change(i, point));
            check_plan(&points, &straight(12.8, 1)[0], &car(), 0.1).unwrap();
            check_motion(&points, &car(), 0.1).map_err(|error| error.to_string())
        };
        let words = |change: &dyn Fn(usize, &mut State)| refusal(change).unwrap_err();
        let axle = car().rear_axle_to_center;
        let rear = words(&|i, p| p.x -= if i == 0 { 0.0 } else { axle });
        assert!(
            rear.contains(" m in 0.1 s but states 12.8 m/s (points 0 to 1); positions are footprint centres"),
            "{rear}"
        );
        assert!(words(&|_, p| p.x = 0.0).starts_with("the plan moves 0.0 m in 0.1 s but states 12.8 m/s"));
        assert!(words(&|_, p| p.x = -p.x).starts_with("the plan moves -1.3 m in 0.1 s but states 12.8 m/s"));
        assert!(words(&|_, p| (p.x, p.y) = (0.9 * p.x, 0.6 * p.x)).contains("0.8 m sideways in 0.1 s but states 12.8"));
        assert!(
            words(&|i, p| p.x -= if i > 20 { 0.5 * 12.8 * 0.1 * (i - 20) as f64 } else { 0.0 })
                .contains("points 0 to ")
        );
        // What is within the tolerance: other models of where a speed is measured, and of which end of a step has it.
        assert_eq!(refusal(&|_, p| p.x *= 1.05), Ok(()));
        let (mut euler, mut x) = (Vec::new(), 0.0);
        for i in 0..31 {
            let velocity = 8.0 * f64::from(i) * 0.1;
            euler.push(State { x, velocity, ..State::default() });
            x += velocity * 0.1;
        }
        assert_eq!(check_motion(&euler, &car(), 0.1), Ok(()));
    }

    #[test]
    fn a_car_that_turns_as_tightly_as_it_can_moves_sideways_at_its_centre_and_may() {
        let (vehicle, speed) = (car(), 5.0);
        let radius = 1.0 / vehicle.curvature_max();
        let circle = |i: usize| {
            let heading = speed * 0.1 * i as f64 / radius;
            let rear = Point::new(radius * heading.sin(), radius * (1.0 - heading.cos()));
            let Point { x, y } = rear + Point::from_angle(heading) * vehicle.rear_axle_to_center;
            State { x, y, orientation: wrap_angle(heading), velocity: speed, ..State::default() }
        };
        for sign in [1.0, -1.0] {
            let points: Vec<State> = (0..40)
                .map(|i| State { velocity: sign * speed, ..circle(if sign > 0.0 { i } else { 40 - i }) })
                .collect();
            assert_eq!(check_motion(&points, &vehicle, 0.1), Ok(()), "at {} m/s", sign * speed);
        }
    }

    #[test]
    fn a_field_with_another_length_or_without_a_number_is_named() {
        let plan = StatedPlan {
            x: &[0.0, 1.0],
            y: &[0.0; 2],
            orientation: &[0.0; 2],
            velocity: &[10.0, f64::NAN],
            acceleration: None,
            yaw_rate: None,
        };
        assert!(plan.points(0.1).unwrap_err().to_string().contains("velocity is not a number at point 1"));
        let short = StatedPlan { velocity: &[10.0], ..plan };
        assert!(short.points(0.1).unwrap_err().to_string().contains("velocity has 1 values, x has 2"));
        assert!(StatedPlan { x: &[], ..plan }.points(0.1).unwrap_err().to_string().contains("0 points"));
        let long = StatedPlan { x: &[0.0; PLAN_POINTS_MAX + 1], ..plan };
        assert!(long.points(0.1).unwrap_err().to_string().contains("10001 points, at most 10000 are allowed"));
    }
}
