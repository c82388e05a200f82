//! The others as they would go on with their present speeds and headings, in the world and along the path.

use super::super::{Other, PlanRequest};
use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::geometry::shape::OrientedBox;
use crate::vehicle::ParticipantKind;

/// Leaders are looked up at multiples of this time [s].
const LOOK_TIME: f64 = 0.2;
/// The foot of a participant moves by at most this between two looks [m].
const FOOT_WINDOW: f64 = 20.0;

/// A participant, or a part of a structure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    /// Position in the request's `others`.
    pub(super) other: usize,
    /// Where it is now.
    pub(super) now: OrientedBox,
    /// How it moves [m/s].
    pub(super) motion: Point,
    pub(super) speed: f64,
    /// Of its box [m].
    pub(super) radius: f64,
    /// A road user; hitting anything else is half as bad.
    pub(super) is_road_user: bool,
    /// It touches the agent already.
    pub(super) touches: bool,
}

impl Body {
    /// Where it is after a time [s].
    pub(super) fn at(&self, time: f64) -> OrientedBox {
        OrientedBox { center: self.now.center + self.motion * time, ..self.now }
    }
}

/// A body beside the path.
#[derive(Debug, Clone, Copy)]
struct Foot {
    /// Arc length of its centre, and of its nearest edge [m].
    s: f64,
    low: f64,
    /// Offset of its centre, and half its extent across [m].
    d: f64,
    half_d: f64,
    /// Speed along the path; negative if it comes towards the agent [m/s].
    velocity: f64,
}

impl Foot {
    fn of(body: &Body, time: f64, path: &ReferencePath, s_expected: f64, window: f64) -> Option<Self> {
        let place = body.at(time);
        let (s, d, at) = path.project_from(place.center, s_expected, window)?;
        let tangent = at.tangent();
        let (along, across) = (tangent.dot(place.axis).abs(), tangent.cross(place.axis).abs());
        let half_s = place.half_length * along + place.half_width * across;
        let half_d = place.half_length * across + place.half_width * along;
        Some(Self { s, low: s - half_s, d, half_d, velocity: tangent.dot(body.motion) })
    }
}

/// A leader on a path beside the middle of the lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leader {
    /// Arc length of its rear [m].
    pub(super) low: f64,
    /// Speed along the path [m/s].
    pub(super) velocity: f64,
}

/// All that the agent may meet; the memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Forecast {
    pub(super) bodies: Vec<Body>,
    /// Feet of each body in turn, one per look.
    feet: Vec<Option<Foot>>,
    looks: usize,
}

impl Forecast {
    /// Participants within a radius [m], over a horizon [s], for an agent at an arc length [m].
    pub(super) fn fill(&mut self, request: &PlanRequest, radius: f64, horizon: f64, s: f64) {
        self.bodies.clear();
        self.feet.clear();
        self.looks = (horizon / LOOK_TIME + 1e-9) as usize + 1;
        let own = OrientedBox::new(request.state.pose(), request.vehicle.length, request.vehicle.width);
        for (index, other) in request.others.iter().enumerate() {
            if other.is_static {
                for (part, _) in other.shape.parts().iter().map(|part| part.tightest_box(other.pose)) {
                    self.add(request, (index, other, part), (&own, radius), s);
                }
            } else {
                let now = other.shape.oriented_box(other.pose);
                self.add(request, (index, other, now), (&own, radius), s);
            }
        }
    }

    fn add(
        &mut self,
        request: &PlanRequest,
        (index, other, now): (usize, &Other, OrientedBox),
        (own, radius): (&OrientedBox, f64),
        s: f64,
    ) {
        let reach = now.radius();
        let apart = now.center - own.center;
        if apart.norm() - reach > radius {
            return;
        }
        let speed = if other.is_static { 0.0 } else { other.velocity };
        let body = Body {
            other: index,
            now,
            motion: Point::from_angle(other.pose.orientation) * speed,
            speed: speed.abs(),
            radius: reach,
            is_road_user: other.kind.is_on_the_road() && !(other.is_static && other.kind == ParticipantKind::Unknown)
                || other.kind == ParticipantKind::Pedestrian,
            touches: now.overlaps(own),
        };
        let path = &request.route.path;
        let expected = s + apart.dot(path.at(s).tangent());
        let mut before = None;
        for look in 0..self.looks {
            let (near, window) = before.map_or((expected, radius + reach), |foot: Foot| (foot.s, FOOT_WINDOW));
            let foot = if look > 0 && body.speed == 0.0 {
                before
            } else {
                Foot::of(&body, look as f64 * LOOK_TIME, path, near, window)
            };
            before = foot.or(before);
            self.feet.push(foot);
        }
        self.bodies.push(body);
    }

    /// The nearest leader after a time [s] of a vehicle this wide [m] on a path at an offset, whose rear axle is at an arc
    /// length [m].
    pub(super) fn leader(&self, time: f64, s: f64, offset: f64, width: f64) -> Option<Leader> {
        let look = ((time / LOOK_TIME + 1e-9) as usize).min(self.looks - 1);
        let mut nearest: Option<Leader> = None;
        for (body, feet) in self.bodies.iter().zip(self.feet.chunks_exact(self.looks)) {
            let Some(foot) = feet[look].filter(|_| !body.touches) else { continue };
            let is_in_way = (foot.d - offset).abs() < foot.half_d + 0.5 * width && foot.s > s;
            if is_in_way && nearest.is_none_or(|leader| foot.low < leader.low) {
                nearest = Some(Leader { low: foot.low, velocity: foot.velocity });
            }
        }
        nearest
    }
}
