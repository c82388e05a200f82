//! What may come to a junction out of where an agent does not see.

use super::{Drive, World};
use crate::conduct::CRAWLING_SPEED;
use crate::control::Signal;
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::junctions::{AreaKind, Side};
use crate::right_of_way::{Body, DESIGN_WIDTH, SPEED_MAX, Zone, reach};
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// A vehicle that is not seen is taken to be as long as a car [m], and as wide (`DESIGN_WIDTH`).
const HIDDEN_LENGTH: f64 = 4.5;
/// Largest time at the speed limit within which hidden vehicles matter [s], and spacing of examined places [m].
const TIME_MAX: f64 = 10.0;
const LOOK_STEP: f64 = 2.0;
/// Length of the piece of its lane that gives its heading, before it, or behind it where the lane begins [m].
const HEADING_CHORD: f64 = 3.0;

/// A place from which a vehicle may come.
struct Origin {
    /// Position of the area in `Junctions::areas`.
    area: usize,
    pose: Pose,
    /// Until its front is in the area [s].
    time: f64,
}

/// The part of a way to an area that is still to be examined.
struct Stretch {
    lanelet: usize,
    /// Arc length of the front of a vehicle there [m].
    front: f64,
    /// From there to the area [s].
    time: f64,
}

impl World {
    /// For areas ahead in which others go first (all of them, if the agent `goes_last`): how soon a vehicle may enter, at
    /// the speed limit, that a building or a parked vehicle hides from the agent within its radius of sight. What others
    /// hide for a moment the agent has seen before. `seen` are the positions of the bodies that it sees; the bodies come
    /// with their rows.
    pub(super) fn unseen(
        &self,
        scene: &Scene,
        drive: &Drive,
        goes_last: bool,
        seen: &dyn Fn(usize) -> bool,
        (bodies, rows): (&[Body], &[usize]),
    ) -> Vec<(usize, f64)> {
        let (participants, view) = (&scene.participants, &drive.agent.view);
        let may_hide =
            |row: usize| participants.is_static[row] || participants.kind[row] == ParticipantKind::ParkedVehicle;
        let is_careful = view.occlusion && drive.agent.rules.unseen;
        if !is_careful || !scene.present.iter().any(|row| may_hide(*row)) {
            return Vec::new();
        }
        let state = scene.state(drive.row);
        let blocking = |place: usize| bodies[place].velocity < CRAWLING_SPEED && seen(place) && !may_hide(rows[place]);
        let blocking: Vec<&Body> =
            (0..bodies.len()).filter(|place| blocking(*place)).map(|place| &bodies[place]).collect();
        let look = Look { eye: state.pose().position, radius: view.sensor_radius, blocking: &blocking };
        let mut places = Vec::new();
        for &Zone { area, side, .. } in drive.course.zones_ahead(drive.front(), reach(state.velocity)) {
            let found = &self.scenario.junctions().areas[area];
            let goes_first = goes_last || found.first == Some(1 - side);
            if goes_first && found.kind != AreaKind::Opposed {
                self.look_back(area, found.sides[1 - side], &look, &mut places);
            }
        }
        let car = Shape::rectangle(HIDDEN_LENGTH, DESIGN_WIDTH);
        let all: Vec<_> = places.iter().map(|place| (&car, place.pose, false)).collect();
        let is_seen = scene.would_see(drive.row, view, &all, &may_hide);
        let mut earliest: Vec<(usize, f64)> = Vec::new();
        for (place, _) in places.iter().zip(is_seen).filter(|(_, is_seen)| !is_seen) {
            match earliest.iter_mut().find(|(area, _)| *area == place.area) {
                Some((_, time)) => *time = time.min(place.time),
                None => earliest.push((place.area, place.time)),
            }
        }
        earliest
    }

    /// Places on the ways that lead to an area, from there backwards, as far as vehicles can come from them.
    fn look_back(&self, area: usize, side: Side, look: &Look<'_>, places: &mut Vec<Origin>) {
        let road = &self.scenario.road;
        let mut left = vec![Stretch { lanelet: side.lanelet, front: side.entry, time: 0.0 }];
        let mut known: Vec<(usize, f64)> = Vec::new();
        while let Some(Stretch { lanelet, front, mut time }) = left.pop() {
            let here = &road.lanelets()[lanelet];
            let limit = if here.speed_limit.is_nan() { SPEED_MAX } else { here.speed_limit.max(0.1) };
            let mut s = front;
            while s >= 0.0 && time <= TIME_MAX && !look.is_blocked(lanelet, s) {
                let chord = [here.center.at((s - HEADING_CHORD).max(0.0)), here.center.at(s.max(HEADING_CHORD))];
                let heading = (chord[1] - chord[0]).angle();
                let position = here.center.at(s) - Point::from_angle(heading) * (0.5 * HIDDEN_LENGTH);
                if position.distance(look.eye) > look.radius {
                    break;
                }
                places.push(Origin { area, pose: Pose { position, orientation: heading }, time });
                (s, time) = (s - LOOK_STEP, time + LOOK_STEP / limit);
            }
            if s >= 0.0 {
                continue;
            }
            for &before in &here.predecessors {
                // The shortest of several ways counts.
                let is_longer = known.iter().any(|(other, least)| *other == before && *least <= time);
                if !is_longer && !self.is_held(before, lanelet) {
                    known.push((before, time));
                    left.push(Stretch { lanelet: before, front: road.lanelets()[before].length + s, time });
                }
            }
        }
    }

    /// A red light or a stop sign holds vehicles on the way from a lanelet into the next.
    fn is_held(&self, from: usize, next: usize) -> bool {
        let control = &self.scenario.control;
        control.lines.iter().filter(|line| line.lanelet == from).any(|line| {
            let lights = line.lights.iter().find(|(following, _)| *following == next).map(|(_, lights)| &**lights);
            let shown = control.signal(lights.unwrap_or_default(), self.time_step);
            line.has_stop_sign || shown == Signal::Red
        })
    }
}

/// From where an agent looks, how far [m], and what stands in view.
struct Look<'a> {
    eye: Point,
    radius: f64,
    blocking: &'a [&'a Body],
}

impl Look<'_> {
    /// Something in view stands on a lanelet, its front at an arc length or up to a step before [m].
    fn is_blocked(&self, lanelet: usize, s: f64) -> bool {
        let places = self.blocking.iter().flat_map(|body| &body.places).filter(|place| place.lanelet == lanelet);
        places.map(|place| place.s + place.to_front).any(|front| front <= s && front > s - LOOK_STEP)
    }
}
