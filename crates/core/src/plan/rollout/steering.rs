//! Steering: a driver follows a path at an offset by feedback, within the limits of the vehicle, so that what it drives can
//! be driven from any state.

use super::super::PlanRequest;
use super::super::driven_point::DrivenPoint;
use super::super::driving_line::LinePoint;
use super::super::path_motion::point_at;
use super::speeds::Speeds;
use super::start::Start;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::{Point, wrap_angle};
use crate::trajectory::State;

/// Offset and heading are corrected over a way of at least this length [m].
const CORRECTION_LENGTH: f64 = 2.5;
/// The same for the line [m]: where the front swings over the edge of the lane, the line is not worth it.
const LINE_CORRECTION_LENGTH: f64 = 4.0;
/// How far ahead of the line's curvature it steers [s]: half the time in which it turns the wheels for a bend.
const LINE_PREVIEW: f64 = 0.2;
/// Larger offsets are corrected no harder [m].
const OFFSET_MAX: f64 = 1.5;
/// The front swings out of bends by at most twice this [m].
const SWING_MAX: f64 = 4.0;
/// Share of the vehicle's limits that is used: rounding must not exceed them.
const LIMIT_SHARE: f64 = 0.98;
/// What a roll-out costs is looked at after so many points each.
const PRICED_POINTS: usize = 3;
/// The arc length of the foot follows where the path bends around the vehicle by at least this stretch.
const STRETCH_MIN: f64 = 0.2;

/// How a driver steers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steering {
    /// How far ahead it looks at the path [s].
    preview: f64,
    /// Time in which an offset is corrected [s].
    time: f64,
    /// How far inside bends it aims: 1 so that the rear is as far inside as the front is outside.
    inside: f64,
    /// The share of the tightest curvature that it holds before it follows the path, and for how long [s].
    held: Option<(f64, f64)>,
}

/// What an offset is counted from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Along {
    /// The line that the agent takes in its lane.
    Line,
    /// The path.
    Path,
}

impl Steering {
    /// The ordinary driver.
    pub(super) const FIRM: Self = Self { preview: 0.5, time: 0.8, inside: 0.0, held: None };
    /// Changes lanes where there is time.
    pub(super) const GENTLE: Self = Self { time: 1.6, ..Self::FIRM };
    /// Changes lanes where there is less.
    pub(super) const BRISK: Self = Self { time: 1.15, ..Self::FIRM };
    /// Swerves.
    pub(super) const QUICK: Self = Self { preview: 0.4, time: 0.55, ..Self::FIRM };
    /// Where the road is narrow, in turn.
    pub(super) const CORNERING: [Self; 3] = [
        Self { preview: 0.3, time: 0.6, inside: 1.0, ..Self::FIRM },
        Self { preview: 0.2, time: 0.5, inside: 0.0, ..Self::FIRM },
        Self { preview: 0.3, time: 0.6, inside: 2.0, ..Self::FIRM },
    ];

    /// Turns the wheels to a share of the tightest curvature for a time first [s]: swings out.
    pub(super) fn swinging(share: f64, time: f64) -> Self {
        Self { preview: 0.3, time: 0.6, held: Some((share, time)), ..Self::FIRM }
    }
}

/// A motion of the vehicle.
#[derive(Debug, Clone, Default)]
pub(super) struct Rollout {
    pub(super) points: Vec<DrivenPoint>,
    /// Integral of the distance from where it is neither in the middle of the lane, nor on the line, nor between [m s].
    pub(super) offset: f64,
    /// Distance from the line at the end [m].
    pub(super) beside: f64,
    /// Integral of the squared lateral acceleration beyond that of the line [m²/s³].
    pub(super) lateral: f64,
}

impl Rollout {
    /// Drives with speeds along the path at an offset [m].
    pub(super) fn drive(
        &mut self,
        request: &PlanRequest,
        start: &Start,
        way: (f64, Along),
        speeds: &Speeds,
        steering: Steering,
    ) {
        self.drive_unless(request, start, way, speeds, steering, |_| false);
    }

    /// The same, but it gives up once its integrals up to then are too dear; says whether it came to the end.
    pub(super) fn drive_unless(
        &mut self,
        request: &PlanRequest,
        start: &Start,
        (target, along): (f64, Along),
        speeds: &Speeds,
        steering: Steering,
        is_too_dear: impl Fn(&Self) -> bool,
    ) -> bool {
        let (vehicle, path, dt) = (request.vehicle, &request.route.path, request.dt);
        let line = request.line.filter(|_| along == Along::Line);
        let step = LIMIT_SHARE * vehicle.steering_step(dt);
        let tightest = vehicle.curvature_max();
        let to_front = vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let (mut axle, mut theta) = (start.axle, start.theta);
        let (mut s, mut curvature, mut before) = (start.s, start.curvature, start.velocity + start.rolling);
        let mut at = point_at(path, s);
        let mut d = start.d;
        let mut on_line = request.line.map_or_else(LinePoint::default, |line| line.at(s));
        let mut beside = start.d - on_line.offset;
        self.points.clear();
        (self.offset, self.lateral) = (0.0, 0.0);
        for (i, (&velocity, &acceleration)) in speeds.velocity.iter().zip(&speeds.acceleration).enumerate() {
            if i > 0 {
                let wanted = match steering.held {
                    None if before < 0.0 => curvature,
                    Some((share, until)) if i as f64 * dt <= until => share * tightest,
                    _ => {
                        let preview = if line.is_some() { LINE_PREVIEW } else { steering.preview };
                        let from = s + before * preview;
                        // The middle of the front is outside of a bend by half of what the heading changes along the body.
                        let swing = 0.5 * to_front * (heading(path, from + to_front) - heading(path, from));
                        let (here, ahead) = match line {
                            Some(line) => (on_line, line.curvature_at(from)),
                            None => (LinePoint::default(), path.curvature_at(from)),
                        };
                        let aim = here.offset + target + steering.inside * 0.5 * swing.clamp(-SWING_MAX, SWING_MAX);
                        let shortest = if line.is_some() { LINE_CORRECTION_LENGTH } else { CORRECTION_LENGTH };
                        let length = shortest.max(steering.time * before);
                        let error = (d - aim).clamp(-OFFSET_MAX, OFFSET_MAX);
                        let askew = wrap_angle(theta - at.theta - here.heading);
                        ahead - (error / length + 2.0 * askew) / length
                    }
                };
                let fastest = velocity.abs().max(before.abs());
                let held = LIMIT_SHARE * vehicle.lateral_acceleration_beside(acceleration) / fastest.powi(2).max(1e-6);
                let next = if i == 1 && start.stands {
                    curvature = wanted.clamp(-tightest, tightest);
                    curvature
                } else {
                    vehicle.turned(curvature, wanted, step, tightest.min(held))
                };
                let way = 0.5 * (before + velocity) * dt;
                let turn = 0.5 * (curvature + next) * way;
                axle = axle + Point::from_angle(theta + 0.5 * turn) * way;
                theta += turn;
                curvature = next;
                // One step of Newton's method to the foot.
                at = point_at(path, s + way);
                let offset = axle - at.position;
                d = at.tangent().cross(offset);
                let ahead = offset.dot(at.tangent()) / at.stretch(d).max(STRETCH_MIN);
                s += way + ahead.clamp(-2.0 * way.abs() - 0.1, 2.0 * way.abs() + 0.1);
                on_line = match request.line {
                    Some(line) => line.at(s),
                    None => LinePoint { curvature: at.curvature, ..LinePoint::default() },
                };
                let offset = on_line.offset;
                let beyond = velocity * velocity * (curvature - on_line.curvature);
                self.lateral += beyond * beyond * dt;
                beside = d - offset;
                self.offset += (d - d.clamp(offset.min(0.0), offset.max(0.0))).abs() * dt;
                if i % PRICED_POINTS == 0 && is_too_dear(self) {
                    return false;
                }
            }
            let axis = Point::from_angle(theta);
            let center = axle + axis * vehicle.rear_axle_to_center;
            self.points.push(DrivenPoint { center, axis, theta, curvature, velocity, acceleration, s, d });
            before = velocity;
        }
        self.beside = beside;
        true
    }

    /// States of the footprint centre; the first is that of the request.
    pub(super) fn states(&self, request: &PlanRequest) -> Vec<State> {
        let state = |point: &DrivenPoint| State {
            x: point.center.x,
            y: point.center.y,
            orientation: point.theta,
            velocity: point.velocity,
            acceleration: point.acceleration,
            yaw_rate: point.curvature * point.velocity,
        };
        let mut states: Vec<State> = self.points.iter().map(state).collect();
        states[0] = request.state;
        // The acceleration of a state is the one that led to it.
        for i in (1..states.len()).rev() {
            states[i].acceleration = self.points[i - 1].acceleration;
        }
        states
    }
}

/// Heading of the path at an arc length [rad].
fn heading(path: &ReferencePath, s: f64) -> f64 {
    path.theta()[((s / path.spacing()).max(0.0) as usize).min(path.theta().len() - 1)]
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::plan::testing::Drive;

    #[test]
    fn the_integrals_of_a_rollout_never_fall_on_its_way() {
        let mut drive = Drive::on_three_lanes(30.0, 15.0);
        (drive.state.orientation, drive.state.y) = (0.2, drive.state.y + 0.8);
        drive.with_request(|request| {
            let start = Start::new(request, true).expect("on its path");
            let speeds = Speeds { velocity: vec![15.0; 31], acceleration: vec![0.0; 31], s: 75.0 };
            for steering in [Steering::GENTLE, Steering::QUICK, Steering::FIRM, Steering::swinging(0.5, 0.8)] {
                let (mut rollout, looks) = (Rollout::default(), RefCell::new(vec![(0.0, 0.0)]));
                let look = |rollout: &Rollout| {
                    looks.borrow_mut().push((rollout.lateral, rollout.offset));
                    false
                };
                assert!(rollout.drive_unless(request, &start, (3.5, Along::Path), &speeds, steering, look));
                looks.borrow_mut().push((rollout.lateral, rollout.offset));
                let looks = looks.into_inner();
                assert_eq!(looks.len(), 12);
                assert!(looks.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 <= pair[1].1), "{looks:?}");
                assert!(looks[11].0 > 0.0 && looks[11].1 > 0.0);
                // Given up at once, it goes no further than to the first look.
                assert!(!rollout.drive_unless(request, &start, (3.5, Along::Path), &speeds, steering, |_| true));
                assert_eq!((rollout.lateral, rollout.offset), looks[1]);
            }
        });
    }
}
