//! Narrow places beside what stands: zones of the ledger for two agents that pass it from both ends.

use std::collections::BTreeMap;

use super::planning::Crowd;
use super::{Drive, World};
use crate::conduct::STATIONARY_SPEED;
use crate::geometry::Point;
use crate::plan::{Other, Planner, PredictionIndex, narrow_place};
use crate::right_of_way::{Course, Zone};
use crate::scene::{Participants, Scene};
use crate::trajectory::Predictions;

/// The narrow places of two agents are one if they are less than this apart [m].
const APART: f64 = 50.0;
/// How far another path is looked for beside the own one [m], and the cosine of the angle from which on it is opposed.
const ASIDE: f64 = 8.0;
const OPPOSED: f64 = -0.5;
/// A zone begins this far before what the agent itself passes, and before the place where the other one returns to its
/// lane [m].
const BEFORE_OWN: f64 = 6.0;
const BEFORE_OTHER: f64 = 10.0;
/// What stands is looked for up to this distance [m], and for this time at the present speed [s].
const REACH: (f64, f64) = (60.0, 4.0);
/// Number of passages that such zones make, beyond all of the map.
const PASSAGE: usize = usize::MAX / 2;

/// What an agent has to pass over the lane of the other direction, between two arc lengths [m].
#[derive(Clone, Copy)]
struct Narrow<'a> {
    place: usize,
    drive: &'a Drive,
    rear: f64,
    front: f64,
}

impl World {
    /// An agent passes what stands over the lane of the other direction.
    pub(super) fn passes(&self, drive: &Drive) -> bool {
        let rules = &drive.agent.rules;
        matches!(drive.agent.planner, Planner::Rollout(_)) && rules.enabled && rules.passing && !self.reverses(drive)
    }

    /// Two agents that pass what stands are near something that does.
    pub(super) fn may_pass_from_both_ends(&self) -> bool {
        self.are_two_near(&self.what_stands())
    }

    fn are_two_near(&self, standing: &[Point]) -> bool {
        let drives = self.drives.iter().filter(|drive| drive.is_driving(self.time_step));
        !standing.is_empty() && drives.filter(|drive| self.is_near(drive, standing)).take(2).count() == 2
    }

    /// Where vehicles stand that are no agents.
    fn what_stands(&self) -> Vec<Point> {
        let Participants { ids, kind, is_static, .. } = &*self.participants;
        let standing = self.states.iter().enumerate().filter_map(|(row, state)| {
            let state = state.filter(|state| is_static[row] || state.velocity.abs() < STATIONARY_SPEED)?;
            (kind[row].is_on_the_road() && self.drive_index(ids[row]).is_err()).then(|| state.pose().position)
        });
        standing.collect()
    }

    /// An agent may have to pass one of those that stand.
    fn is_near(&self, drive: &Drive, standing: &[Point]) -> bool {
        let Some(own) = self.states[drive.row].filter(|_| self.passes(drive)) else { return false };
        let reach = REACH.0 + REACH.1 * own.velocity.abs();
        standing.iter().any(|position| position.distance(own.pose().position) < reach)
    }

    /// The ways of agents that have to pass what stands while another one does so from the other end, by places among
    /// `obeying`, with zones there that each pair shares. `seen` says by places what they see.
    pub(super) fn narrow_courses<'a>(
        &'a self,
        scene: &Scene,
        obeying: &[Option<&'a Drive>],
        seen: &[Vec<usize>],
    ) -> BTreeMap<usize, Course> {
        let mut found: BTreeMap<usize, Course> = BTreeMap::new();
        let standing = self.what_stands();
        if !self.are_two_near(&standing) {
            return found;
        }
        let crowd = Crowd::of(scene, 0);
        let narrow = |(place, drive): (usize, &Option<&'a Drive>)| {
            let drive = (*drive).filter(|drive| self.is_near(drive, &standing))?;
            let others: Vec<Other<'_>> = seen[place].iter().map(|other| crowd.all[*other]).collect();
            let predictions = Predictions { time_step: self.time_step, ..Predictions::default() };
            let prediction_index = PredictionIndex::of(&predictions, &[]);
            let rules = self.lines(drive);
            let request = self.request_with(drive, &others, (&predictions, &prediction_index), rules);
            let vehicle = &drive.agent.vehicle;
            let s = drive.front() - 0.5 * vehicle.length - vehicle.rear_axle_to_center;
            let (rear, front) = narrow_place(&request, s)?;
            Some(Narrow { place, drive, rear, front })
        };
        let all: Vec<Narrow<'_>> = obeying.iter().enumerate().filter_map(narrow).collect();
        for (i, one) in all.iter().enumerate() {
            for (j, other) in all.iter().enumerate().skip(i + 1) {
                let (Some(own), Some(their)) = (one.shared_with(other), other.shared_with(one)) else { continue };
                let area = PASSAGE + i * all.len() + j;
                for (side, (narrow, stretch)) in [(one, own), (other, their)].into_iter().enumerate() {
                    let course = found.entry(narrow.place).or_insert_with(|| (*narrow.drive.course).clone());
                    course.add(Zone::between(area, side, stretch), PASSAGE, narrow.drive.limited_way());
                }
            }
        }
        found
    }
}

impl Narrow<'_> {
    /// Arc lengths of the zone that it shares with an oncoming agent near by [m].
    fn shared_with(&self, other: &Self) -> Option<(f64, f64)> {
        let (path, theirs) = (&self.drive.agent.route.path, &other.drive.agent.route.path);
        let foot = |s: f64| {
            let there = theirs.at(s);
            let (s, d) = path.project(there.position)?;
            let is_opposed = path.at(s).tangent().dot(there.tangent()) < OPPOSED;
            (is_opposed && d.abs() < ASIDE).then_some(s)
        };
        let (first, last) = (foot(other.front)?, foot(other.rear)?);
        let is_near = first < self.front + APART && last > self.rear - APART;
        let from = (self.rear - BEFORE_OWN).min(first - BEFORE_OTHER);
        let to = (self.front + BEFORE_OTHER).max(last + BEFORE_OWN);
        is_near.then_some((from, to))
    }
}
