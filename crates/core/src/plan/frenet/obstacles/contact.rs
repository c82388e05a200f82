//! Contacts of a sample with obstacles, and which of them are not the agent's to avoid.

use super::{Obstacle, Obstacles, SweptInterval};
use crate::conduct::FIRM_DECELERATION;
use crate::geometry::shape::OrientedBox;
use crate::plan::frame::Waypoint;
use crate::plan::{Other, PlanRequest};

/// A follower keeps the distance while the agent stays this close to its lateral position [m].
const OWN_LANE: f64 = 1.0;
/// A participant faster than this [m/s] is expected to yield if firm braking from now on stops it before the contact.
const YIELDING_SPEED: f64 = 0.2;
/// A follower heads within 45 degrees of the agent (cosine).
const FOLLOWER_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// First contact of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::plan::frenet) struct Contact {
    /// Position in the request's `others`.
    pub(in crate::plan::frenet) other: usize,
    /// Interval in which it happens; interval `i` ends at point `i + 1`.
    pub(in crate::plan::frenet) interval: usize,
}

impl Obstacles {
    /// First contact of a sample with a mode that counts, if any.
    ///
    /// Not a contact, while the agent stays in its lane and from then on for good: a participant behind the agent's rear
    /// with the same heading (it would hit the agent, so keeping the distance is its task), or a participant that comes
    /// second and must yield. Nor is an overlap that exists from the start, until it first ends, as long as the centres
    /// do not approach.
    pub(in crate::plan::frenet) fn first_contact(
        &mut self,
        points: &[Waypoint],
        request: &PlanRequest,
    ) -> Option<Contact> {
        let mut own = std::mem::take(&mut self.own);
        own.clear();
        own.extend(points.windows(2).map(|w| OrientedBox::spanning(&self.footprint(&w[0]), &self.footprint(&w[1]))));
        let contacts = self.obstacles.iter().filter_map(|obstacle| {
            let interval = self.meeting(obstacle, &own, points, request)?;
            Some(Contact { other: obstacle.other, interval })
        });
        let first = contacts.min_by_key(|contact| contact.interval);
        self.own = own;
        first
    }

    /// The interval of the first contact with an obstacle.
    fn meeting(
        &self,
        obstacle: &Obstacle,
        own: &[OrientedBox],
        points: &[Waypoint],
        request: &PlanRequest,
    ) -> Option<usize> {
        let Obstacle { other, first, overlaps_now, exact } = *obstacle;
        for (interval, covered) in self.intervals[first..first + own.len()].iter().enumerate() {
            let Some(covered) = covered.as_ref().filter(|covered| own[interval].overlaps(&covered.swept)) else {
                continue;
            };
            let (before, now) = (&points[interval], &points[interval + 1]);
            let (from, ego) = (self.footprint(before), self.footprint(now));
            if overlaps_now && is_separating(&from, &ego, covered)
                || exact && !touches(&request.others[other], request, now)
            {
                continue;
            }
            let keeps_lane = (now.d - points[0].d).abs() < OWN_LANE;
            let time = (interval + 1) as f64 * request.dt;
            let is_ignored = is_follower(&ego, &covered.end) || must_yield(&ego, covered, request.dt, time);
            return Some(interval).filter(|_| !(keeps_lane && is_ignored));
        }
        None
    }
}

/// The other's centre is behind the agent's rear and it heads the same way.
fn is_follower(ego: &OrientedBox, other: &OrientedBox) -> bool {
    (other.center - ego.center).dot(ego.axis) < -ego.half_length && other.axis.dot(ego.axis) > FOLLOWER_COSINE
}

/// The other would run with its front into the agent's rear half, although it can still stop before that: the vehicle
/// that comes second waits. Without this rule two vehicles that meet at walking pace wait for each other.
fn must_yield(ego: &OrientedBox, swept: &SweptInterval, dt: f64, time: f64) -> bool {
    let front = swept.end.center + swept.end.axis * swept.end.half_length;
    let speed = swept.displacement.dot(swept.end.axis) / dt;
    let is_behind = (front - ego.center).dot(ego.axis) < 0.0;
    is_behind && speed > YIELDING_SPEED && speed <= 2.0 * FIRM_DECELERATION * time
}

/// A pair that overlapped at the start still does at the end of the interval, has done so ever since, and the centres
/// do not approach.
fn is_separating(before: &OrientedBox, ego: &OrientedBox, swept: &SweptInterval) -> bool {
    let other_before = OrientedBox { center: swept.end.center - swept.displacement, ..swept.end };
    let was_together = before.overlaps(&other_before);
    let distance = (ego.center - swept.end.center).norm();
    was_together && distance >= (before.center - other_before.center).norm() - 1e-6
}

/// The exact shapes touch at the end of the interval.
fn touches(other: &Other, request: &PlanRequest, point: &Waypoint) -> bool {
    other.shape.overlaps(other.pose, request.shape, point.pose())
}
