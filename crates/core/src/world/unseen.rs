//! What may come to a junction out of where an agent does not see.

use super::{Drive, World};
use crate::control::Signal;
use crate::geometry::Pose;
use crate::geometry::shape::Shape;
use crate::junctions::AreaKind;
use crate::rules::{Body, SPEED_MAX, Unseen, reach};
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// A vehicle that is not seen is taken to be as large as a car [m].
const LENGTH: f64 = 4.5;
const WIDTH: f64 = 1.8;
/// What is further away than this time at the limit does not matter [s]; places are examined this far apart [m].
const TIME_MAX: f64 = 10.0;
const STEP: f64 = 2.0;
/// Its heading is that of a piece of its lane at least so long [m].
const CHORD: f64 = 0.5;
/// A vehicle that is slower than this holds those behind it [m/s].
const BLOCKING: f64 = 1.0;

/// A place from which a vehicle may come.
struct Station {
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
    /// For areas of the next passage in which others go first: how soon a vehicle may enter, at the speed limit, that a
    /// building or a parked vehicle hides from the agent within its radius of sight. What others hide for a moment the
    /// agent has seen before. `seen` are the bodies that it sees.
    pub(super) fn unseen(
        &self,
        scene: &Scene,
        drive: &Drive,
        seen: &dyn Fn(usize) -> bool,
        bodies: &[Body],
    ) -> Vec<Unseen> {
        let (participants, view) = (&scene.participants, &drive.agent.view);
        let may_hide =
            |row: usize| participants.is_static[row] || participants.kind[row] == ParticipantKind::ParkedVehicle;
        if !view.occlusion || !scene.present.iter().any(|row| may_hide(*row)) {
            return Vec::new();
        }
        let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity);
        let Some(areas) = drive.course.next_areas(drive.front(), drive.agent.vehicle.length, reach(velocity)) else {
            return Vec::new();
        };
        let junctions = self.scenario.junctions();
        let mut stations = Vec::new();
        for (area, side) in areas {
            let found = &junctions.areas[area];
            if found.first == Some(1 - side) && found.kind != AreaKind::Opposed {
                let theirs = found.sides[1 - side];
                self.look_back(area, (theirs.lanelet, theirs.entry), seen, bodies, &mut stations);
            }
        }
        let eye = scene.state(drive.row).pose().position;
        stations.retain(|station| station.pose.position.distance(eye) <= view.sensor_radius);
        let car = Shape::rectangle(LENGTH, WIDTH);
        let all: Vec<_> = stations.iter().map(|station| (&car, station.pose, false)).collect();
        let is_seen = scene.would_see(drive.row, view, &all, &may_hide);
        let mut earliest: Vec<Unseen> = Vec::new();
        for (station, _) in stations.iter().zip(is_seen).filter(|(_, is_seen)| !is_seen) {
            match earliest.iter_mut().find(|one| one.area == station.area) {
                Some(one) => one.time = one.time.min(station.time),
                None => earliest.push(Unseen { area: station.area, time: station.time }),
            }
        }
        earliest
    }

    /// Places on the ways that lead to an area, from there backwards, as far as vehicles can come from them.
    fn look_back(
        &self,
        area: usize,
        (lanelet, entry): (usize, f64),
        seen: &dyn Fn(usize) -> bool,
        bodies: &[Body],
        stations: &mut Vec<Station>,
    ) {
        let road = &self.scenario.road;
        let blocks = |lanelet: usize, front: f64| {
            let stands = |body: &Body| body.velocity < BLOCKING;
            let there = |body: &Body| {
                let on = body.places.iter().filter(|place| place.lanelet == lanelet);
                on.map(|place| place.s + place.to_front).any(|s| s <= front && s > front - STEP)
            };
            bodies.iter().enumerate().any(|(place, body)| stands(body) && there(body) && seen(place))
        };
        let mut left = vec![Stretch { lanelet, front: entry, time: 0.0 }];
        while let Some(Stretch { lanelet, front, mut time }) = left.pop() {
            let here = &road.lanelets()[lanelet];
            let limit = if here.speed_limit.is_nan() { SPEED_MAX } else { here.speed_limit.max(0.1) };
            let mut s = front;
            while s >= 0.0 && time <= TIME_MAX && !blocks(lanelet, s) {
                let (rear, front) = ((s - LENGTH).max(0.0), s.max(CHORD));
                let (rear, front) = (here.center.at(rear), here.center.at(front));
                let pose = Pose { position: rear.lerp(front, 0.5), orientation: (front - rear).angle() };
                stations.push(Station { area, pose, time });
                (s, time) = (s - STEP, time + STEP / limit);
            }
            if s >= 0.0 {
                continue;
            }
            let before = here.predecessors.iter().filter(|before| !self.is_held(**before, lanelet));
            left.extend(before.map(|before| {
                let length = road.lanelets()[*before].length;
                Stretch { lanelet: *before, front: length + s, time }
            }));
        }
    }

    /// A light or a stop sign at a line holds those who come from a lanelet into the next one.
    fn is_held(&self, from: usize, next: usize) -> bool {
        let control = &self.scenario.control;
        control.lines.iter().filter(|line| line.lanelet == from).any(|line| {
            let lights = line.lights.iter().find(|(following, _)| *following == next).map(|(_, lights)| &**lights);
            let shown = control.signal(lights.unwrap_or_default(), self.time_step);
            line.has_stop_sign || matches!(shown, Signal::Red | Signal::Yellow)
        })
    }
}
