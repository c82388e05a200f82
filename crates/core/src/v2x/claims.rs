//! Negotiation by claims: agents whose ways cross claim the road that both need, and one total order, which all compute
//! alike, decides which goes first. Agents that yield know of a bar across their own path; nothing else is imposed.
//!
//! Claims of agents in conflict without infrastructure: Van Middlesworth, Dresner, Stone, AAMAS 2008. Order of arrival:
//! Shah et al., arXiv 2304.04958. A pairwise rule could let three wait in a circle; the total order cannot: the least claim
//! yields to none, so its agent goes, its claim ends, and the next one is the least.

mod bar;
mod lane;
mod order;
mod overlap;
mod zone;

use crate::conduct::COMFORTABLE_DECELERATION;
use std::cell::OnceCell;
use std::sync::Arc;

use super::V2xSettings;
use super::inbox::Inbox;
use super::message::{Claim, Message, Payload, PlanPoint};
use crate::barrier::{Barrier, BarrierReason};
use crate::geometry::Pose;
use crate::geometry::polyline::ReferencePath;
use crate::scene::Storeys;
pub use bar::{Agreement, Bar};
use bar::{bar, note};
use lane::Lane;
pub(crate) use lane::Neighbour;
pub(crate) use order::Crossing;
use order::{Claimant, before};
use zone::{Zone, zones};

/// An agent claims within this distance of the zone [m], and the way in which it stops.
const CLAIM_DISTANCE: f64 = 40.0;
/// Slower arrivals count as this fast [m/s].
const SLOWEST: f64 = 2.0;
/// One behind another one arrives this much later [s].
const HEADWAY: f64 = 2.0;
/// An agent this far from its reference path [m] does not claim.
const OFF_PATH: f64 = 1.5;
/// A claim ends when there was no zone for this long [s].
const NO_ZONE: f64 = 1.0;
/// Room that an agent needs behind a zone besides its length [m].
const ROOM: f64 = 2.0;
/// An agent that stands for this long [s] although it yields to none claims anew.
const PATIENCE: f64 = 8.0;
/// Below this speed [m/s] it stands.
const STANDING: f64 = 0.3;

/// An equipped agent that drives now.
#[derive(Debug)]
pub(crate) struct Negotiator<'a> {
    pub(crate) place: usize,
    pub(crate) id: i64,
    pub(crate) path: &'a ReferencePath,
    /// Arc lengths of its rear end and front on its path, and its offset [m].
    pub(crate) rear: f64,
    pub(crate) front: f64,
    pub(crate) offset: f64,
    pub(crate) pose: Pose,
    pub(crate) velocity: f64,
    /// Length and width [m].
    pub(crate) extent: (f64, f64),
    /// Where ways cross one above the other.
    pub(crate) storeys: &'a Storeys,
    /// Junction areas on its path.
    pub(crate) crossings: &'a [Crossing],
    /// It enters junctions by the order of the rules.
    pub(crate) is_ordered: bool,
    /// Arc length on its path that its front must not pass now by the rules [m].
    pub(crate) line: f64,
}

/// What an agent has claimed, and why it holds.
#[derive(Debug, Clone, Default)]
pub(super) struct Standpoint {
    /// Number of its last claim.
    n: i64,
    /// Time step at which it expects to arrive, while its claim lasts, and where the last zone of it ends [m].
    claimed: Option<(i64, f64)>,
    /// What it tells.
    pub(super) claim: Option<Claim>,
    pub(super) yields_to: Vec<i64>,
    pub(super) passes: Vec<i64>,
    pub(super) areas: Vec<(usize, usize)>,
    pub(super) is_ordered: bool,
    pub(super) bar: Option<Bar>,
    /// Last time step with a zone.
    last_zone: i64,
    /// Steps that it has stood without yielding.
    stood: u32,
    /// It does not use its right of way.
    is_waived: bool,
}

/// What an agent needs to know at a time step.
pub(super) struct Situation<'a> {
    pub(super) now: i64,
    pub(super) dt: f64,
    pub(super) settings: &'a V2xSettings,
    /// By area of a junction: the side that goes first by the rules of the road.
    pub(super) first: &'a [Option<usize>],
}

impl Negotiator<'_> {
    /// The junction areas on the way that it tells, and its side of each, ascending.
    fn areas(&self, situation: &Situation<'_>) -> impl Iterator<Item = (usize, usize)> {
        let end = self.rear + situation.settings.way_ahead;
        let on_way = self.crossings.iter().filter(move |one| one.exit > self.rear && one.entry < end);
        on_way.map(|one| (one.area, one.side))
    }
}

/// The newest plan of every other agent whose way may meet that of the agent.
fn plans(inbox: &Inbox, own: usize) -> impl Iterator<Item = (usize, &Arc<Message>)> {
    let heard = inbox.heard.iter().enumerate().filter(move |(sender, _)| *sender != own);
    heard.filter_map(|(sender, heard)| Some((sender, heard.mcm.as_ref()?)))
}

impl Standpoint {
    /// Renews the claim, the agents to yield to and the bar. `around` gives the participants that the agent knows of.
    pub(super) fn renew(
        &mut self,
        agent: &Negotiator<'_>,
        inbox: &Inbox,
        situation: &Situation<'_>,
        around: &dyn Fn() -> Vec<Neighbour>,
        agreements: &mut Vec<Agreement>,
    ) {
        let Situation { now, dt, .. } = *situation;
        let yielded = std::mem::take(&mut self.yields_to);
        let has_held = self.bar.take().is_some();
        self.passes.clear();
        self.is_ordered = agent.is_ordered;
        self.areas.clear();
        self.areas.extend(agent.areas(situation));
        self.is_waived &= agent.velocity < STANDING;
        let known = OnceCell::new();
        let around = || known.get_or_init(around).as_slice();
        let zones = zones(agent, &self.areas, inbox, situation, &around);
        if zones.is_empty() {
            if self.claimed.is_some() && (now - self.last_zone) as f64 * dt >= NO_ZONE - 1e-9 {
                self.claimed = None;
            }
            self.claim = None;
            self.stood = 0;
            return;
        }
        self.last_zone = now;
        if self.claimed.is_some_and(|(_, end)| agent.rear > end) {
            self.claimed = None;
        }
        let begin = zones.iter().map(|zone| zone.begin).fold(f64::INFINITY, f64::min);
        let end = zones.iter().map(|zone| zone.end).fold(0.0, f64::max);
        let lane = Lane::of(agent, around());
        let stopping = agent.velocity.powi(2) / (2.0 * COMFORTABLE_DECELERATION);
        let is_passed = |begin: f64| {
            agent.front > begin || (begin - agent.front < stopping && lane.next(agent.front, begin).is_none())
        };
        self.passes.extend(zones.iter().filter(|zone| is_passed(zone.passage.0)).map(|zone| zone.id));
        let arrival_of = |place: usize| match inbox.heard[place].mcm.as_ref().map(|message| &message.payload) {
            Some(Payload::Mcm { claim: Some(claim), .. }) => Some(claim.arrival),
            _ => None,
        };
        // One with a claim may be ahead, one without makes claims pointless.
        let after = match lane.next(agent.front, begin) {
            None => Some(i64::MIN),
            Some(other) => other.place.and_then(arrival_of).map(|arrival| arrival + (HEADWAY / dt).ceil() as i64),
        };
        let is_near = begin - agent.front <= CLAIM_DISTANCE + stopping && agent.offset.abs() < OFF_PATH;
        if let (None, Some(after), true) = (self.claimed, after, is_near || !self.passes.is_empty()) {
            self.claim_anew(agent, begin, end, (now, dt), after);
        }
        if let Some((_, until)) = &mut self.claimed {
            *until = until.max(end);
        }
        let is_waived = self.is_waived;
        let claim = |(arrival, _)| Claim { n: self.n, arrival, is_waived };
        // An agent that the rules stop before the zone does not claim it now.
        self.claim = self.claimed.filter(|_| agent.line >= begin || !self.passes.is_empty()).map(claim);
        let first = self.first(agent, &zones, inbox, &yielded, situation.first);
        self.yields_to.extend(first.iter().map(|zone| zone.id));
        let contested = first.iter().filter(|zone| zone.is_contested(has_held) && !self.passes.contains(&zone.id));
        let mut stop = Zone::barrier(agent, contested);
        let ahead = zones.iter().map(|zone| zone.passage).filter(|passage| !is_passed(passage.0));
        if let Some((entry_line, exit)) = ahead.min_by(|a, b| a.0.total_cmp(&b.0))
            && stop.is_none_or(|stop| entry_line <= stop.s)
            && lane.is_blocked(entry_line.max(agent.front), exit + agent.extent.0 + ROOM)
        {
            stop = Some(Barrier::lasting(entry_line, BarrierReason::Agreement));
            if self.passes.is_empty() {
                self.claim = None;
            }
        }
        self.stood = if stop.is_some() || agent.velocity >= STANDING { 0 } else { self.stood + 1 };
        if f64::from(self.stood) * dt >= PATIENCE && self.claimed.is_some() && self.passes.is_empty() {
            self.claim_anew(agent, begin, end, (now, dt), now + 1);
            (self.stood, self.is_waived) = (0, true);
        }
        if let Some(stop) = stop {
            let bar = bar(agent, &stop, stopping, situation);
            self.bar = Some(bar);
            let (holding, going, claim) = (agent.id, stop.by, self.n);
            note(agreements, Agreement { holding, going, first: now, last: now, bar: bar.pose, claim });
        }
    }

    /// The zones with others that go first. An agent without a claim lets all go that have one.
    fn first(
        &self,
        agent: &Negotiator<'_>,
        zones: &[Zone],
        inbox: &Inbox,
        yielded: &[i64],
        first: &[Option<usize>],
    ) -> Vec<Zone> {
        let Some(claim) = self.claim else {
            return zones.iter().filter(|zone| zone.claim.is_some()).copied().collect();
        };
        let mut all =
            vec![Claimant { id: agent.id, claim, areas: &self.areas, yields_to: yielded, passes: &self.passes }];
        all.extend(plans(inbox, agent.place).filter_map(|(_, message)| match &message.payload {
            Payload::Mcm { claim: Some(claim), areas, yields_to, passes, .. } => {
                Some(Claimant { id: message.sender, claim: *claim, areas, yields_to, passes })
            }
            _ => None,
        }));
        let goes = before(&all, 0, first);
        let is_first = |zone: &&Zone| all.iter().zip(&goes).any(|(one, goes)| *goes && one.id == zone.id);
        zones.iter().filter(is_first).copied().collect()
    }

    fn claim_anew(&mut self, agent: &Negotiator<'_>, begin: f64, end: f64, (now, dt): (i64, f64), after: i64) {
        let time = (begin - agent.front).max(0.0) / agent.velocity.max(SLOWEST);
        self.n += 1;
        self.claimed = Some(((now + (time / dt).ceil() as i64).max(after), end));
    }
}

/// A point of a way as a pose.
fn pose(point: &PlanPoint) -> Pose {
    Pose::new(point.x, point.y, point.orientation)
}
