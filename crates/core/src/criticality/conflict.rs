//! Conflict areas: where the lanelets of two vehicles cross inside an intersection, when each participant is there, and the measures
//! that follow: encroachment time, post-encroachment time, and the distance that remains.

use std::collections::BTreeMap;

use super::evaluation_step::{Decisive, Via};
use super::overlap::{Area, Overlaps};
use super::traffic::{ALONG_ANGLE, LaneletTrack, Traffic};
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose};
use crate::road::RoadNetwork;

/// A lanelet that leads across an intersection, and the incoming lane it belongs to; once per incoming.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Connector {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Number of the incoming, unique among all intersections.
    pub incoming: i64,
}

/// Lanelets that cross or join others although they do not come from the same one: for maps that state no
/// intersections.
pub(super) fn crossing_connectors(road: &RoadNetwork, overlaps: &Overlaps) -> Vec<Connector> {
    let lanelets = road.lanelets();
    let mut found = Vec::new();
    for (i, lanelet) in lanelets.iter().enumerate() {
        let crosses = (0..lanelets.len()).any(|j| {
            let other = &lanelets[j];
            j != i
                && overlaps.of(i, j)
                && !lanelet.successors.contains(&j)
                && !lanelet.predecessors.contains(&j)
                && !lanelet.predecessors.iter().any(|before| other.predecessors.contains(before))
        });
        if crosses && lanelet.predecessors.is_empty() {
            found.push(Connector { lanelet: i, incoming: -1 - i as i64 });
        } else if crosses {
            found.extend(lanelet.predecessors.iter().map(|p| Connector { lanelet: i, incoming: *p as i64 }));
        }
    }
    found
}

/// Which participants use which connector.
pub(super) struct Conflicts<'a> {
    traffic: &'a Traffic,
    overlap_min: f64,
    incomings: BTreeMap<usize, Vec<i64>>,
    /// Per row: connectors on its route, ascending.
    of_row: Vec<Vec<usize>>,
    /// Rows with that connector on their route, ascending.
    users: BTreeMap<usize, Vec<usize>>,
    areas: BTreeMap<usize, Area>,
}

/// When a footprint is in an area, as columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stay {
    enter: usize,
    /// First column at which it is out again; `None` if it never is.
    out: Option<usize>,
}

/// What conflict areas say about one vehicle.
#[derive(Debug, Clone)]
pub(super) struct Encroachment {
    pub et: Decisive,
    pub et_series: Vec<Decisive>,
    /// It was in the area of `et` from its first state on.
    pub is_left_censored: bool,
    pub pet: Decisive,
    pub pet_series: Vec<Decisive>,
    /// Row of the participant that was first in the area of `pet`.
    pub pet_first: u32,
    /// Remaining distance to the nearest area that it enters [m], 0 inside, infinite without one; per column.
    pub remaining: Vec<Decisive>,
    /// It is still before the nearest area.
    pub is_before: Vec<bool>,
}

impl<'a> Conflicts<'a> {
    pub(super) fn new(
        traffic: &'a Traffic,
        tracks: &[LaneletTrack],
        connectors: &[Connector],
        overlap_min: f64,
    ) -> Self {
        let mut incomings: BTreeMap<usize, Vec<i64>> = BTreeMap::new();
        for connector in connectors {
            incomings.entry(connector.lanelet).or_default().push(connector.incoming);
        }
        let of_row: Vec<Vec<usize>> =
            (0..tracks.len()).map(|row| connectors_of(traffic, &tracks[row], row, &incomings)).collect();
        let mut users: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (row, connectors) in of_row.iter().enumerate() {
            for connector in connectors {
                users.entry(*connector).or_default().push(row);
            }
        }
        let lanelets = traffic.road.lanelets();
        let areas = users.keys().map(|lanelet| (*lanelet, Area::of_lanelet(&lanelets[*lanelet]))).collect();
        Self { traffic, overlap_min, incomings, of_row, users, areas }
    }

    /// Where two connectors from different incomings overlap.
    fn area(&self, own: usize, other: usize) -> Option<(Shape, Point)> {
        let share_incoming = self.incomings[&own].iter().any(|incoming| self.incomings[&other].contains(incoming));
        if own == other || share_incoming {
            return None;
        }
        let (first, second) = (own.min(other), own.max(other));
        let common = self.areas[&first].intersection(&self.areas[&second]);
        let (shape, origin) = common.shape().filter(|_| common.size() > self.overlap_min)?;
        (!self.traffic.road.lanelets_are_apart([own, other], origin)).then_some((shape, origin))
    }

    fn stay(&self, row: usize, (area, origin): &(Shape, Point)) -> Option<Stay> {
        let traffic = self.traffic;
        let (first, last) = traffic.span(row)?;
        let shape = &traffic.shape[row];
        let place = Pose { position: *origin, orientation: 0.0 };
        let is_in = |column: &usize| area.overlaps(place, shape, traffic.pose(row, *column));
        let mut columns = (first..=last).filter(|column| traffic.is_there(row, *column));
        let enter = columns.by_ref().find(is_in)?;
        Some(Stay { enter, out: columns.find(|column| !is_in(column)) })
    }

    /// Column at which the area is free again; `None` if it stays occupied to the end.
    fn free_at(&self, row: usize, stay: Stay) -> Option<usize> {
        let (_, last) = self.traffic.span(row).expect("a participant in an area is present");
        stay.out.or((last + 1 < self.traffic.states.n_steps).then_some(last + 1))
    }

    /// Encroachment of one vehicle over all its conflict areas.
    pub(super) fn of(&self, row: usize) -> Encroachment {
        let n = self.traffic.states.n_steps;
        let dt = self.traffic.dt;
        let far = Decisive::without_partner(f64::INFINITY);
        let mut found = Encroachment {
            et: far,
            et_series: vec![far; n],
            is_left_censored: false,
            pet: far,
            pet_series: vec![far; n],
            pet_first: u32::MAX,
            remaining: vec![far; n],
            is_before: vec![false; n],
        };
        let Some((first, last)) = self.traffic.span(row) else { return found };
        let mut unfinished = vec![None; n];
        let mut is_unfinished = None;
        let ways = self.way_lengths(row);
        for &own in &self.of_row[row] {
            for (&other, users) in &self.users {
                let Some(&partner) = users.iter().find(|user| **user != row) else { continue };
                let Some(area) = self.area(own, other) else { continue };
                let Some(stay) = self.stay(row, &area) else { continue };
                let via = Via::ConflictArea(own as u32, other as u32);
                if let Some(out) = stay.out {
                    let time = (out - stay.enter) as f64 * dt;
                    if time < found.et.value {
                        found.is_left_censored = stay.enter == first;
                    }
                    found.et.keep_smaller(time, partner as u32, via);
                    for column in first..out.min(last + 1) {
                        let rest = (out - column.max(stay.enter)) as f64 * dt;
                        found.et_series[column].keep_smaller(rest, partner as u32, via);
                    }
                } else {
                    let unknown = Decisive { value: f64::NAN, partner: partner as u32, via };
                    is_unfinished.get_or_insert(unknown);
                    for column in &mut unfinished[first..=last] {
                        column.get_or_insert(unknown);
                    }
                }
                for column in first..stay.out.unwrap_or(last + 1) {
                    let before = stay.enter.saturating_sub(1).max(column);
                    let distance = if column >= stay.enter { 0.0 } else { ways[before] - ways[column] };
                    if distance < found.remaining[column].value {
                        found.is_before[column] = column < stay.enter;
                    }
                    found.remaining[column].keep_smaller(distance, partner as u32, via);
                }
                for &user in users.iter().filter(|user| **user != row) {
                    if let Some(other_stay) = self.stay(user, &area) {
                        self.compare(row, stay, user, other_stay, via, (first, last), &mut found);
                    }
                }
            }
        }
        // A known value counts before an unknown one.
        let replace = |value: &mut Decisive, unknown: Option<Decisive>| {
            if let (true, Some(unknown)) = (value.value == f64::INFINITY, unknown) {
                *value = unknown;
            }
        };
        replace(&mut found.et, is_unfinished);
        for (value, unknown) in found.et_series.iter_mut().zip(unfinished) {
            replace(value, unknown);
        }
        found
    }

    /// Post-encroachment time of a pair in one area.
    #[allow(clippy::too_many_arguments, reason = "two vehicles with their stays")]
    fn compare(
        &self,
        row: usize,
        stay: Stay,
        other: usize,
        other_stay: Stay,
        via: Via,
        (first, last): (usize, usize),
        found: &mut Encroachment,
    ) {
        let own_is_first = (stay.enter, row) < (other_stay.enter, other);
        let (leader, leader_stay, second) =
            if own_is_first { (row, stay, other_stay) } else { (other, other_stay, stay) };
        let free = self.free_at(leader, leader_stay);
        let pet = match free {
            Some(free) if second.enter >= free => (second.enter - free) as f64 * self.traffic.dt,
            _ => 0.0,
        };
        if pet < found.pet.value {
            found.pet_first = leader as u32;
        }
        found.pet.keep_smaller(pet, other as u32, via);
        for column in first..=last.min(free.unwrap_or(last)) {
            found.pet_series[column].keep_smaller(pet, other as u32, via);
        }
    }

    /// Length of the recorded way from the first state to each column [m].
    fn way_lengths(&self, row: usize) -> Vec<f64> {
        let traffic = self.traffic;
        let mut length = 0.0;
        let mut last: Option<Point> = None;
        (0..traffic.states.n_steps)
            .map(|column| {
                if traffic.is_there(row, column) {
                    let position = traffic.position(row, column);
                    length += last.map_or(0.0, |last| last.distance(position));
                    last = Some(position);
                }
                length
            })
            .collect()
    }
}

/// Connectors on the recorded route of a vehicle: driven along, and entered from a lanelet before it or left to one
/// behind it. Among connectors that start or end in the same lanelet, the best followed one counts.
fn connectors_of(
    traffic: &Traffic,
    track: &LaneletTrack,
    row: usize,
    incomings: &BTreeMap<usize, Vec<i64>>,
) -> Vec<usize> {
    if incomings.is_empty() || traffic.is_static[row] {
        return Vec::new();
    }
    // Per lanelet: first and last column, number of columns, sum of distances to the centre line.
    let mut visits: BTreeMap<usize, (usize, usize, usize, f64)> = BTreeMap::new();
    for column in (0..traffic.states.n_steps).filter(|column| traffic.is_there(row, *column)) {
        for here in track.here(column).iter().filter(|here| here.turn.abs() <= ALONG_ANGLE) {
            let visit = visits.entry(here.lanelet as usize).or_insert((column, column, 0, 0.0));
            (visit.1, visit.2, visit.3) = (column, visit.2 + 1, visit.3 + here.distance);
        }
    }
    let lanelets = traffic.road.lanelets();
    let mut candidates: Vec<(bool, usize, f64, usize)> = Vec::new();
    for (&lanelet, &(first, last, n, distance)) in visits.iter().filter(|(lanelet, _)| incomings.contains_key(*lanelet))
    {
        let came = lanelets[lanelet].predecessors.iter().any(|l| visits.get(l).is_some_and(|visit| visit.0 < first));
        let went = lanelets[lanelet].successors.iter().any(|l| visits.get(l).is_some_and(|visit| visit.1 > last));
        if came || went {
            candidates.push((came && went, n, distance / n as f64, lanelet));
        }
    }
    candidates.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.cmp(&a.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    let mut chosen: Vec<usize> = Vec::new();
    for (.., lanelet) in candidates {
        let shares = |a: &[usize], b: &[usize]| a.iter().any(|one| b.contains(one));
        let is_alternative = |other: &usize| {
            shares(&lanelets[lanelet].predecessors, &lanelets[*other].predecessors)
                || shares(&lanelets[lanelet].successors, &lanelets[*other].successors)
        };
        if !chosen.iter().any(is_alternative) {
            chosen.push(lanelet);
        }
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests;
