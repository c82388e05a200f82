//! Traffic on a path: leader, the leader's leader, follower, and crossing participants.

use super::candidate_path::CandidatePath;
use super::surroundings::PresentBody;

/// Gaps are capped at this length [m].
pub const GAP_MAX: f64 = 80.0;
/// CrossingParticipant traffic counts if it reaches the path within this time [s].
const CROSSING_TIME: f64 = 4.0;
/// Slower ones [m/s] cross nothing.
const CROSSING_SPEED: f64 = 0.5;
/// Footprints pass each other on a path if this much room [m] is left.
const PASSING_ROOM: f64 = 0.2;

/// A participant on a path: bumper gap [m], velocity along the path [m/s], offset [m], body.
#[derive(Clone, Copy)]
pub struct OnPath<'a> {
    pub gap: f64,
    pub velocity: f64,
    pub offset: f64,
    pub body: &'a PresentBody,
}

impl OnPath<'_> {
    fn is_before(&self, other: Option<&Self>) -> bool {
        other.is_none_or(|other| self.gap.total_cmp(&other.gap).then(self.body.row.cmp(&other.body.row)).is_lt())
    }
}

/// A participant that crosses a path.
#[derive(Clone, Copy)]
pub struct CrossingParticipant {
    pub s: f64,
    row: usize,
    pub time: f64,
    pub speed: f64,
    pub cos: f64,
    pub sin: f64,
}

/// The relevant participants on a path.
#[derive(Clone, Copy, Default)]
pub struct Traffic<'a> {
    pub leader: Option<OnPath<'a>>,
    pub second: Option<OnPath<'a>>,
    pub follower: Option<OnPath<'a>>,
    pub crossing: Option<CrossingParticipant>,
}

impl<'a> Traffic<'a> {
    /// Adds a participant that is on the path or is going to cross it.
    pub fn meet(&mut self, path: &CandidatePath, own: &PresentBody, other: &'a PresentBody) {
        let reach = own.half_width + other.half_length + PASSING_ROOM;
        let way = other.axis * (other.velocity * CROSSING_TIME);
        let candidates = path.look(other.position, reach, way);
        if let Some((s, offset, segment)) = path.near(other.position, reach, candidates) {
            let along = path.axis_of(segment);
            let (half_along, half_across) = other.half_extent(along);
            if offset.abs() <= own.half_width + half_across + PASSING_ROOM {
                let gap = s.abs() - half_along - own.half_length;
                let velocity = other.velocity * other.axis.dot(along);
                self.on_path(OnPath { gap, velocity, offset, body: other }, s >= 0.0);
                return;
            }
        }
        if other.velocity.abs() < CROSSING_SPEED {
            return;
        }
        if let Some((fraction, s, segment)) = path.crossing(other.position, way, candidates)
            && (0.0..=GAP_MAX).contains(&s)
            && self.crossing.is_none_or(|found| s.total_cmp(&found.s).then(other.row.cmp(&found.row)).is_lt())
        {
            let (along, direction) = (path.axis_of(segment), other.axis * other.velocity.signum());
            let (cos, sin) = (direction.dot(along), along.cross(direction));
            let (time, speed) = (fraction * CROSSING_TIME, other.velocity.abs());
            self.crossing = Some(CrossingParticipant { s, row: other.row, time, speed, cos, sin });
        }
    }

    fn on_path(&mut self, found: OnPath<'a>, is_ahead: bool) {
        if found.gap > GAP_MAX {
            return;
        }
        if !is_ahead {
            if found.is_before(self.follower.as_ref()) {
                self.follower = Some(found);
            }
        } else if found.is_before(self.leader.as_ref()) {
            self.second = self.leader;
            self.leader = Some(found);
        } else if found.is_before(self.second.as_ref()) {
            self.second = Some(found);
        }
    }
}
