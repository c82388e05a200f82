//! Which agents give way to which people on crosswalks. It follows from what each agent sees now, and from where it
//! waited at the last step.

use super::{Drive, World};
use crate::barrier::{Barrier, BarrierReason};
use crate::conduct::{EXPECTED_DECELERATION, FIRM_DECELERATION};
use crate::plan::Planner;
use crate::recording::Wait;
use crate::right_of_way::{OrderKind, reach};
use crate::rules::{Crosswalk, uses_crosswalks};
use crate::scene::{Participants, Scene};
use crate::trajectory::State;

/// Past steps from which the speed of people is observed.
const PAST: usize = 3;

impl World {
    /// The crosswalk before which an agent has to wait.
    pub(super) fn crosswalk_ahead(&self, drive: &Drive) -> Option<Barrier> {
        if self.has_crosswalks { self.wait_for_people(drive) } else { None }
    }

    #[cold]
    fn wait_for_people(&self, drive: &Drive) -> Option<Barrier> {
        let waits = self.waits();
        let place = waits.binary_search_by_key(&drive.agent.id, |(id, ..)| *id).ok()?;
        Some(waits[place].2)
    }

    /// Agents that have to wait now, by ids, with the position of the crosswalk on their way; a pure function of the present
    /// state.
    fn waits(&self) -> &[(i64, usize, Barrier)] {
        self.waits.get_or_init(|| self.look_for_people())
    }

    /// Agents remember before which crosswalk they have been told to wait; that is recorded.
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
            let wait = waits.binary_search_by_key(&drive.agent.id, |(id, ..)| *id).ok().map(|place| waits[place]);
            drive.crosswalk = wait.map(|(_, crosswalk, _)| crosswalk);
            if let Some((agent, _, Barrier { s: stop, by, .. })) = wait.filter(|_| self.settings.keep_recording) {
                let (first, last, kind) = (self.time_step, self.time_step, OrderKind::Crosswalk as u8);
                self.recording.push_wait(Wait { agent, first, last, kind, by, stop });
            }
        }
    }

    #[cold]
    fn look_for_people(&self) -> Vec<(i64, usize, Barrier)> {
        let is_near = |drive: &&Drive| {
            let planner = &drive.agent.planner;
            let obeys = planner.heeds_barriers() || *planner == Planner::External;
            obeys && drive.is_driving(self.time_step) && self.crosswalks_near(drive).next().is_some()
        };
        let near: Vec<&Drive> = self.drives.iter().filter(is_near).collect();
        if near.is_empty() {
            return Vec::new();
        }
        let scene = self.scene_with_past(PAST);
        let people: Vec<Option<State>> = scene.present.iter().map(|row| person(&scene, *row)).collect();
        if people.iter().all(Option::is_none) {
            return Vec::new();
        }
        let index = scene.position_index(near.len());
        let mut visible = Vec::new();
        let mut waits = Vec::new();
        for drive in near {
            scene.see(drive.row, &drive.agent.view, &index, &mut visible);
            waits.extend(self.wait(drive, &scene, &people, &visible));
        }
        waits
    }

    fn speed(&self, drive: &Drive) -> f64 {
        self.states[drive.row].map_or(0.0, |state| state.velocity.max(0.0))
    }

    /// The crosswalks ahead that an agent cares about already, with their positions on its way.
    fn crosswalks_near<'a>(&self, drive: &'a Drive) -> impl Iterator<Item = (usize, &'a Crosswalk)> + use<'a> {
        let front = drive.front();
        let end = front + reach(self.speed(drive));
        let all = drive.way.crosswalks().iter().enumerate();
        all.filter(move |(_, crosswalk)| crosswalk.entry > front && crosswalk.entry <= end)
    }

    /// The first crosswalk ahead that a person in sight uses, unless stopping before it takes too much.
    fn wait(
        &self,
        drive: &Drive,
        scene: &Scene,
        people: &[Option<State>],
        visible: &[usize],
    ) -> Option<(i64, usize, Barrier)> {
        let (velocity, front) = (self.speed(drive), drive.front());
        let mut found = self.crosswalks_near(drive).filter_map(|(place, crosswalk)| {
            // An agent that began to stop goes on with it: brakes need a moment.
            let deceleration = if drive.crosswalk == Some(place) { FIRM_DECELERATION } else { EXPECTED_DECELERATION };
            if velocity * velocity > 2.0 * deceleration * (crosswalk.entry - front) {
                return None;
            }
            let kind = |place: usize| self.participants.kind[scene.present[place]];
            let uses =
                |place: &&usize| people[**place].is_some_and(|person| crosswalk.is_used_by(kind(**place), &person));
            let by = Some(self.participants.ids[scene.present[*visible.iter().find(uses)?]]);
            let barrier = Barrier { by, ..Barrier::lasting(crosswalk.entry, BarrierReason::Crosswalk) };
            Some((drive.agent.id, place, barrier))
        });
        found.next()
    }
}

/// Some participant may use a crosswalk.
pub(super) fn any_people(participants: &Participants) -> bool {
    participants.kind.iter().zip(&participants.is_static).any(|(kind, is_static)| uses_crosswalks(*kind) && !is_static)
}

/// How a participant moves that may use a crosswalk.
fn person(scene: &Scene, row: usize) -> Option<State> {
    let participants = &scene.participants;
    let may_cross = uses_crosswalks(participants.kind[row]) && !participants.is_static[row];
    may_cross.then(|| State { velocity: scene.observed_velocity(row), ..scene.state(row) })
}
