//! Giving way to people on crosswalks: which agents wait for whom. It follows from what each agent sees now.

use super::{Drive, World};
use crate::geometry::Point;
use crate::plan::Planner;
use crate::rules::{Hold, LIGHT_DECELERATION, Person};
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// Past steps from which the speed of people is observed.
const PAST: usize = 3;
/// Who began to stop goes on with it, up to this deceleration [m/s²]: brakes need a moment.
const STOPPING: f64 = 4.0;

/// An agent that has to wait before a crosswalk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CrosswalkWait {
    /// The agent.
    id: i64,
    /// Position of the crosswalk on its way.
    crosswalk: usize,
    /// For this participant.
    by: i64,
}

impl World {
    /// Before which crosswalk an agent has to wait.
    pub(super) fn crosswalk_hold(&self, drive: &Drive) -> Option<Hold> {
        if self.has_crosswalks { self.hold_for_people(drive) } else { None }
    }

    #[cold]
    fn hold_for_people(&self, drive: &Drive) -> Option<Hold> {
        let waits = self.waits();
        let wait = &waits[waits.binary_search_by_key(&drive.agent.id, |wait| wait.id).ok()?];
        let distance = drive.way.crosswalks()[wait.crosswalk].entry - drive.front();
        Some(Hold { distance, release: f64::INFINITY, by: Some(wait.by) })
    }

    /// Those who wait now, by ids; a pure function of the present state.
    fn waits(&self) -> &[CrosswalkWait] {
        self.waits.get_or_init(|| self.look_for_people())
    }

    /// Agents remember before which crosswalk they have been told to wait.
    pub(super) fn remember_crosswalks(&mut self) {
        if self.has_crosswalks {
            self.keep_waits();
        }
    }

    #[cold]
    fn keep_waits(&mut self) {
        self.waits();
        let waits = self.waits.take().unwrap_or_default();
        for drive in &mut self.drives {
            let wait = waits.binary_search_by_key(&drive.agent.id, |wait| wait.id).ok();
            drive.crosswalk = wait.map(|place| waits[place].crosswalk);
        }
    }

    #[cold]
    fn look_for_people(&self) -> Vec<CrosswalkWait> {
        let scene = self.scene_with_past(PAST);
        let people: Vec<Option<Person>> = scene.present.iter().map(|row| person(&scene, *row)).collect();
        if people.iter().all(Option::is_none) {
            return Vec::new();
        }
        let positions = scene.positions();
        let mut visible = Vec::new();
        let mut waits = Vec::new();
        for drive in self.drives.iter().filter(|drive| drive.is_driving(self.time_step)) {
            let planner = &drive.agent.planner;
            if drive.way.crosswalks().is_empty() || !(planner.knows_holds() || *planner == Planner::External) {
                continue;
            }
            scene.see(drive.row, &drive.agent.view, &positions, &mut visible);
            waits.extend(self.wait(drive, &scene, &people, &visible));
        }
        waits
    }

    /// The first crosswalk ahead that somebody in sight claims, unless stopping before it takes too much.
    fn wait(
        &self,
        drive: &Drive,
        scene: &Scene,
        people: &[Option<Person>],
        visible: &[usize],
    ) -> Option<CrosswalkWait> {
        let velocity = self.states[drive.row].map_or(0.0, |state| state.velocity.max(0.0));
        let front = drive.front();
        let ahead = drive.way.crosswalks().iter().enumerate().filter(|(_, crosswalk)| crosswalk.entry > front);
        let mut found = ahead.filter_map(|(place, crosswalk)| {
            let deceleration = if drive.crosswalk == Some(place) { STOPPING } else { LIGHT_DECELERATION };
            if velocity * velocity > 2.0 * deceleration * (crosswalk.entry - front) {
                return None;
            }
            let claims = |place: &&usize| people[**place].is_some_and(|person| crosswalk.is_claimed(&person));
            let by = visible.iter().find(claims)?;
            Some(CrosswalkWait { id: drive.agent.id, crosswalk: place, by: self.participants.ids[scene.present[*by]] })
        });
        found.next()
    }
}

/// Whoever is on foot or on a bicycle.
fn person(scene: &Scene, row: usize) -> Option<Person> {
    let participants = &scene.participants;
    let rides = match participants.kind[row] {
        ParticipantKind::Pedestrian => false,
        ParticipantKind::Bicycle => true,
        _ => return None,
    };
    let pose = scene.state(row).pose();
    let velocity = Point::from_angle(pose.orientation) * scene.observed_velocity(row);
    (!participants.is_static[row]).then_some(Person { position: pose.position, velocity, rides })
}
