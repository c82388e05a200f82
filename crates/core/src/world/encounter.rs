//! Whether two vehicles touch, or one leads the other, if both go on along their lanes at their speeds.

use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::trajectory::State;

/// A vehicle ahead leads if it is at most this far beside the way of the agent, of the sum of both widths, ...
const LEADER_WIDTHS: f64 = 0.4;
/// ... and heads elsewhere by at most this [rad].
pub(super) const LEADER_ANGLE: f64 = 0.6;
/// Who is farther beside a way than this [m] goes straight on.
const ALONG: f64 = 8.0;
/// A way is looked at a little farther than its chord [m], since it may bend.
const BENDS: f64 = 10.0;

/// A vehicle that goes on along a path at its speed, at its place and heading relative to the path, whichever way it
/// drives along it; straight on if it crosses the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moving<'a> {
    pub(super) pose: Pose,
    pub(super) velocity: f64,
    pub(super) shape: &'a Shape,
    /// Length and width [m].
    pub(super) size: (f64, f64),
    path: &'a ReferencePath,
    /// Arc length and offset of its place on the path [m], and how it is turned against it [rad].
    foot: Option<(f64, f64, f64)>,
}

impl<'a> Moving<'a> {
    /// Near an arc length of a path [m].
    pub(super) fn along(path: &'a ReferencePath, near: f64, state: &State, shape: &'a Shape) -> Self {
        let pose = state.pose();
        let foot = foot(path, near, pose).filter(|(_, offset, _)| offset.abs() < ALONG);
        Self { pose, velocity: state.velocity, shape, size: size(shape), path, foot }
    }

    pub(super) fn at_speed(self, velocity: f64) -> Self {
        Self { velocity, ..self }
    }

    /// Where it is after a time [s].
    pub(super) fn after(&self, time: f64) -> Pose {
        let way = self.velocity * time;
        if let Some((s, offset, turn)) = self.foot {
            let path = self.path;
            let there = s + way * turn.cos() / (1.0 - offset * path.at(s).curvature).max(0.5);
            let is_along = turn.sin().abs() < LEADER_ANGLE.sin() && (0.0..=path.length()).contains(&there);
            if is_along {
                let at = path.at(there);
                let aside = offset + way * turn.sin();
                let position = at.position + Point::from_angle(at.theta).left() * aside;
                return Pose { position, orientation: at.theta + turn };
            }
        }
        Pose { position: self.pose.position + Point::from_angle(self.pose.orientation) * way, ..self.pose }
    }

    /// Whether both touch within a time [s], looked at so many times.
    pub(super) fn touches(&self, other: &Self, within: f64, looks: u32) -> bool {
        let reach = (self.velocity.abs() + other.velocity.abs()) * within;
        let away = other.pose.position.distance(self.pose.position);
        let touch = |look: u32| {
            let time = within * f64::from(look) / f64::from(looks);
            self.shape.overlaps(self.after(time), other.shape, other.after(time))
        };
        away < reach + self.size.0 + other.size.0 + other.size.1 && (1..=looks).any(touch)
    }

    /// Where a pose is on the way of this vehicle, if another one of a size [m] is within `margin` [m] of its sides
    /// there: arc length from this vehicle on [m], and how it is turned [rad].
    pub(super) fn in_its_way(&self, pose: Pose, (length, width): (f64, f64), margin: f64) -> Option<(f64, f64)> {
        let begin = self.foot?.0;
        let (at, offset, turn) = foot(self.path, begin, pose)?;
        let across = length * turn.sin().abs() + width * turn.cos().abs();
        (offset.abs() < 0.5 * (self.size.1 + across) + margin).then_some((at - begin, turn))
    }
}

/// Arc length and offset [m] of a pose near an arc length of a path [m], and how it is turned against it [rad].
fn foot(path: &ReferencePath, near: f64, pose: Pose) -> Option<(f64, f64, f64)> {
    let window = 1.5 * pose.position.distance(path.at(near).position) + BENDS;
    let (s, offset) = path.project_near(pose.position, near, window)?;
    Some((s, offset, wrap_angle(pose.orientation - path.at(s).theta)))
}

/// Length and width of a footprint [m].
pub(super) fn size(shape: &Shape) -> (f64, f64) {
    let extent = shape.aabb(Pose::default());
    (extent.max.x - extent.min.x, extent.max.y - extent.min.y)
}

/// How far a vehicle is ahead along the way of another one [m], if it leads and is nearer than `most` [m]; `widths` is the
/// sum of both [m].
pub(super) fn leading(own: &State, other: &State, widths: f64, most: f64) -> Option<f64> {
    let (dx, dy) = (other.x - own.x, other.y - own.y);
    let (sin, cos) = own.orientation.sin_cos();
    let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
    let turn = wrap_angle(other.orientation - own.orientation);
    // On an arc the way bends aside by half the angle.
    let beside = (across - 0.5 * along * turn).abs();
    let leads = along > 0.0 && along < most && turn.abs() < LEADER_ANGLE && beside < LEADER_WIDTHS * widths;
    leads.then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64, orientation: f64) -> State {
        State { x, y, orientation, velocity: 10.0, ..State::default() }
    }

    #[test]
    fn a_vehicle_ahead_on_a_bend_leads_and_one_in_the_next_lane_does_not() {
        let angle: f64 = 40.0 / 200.0;
        let on_arc = at(200.0 * angle.sin(), 200.0 * (1.0 - angle.cos()), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &on_arc, 3.6, 100.0).is_some());
        let beside = at((200.0 - 3.5) * angle.sin(), 200.0 - (200.0 - 3.5) * angle.cos(), angle);
        assert!(leading(&at(0.0, 0.0, 0.0), &beside, 3.6, 100.0).is_none());
        assert!(leading(&at(0.0, 0.0, 0.0), &at(-10.0, 0.0, 0.0), 3.6, 100.0).is_none());
    }

    #[test]
    fn on_a_bend_vehicles_go_on_along_it_either_way_and_straight_across_it() {
        let radius = 30.0;
        let on_bend = |angle: f64| Point::new(radius * angle.sin(), radius * (1.0 - angle.cos()));
        let points: Vec<Point> = (0..=30).map(|i| on_bend(0.05 * f64::from(i))).collect();
        let path = ReferencePath::through(&points).expect("an arc");
        let car = Shape::rectangle(4.5, 1.8);
        let own = Moving::along(&path, 0.0, &at(0.0, 0.0, 0.0), &car).after(1.0);
        assert!(own.position.distance(on_bend(1.0 / 3.0)) < 0.05 && (own.orientation - 1.0 / 3.0).abs() < 0.02);
        // From the other end in the next lane, 3.5 m outside: it passes, and would not straight on.
        let begin = Point::new(0.0, radius) + Point::from_angle(0.6 - std::f64::consts::FRAC_PI_2) * 33.5;
        let oncoming = at(begin.x, begin.y, 0.6 + std::f64::consts::PI);
        let there = Moving::along(&path, 18.0, &oncoming, &car).after(1.0).position;
        assert!((there.distance(Point::new(0.0, radius)) - 33.5).abs() < 0.1, "{there:?}");
        assert!((there.distance(begin) - 10.0).abs() < 0.1);
        let across = at(5.0, 10.0, -std::f64::consts::FRAC_PI_2);
        let there = Moving::along(&path, 5.0, &across, &car).after(0.5).position;
        assert!(there.distance(Point::new(5.0, 5.0)) < 1e-9);
    }
}
