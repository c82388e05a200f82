//! Leader and follower in a lane, and how a lane change would affect them.

use super::car_following::CarFollowing;
use super::conflicts::Ego;
use super::lanes::Lane;
use super::{Other, PlanRequest};
use crate::geometry::Point;

/// Feet of others are searched within this distance of where they are on a straight lane [m].
const WINDOW: f64 = 12.0;
/// A participant within this distance of the edge of the corridor beside the agent is in it [m].
const SIDE_MARGIN: f64 = 0.2;
/// Vehicles whose middles are nearer to each other than this along the lane are side by side [m].
const SIDE_BY_SIDE: f64 = 0.25;

/// Leader and follower in a lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Next {
    /// From bumper to bumper [m]; negative if beside.
    pub(super) gap: f64,
    /// Speed along the lane [m/s]; negative if it reverses.
    pub(super) velocity: f64,
}

/// Leader and follower in a lane, of an agent that is (or would be) there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Neighbours {
    pub(super) leader: Option<Next>,
    pub(super) follower: Option<Next>,
}

/// A vehicle in a lane, relative to the agent's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    /// Where it ends and begins [m].
    pub(super) rear: f64,
    pub(super) front: f64,
    /// Speed along the lane [m/s]; negative if it reverses.
    pub(super) velocity: f64,
    /// It drives along the lane, now or soon: it is neither parked nor oncoming.
    pub(super) is_traffic: bool,
}

impl Interval {
    /// Its middle [m].
    pub(super) fn middle(&self) -> f64 {
        0.5 * (self.rear + self.front)
    }

    /// It is ahead of an agent that wants to change to its lane. Of two vehicles side by side the vehicle falls back that
    /// changes to the left, as from a ramp.
    pub(super) fn is_ahead(&self, to_the_left: bool) -> bool {
        let middle = self.middle();
        if middle.abs() < SIDE_BY_SIDE { to_the_left } else { middle > 0.0 }
    }
}

/// The vehicles in a lane, as an agent sees them that is (or would be) there; in the order of the request.
pub(super) fn intervals(request: &PlanRequest, lane: &Lane, ego: &Ego) -> impl Iterator<Item = Interval> {
    let (half, reach) = (ego.half_width + SIDE_MARGIN, ego.reach);
    let here = request.state.pose().position;
    let axis = Point::from_angle(request.state.orientation);
    let interval = move |other: &Other| {
        if other.is_static && other.shape.parts().len() > 1 {
            return None;
        }
        let body = other.shape.oriented_box(other.pose);
        let distance = body.center.distance(here);
        if distance > reach {
            return None;
        }
        // On a lane that hardly bends the foot is about as far ahead as the body.
        let expected = ego.s + (body.center - here).dot(axis);
        let narrow = lane.path.project_near(body.center, expected, WINDOW);
        let wide = || lane.path.project_near(body.center, ego.s, distance + 10.0);
        let (s, d) = narrow.or_else(wide)?;
        let tangent = lane.path.at(s).tangent();
        let (cos, sin) = (tangent.dot(body.axis), tangent.cross(body.axis).abs());
        let half_s = body.half_length * cos.abs() + body.half_width * sin;
        let half_d = body.half_length * sin + body.half_width * cos.abs();
        if d.abs() > half + half_d {
            return None;
        }
        let offset = s - (ego.s + 0.5 * (ego.to_front + ego.to_rear));
        let velocity = other.velocity_along(cos);
        let is_traffic = !other.is_static && cos > 0.0;
        Some(Interval { rear: offset - half_s, front: offset + half_s, velocity, is_traffic })
    };
    request.others.iter().filter_map(interval)
}

impl Neighbours {
    pub(super) fn of(request: &PlanRequest, lane: &Lane, ego: &Ego) -> Self {
        let mut found = Self::default();
        let half_ego = 0.5 * (ego.to_front - ego.to_rear);
        for other in intervals(request, lane, ego) {
            let offset = other.middle();
            let gap = offset.abs() - 0.5 * (other.front - other.rear) - half_ego;
            let next = Next { gap, velocity: other.velocity };
            let place = if offset > 0.0 { &mut found.leader } else { &mut found.follower };
            if place.is_none_or(|known| gap < known.gap) {
                *place = Some(next);
            }
        }
        found
    }

    /// No participant is beside the agent.
    pub(super) fn is_free(&self) -> bool {
        [self.leader, self.follower].iter().flatten().all(|next| next.gap > 0.0)
    }

    /// What the agent's own acceleration is there [m/s²].
    pub(super) fn own(&self, law: &CarFollowing, velocity: f64, wish: f64) -> f64 {
        let interaction = self.leader.map_or(0.0, |next| law.interaction(velocity, next.gap, next.velocity));
        law.free(velocity, wish) + interaction
    }

    /// Acceleration of the follower behind the agent, and behind the agent's leader if the agent were not there [m/s²].
    /// What its desired speed adds is the same in both and left out.
    pub(super) fn behind(&self, law: &CarFollowing, velocity: f64, own_length: f64) -> Option<(f64, f64)> {
        let follower = self.follower?;
        let with = law.interaction(follower.velocity, follower.gap, velocity);
        let without = self.leader.map_or(0.0, |leader| {
            let gap = follower.gap.max(0.0) + own_length + leader.gap.max(0.0);
            law.interaction(follower.velocity, gap, leader.velocity)
        });
        Some((with, without))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_reverses_comes_nearer_and_oncoming_traffic_counts_as_standing() {
        let shape = crate::geometry::shape::Shape::rectangle(4.5, 1.8);
        let (pose, kind) = (crate::geometry::Pose::new(0.0, 0.0, 0.0), crate::vehicle::ParticipantKind::Car);
        for (velocity, cos, leads, along) in [
            (5.0, 1.0, true, 5.0),
            (5.0, -1.0, false, 0.0),
            (-2.0, 1.0, true, -2.0),
            (-2.0, -1.0, true, 2.0),
            (-0.4, 1.0, true, 0.0),
        ] {
            let other = Other { row: 0, pose, velocity, braking: 0.0, shape: &shape, is_static: false, kind };
            assert_eq!((other.leads(cos), other.velocity_along(cos)), (leads, along), "{velocity} m/s, cosine {cos}");
        }
    }

    #[test]
    fn followers_lose_what_the_model_says() {
        let law = CarFollowing { time_gap: 1.5, minimum_gap: 2.0, acceleration: 1.0, deceleration: 4.0, exponent: 4.0 };
        let next = |gap, velocity| Some(Next { gap, velocity });
        let neighbours = Neighbours { leader: next(29.0, 10.0), follower: next(17.0, 10.0) };
        // s* = 17 at equal speeds: behind the agent 17 m, behind its leader 17 + 5 + 29 = 51 m.
        let (with, without) = neighbours.behind(&law, 10.0, 5.0).expect("a follower");
        assert!((with + 1.0).abs() < 1e-12 && (without + 1.0 / 9.0).abs() < 1e-12, "{with} {without}");
    }
}
