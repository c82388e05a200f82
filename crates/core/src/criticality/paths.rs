//! Path systems: every chain of lanelets that a vehicle could drive from where it is, with curvilinear coordinates.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use super::curve::Curve;
use super::traffic::Here;
use crate::geometry::Point;
use crate::geometry::polyline::Polyline;
use crate::limits::LANELET_CHAIN_MAX;
use crate::road::RoadNetwork;

/// A path starts at least this far [m] before its first lanelet, so that a participant that has just entered it has a foot on it.
const LEAD_IN: f64 = 10.0;
/// More paths than this from one lanelet are not followed: they could not be told apart, and maps with many short
/// lanelets would have millions.
const PATHS_MAX: usize = 512;

/// One chain of lanelets.
#[derive(Debug, Clone)]
pub(super) struct Path {
    /// From the lanelet of the vehicle on, in the direction of travel.
    pub lanelets: Vec<u32>,
    /// Length from the end of the first lanelet to the end of each [m].
    ends: Vec<f64>,
    /// Number of leading lanelets that an earlier path of the same system shares.
    pub shared: usize,
    /// Length of the loop [m], if the last lanelet leads to the first one.
    period: Option<f64>,
    pub curve: Curve,
}

impl Path {
    /// Number of lanelets until `radius` [m] lie ahead, if `ahead` [m] of the first one do.
    pub(super) fn reach(&self, ahead: f64, radius: f64) -> usize {
        let needed = self.ends.iter().position(|end| ahead + end >= radius);
        needed.map_or(self.lanelets.len(), |index| index + 1)
    }

    /// The last lanelet leads to the first one.
    #[inline]
    pub(super) fn is_closed(&self) -> bool {
        self.period.is_some()
    }

    /// Arc length of a place seen from another one [m]: in a loop ahead of it, but for `behind` [m].
    #[inline]
    pub(super) fn seen_from(&self, from: f64, place: f64, behind: f64) -> f64 {
        self.period.map_or(place, |period| from + (place - from + behind).rem_euclid(period) - behind)
    }

    /// Place of a lanelet among the first `reach` ones.
    #[inline]
    pub(super) fn place(&self, lanelet: u32, reach: usize) -> Option<usize> {
        self.lanelets[..reach].iter().position(|one| *one == lanelet)
    }
}

/// The paths from every lanelet that matters, in and against its direction.
#[derive(Debug, Clone)]
pub(super) struct PathSystems {
    systems: Vec<Vec<Path>>,
}

/// Where a path system starts: a lanelet, and whether it is driven against its direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Start {
    pub lanelet: u32,
    pub reversed: bool,
}

impl Start {
    fn index(self) -> usize {
        2 * self.lanelet as usize + usize::from(self.reversed)
    }

    fn from_index(index: usize) -> Self {
        Self { lanelet: (index / 2) as u32, reversed: index % 2 == 1 }
    }
}

/// The lanelets on which a vehicle's paths start: those it is on in their direction; if there are none, those it is on
/// against their direction.
pub(super) fn starts(here: &[Here]) -> impl Iterator<Item = (Start, &Here)> {
    let along = |here: &Here| here.turn.abs() <= FRAC_PI_2;
    let reversed = !here.iter().any(along);
    here.iter()
        .filter(move |one| reversed || along(one))
        .map(move |one| (Start { lanelet: one.lanelet, reversed }, one))
}

/// A path of a system and how many of its lanelets count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PathCode {
    pub start: u32,
    pub path: u16,
    pub reach: u16,
}

impl PathCode {
    pub(super) fn new(start: Start, path: usize, reach: usize) -> Self {
        Self { start: start.index() as u32, path: path as u16, reach: reach as u16 }
    }
}

impl PathSystems {
    /// Paths of at least `radius` [m] from all given starts.
    pub(super) fn new(road: &RoadNetwork, wanted: impl IntoIterator<Item = Start>, radius: f64) -> Self {
        let mut needed = vec![false; 2 * road.lanelets().len()];
        for start in wanted {
            needed[start.index()] = true;
        }
        let system = |index: usize| {
            if needed[index] { paths_from(road, Start::from_index(index), radius) } else { Vec::new() }
        };
        Self { systems: (0..needed.len()).into_par_iter().map(system).collect() }
    }

    #[inline]
    pub(super) fn of(&self, start: Start) -> &[Path] {
        &self.systems[start.index()]
    }

    /// Lanelets of a path, as indices.
    pub(super) fn lanelets(&self, code: PathCode) -> &[u32] {
        &self.systems[code.start as usize][code.path as usize].lanelets[..code.reach as usize]
    }
}

fn next(road: &RoadNetwork, lanelet: u32, reversed: bool) -> &[usize] {
    if reversed {
        road.predecessors_straightest_first(lanelet as usize)
    } else {
        road.successors_straightest_first(lanelet as usize)
    }
}

fn paths_from(road: &RoadNetwork, start: Start, radius: f64) -> Vec<Path> {
    let mut chains = Vec::new();
    grow(road, start.reversed, radius, 0.0, &mut vec![start.lanelet], &mut chains);
    let lead_in = lead_in(road, start);
    let mut paths: Vec<Path> = Vec::with_capacity(chains.len());
    for (lanelets, is_closed) in chains {
        let shared = paths
            .last()
            .map_or(0, |before: &Path| before.lanelets.iter().zip(&lanelets).take_while(|(a, b)| a == b).count());
        let mut end = 0.0;
        let ends = lanelets
            .iter()
            .enumerate()
            .map(|(i, lanelet)| {
                end += if i == 0 { 0.0 } else { road.lanelets()[*lanelet as usize].length };
                end
            })
            .collect();
        let centers = lanelets.iter().flat_map(|lanelet| center(road, *lanelet, start.reversed));
        if let Some(curve) = Curve::new(lead_in.iter().copied().chain(centers)) {
            let period = is_closed.then(|| curve.length() - LEAD_IN).filter(|period| *period > 0.0);
            paths.push(Path { lanelets, ends, shared, period, curve });
        }
    }
    paths
}

/// Depth first, the straightest branch first; a chain ends where the road does, before a lanelet that it has already
/// passed, or when `radius` lies behind the end of its first lanelet. A chain that leads back to its first lanelet is
/// marked as closed.
fn grow(
    road: &RoadNetwork,
    reversed: bool,
    radius: f64,
    length: f64,
    chain: &mut Vec<u32>,
    found: &mut Vec<(Vec<u32>, bool)>,
) {
    if found.len() >= PATHS_MAX {
        return;
    }
    let last = chain[chain.len() - 1];
    let (mut is_end, mut is_closed) = (true, false);
    if length < radius && chain.len() < LANELET_CHAIN_MAX {
        for &branch in next(road, last, reversed) {
            if chain.contains(&(branch as u32)) {
                if branch as u32 == chain[0] && !is_closed {
                    is_closed = true;
                    found.push((chain.clone(), true));
                }
                continue;
            }
            is_end = false;
            chain.push(branch as u32);
            grow(road, reversed, radius, length + road.lanelets()[branch].length, chain, found);
            chain.pop();
        }
    }
    if is_end && !is_closed {
        found.push((chain.clone(), false));
    }
}

fn center(road: &RoadNetwork, lanelet: u32, reversed: bool) -> Vec<Point> {
    let mut points = road.lanelets()[lanelet as usize].center.points().to_vec();
    if reversed {
        points.reverse();
    }
    points
}

/// The last metres before a lanelet: along the straightest lanelets that lead to it, then straight.
fn lead_in(road: &RoadNetwork, start: Start) -> Vec<Point> {
    let mut missing = LEAD_IN;
    let mut at = start.lanelet;
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    while missing > 0.0 && pieces.len() < LANELET_CHAIN_MAX {
        let Some(&before) = next(road, at, !start.reversed).first() else { break };
        at = before as u32;
        let points = center(road, at, start.reversed);
        let Ok(line) = Polyline::new(&points) else { break };
        let from = (line.length() - missing).max(0.0);
        missing -= line.length();
        let rest = line.points().iter().zip(line.arc_lengths()).filter(|(_, s)| **s > from).map(|(point, _)| *point);
        pieces.push(std::iter::once(line.at(from)).chain(rest).collect());
    }
    if missing > 0.0 {
        let first = pieces.last().cloned().unwrap_or_else(|| center(road, at, start.reversed));
        if let Ok(line) = Polyline::new(&first) {
            pieces.push(vec![line.at(0.0) - line.direction_at(0.0) * missing]);
        }
    }
    pieces.into_iter().rev().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::testing::{fork, merge, ring, straight_road};

    fn lanelets(road: &RoadNetwork, lanelet: u32, reversed: bool, radius: f64) -> Vec<Vec<u32>> {
        let start = Start { lanelet, reversed };
        PathSystems::new(road, [start], radius).of(start).iter().map(|path| path.lanelets.clone()).collect()
    }

    #[test]
    fn there_is_a_path_for_every_branch() {
        let road = fork();
        assert_eq!(lanelets(&road, 0, false, 100.0), [vec![0, 1], vec![0, 2]]);
        assert_eq!(lanelets(&road, 1, true, 100.0), [vec![1, 0]]);
        assert_eq!(lanelets(&merge(), 2, true, 100.0), [vec![2, 0], vec![2, 1]]);
    }

    #[test]
    fn paths_end_before_a_lanelet_that_they_have_passed() {
        assert_eq!(lanelets(&ring(), 1, false, 1000.0), [vec![1, 2, 3, 0]]);
    }

    #[test]
    fn a_loop_brings_what_is_behind_in_front() {
        let road = ring();
        let start = Start { lanelet: 0, reversed: false };
        let systems = PathSystems::new(&road, [start], 1000.0);
        let path = &systems.of(start)[0];
        let around = road.lanelets().iter().map(|lanelet| lanelet.length).sum::<f64>();
        assert!(path.is_closed() && (path.seen_from(30.0, 20.0, 0.0) - (20.0 + around)).abs() < 1e-6);
        assert!((path.seen_from(30.0, 29.0, 2.0) - 29.0).abs() < 1e-9);
        // Within 60 m the path does not come back.
        let systems = PathSystems::new(&road, [start], 60.0);
        assert!(!systems.of(start)[0].is_closed());
    }

    #[test]
    fn a_path_counts_until_the_radius_lies_ahead() {
        let road = ring();
        let start = Start { lanelet: 0, reversed: false };
        let systems = PathSystems::new(&road, [start], 60.0);
        let path = &systems.of(start)[0];
        // A quarter of the ring is 31.4 m long.
        for (ahead, reach) in [(31.4, 2), (28.0, 3), (0.0, 3)] {
            assert_eq!(path.reach(ahead, 60.0), reach, "{ahead}");
        }
        assert_eq!((path.place(1, 2), path.place(2, 2)), (Some(1), None));
    }

    #[test]
    fn coordinates_start_before_the_first_lanelet() {
        let road = straight_road(1);
        for (reversed, x) in [(false, -9.0), (true, 209.0)] {
            let start = Start { lanelet: 0, reversed };
            let systems = PathSystems::new(&road, [start], 100.0);
            let foot = systems.of(start)[0].curve.project(Point::new(x, 1.0), 100.0).expect("in the lead-in");
            assert!((foot.s - 1.0).abs() < 1e-9 && (foot.d - if reversed { -1.0 } else { 1.0 }).abs() < 1e-9);
        }
        let merging = merge();
        let start = Start { lanelet: 2, reversed: false };
        let systems = PathSystems::new(&merging, [start], 100.0);
        let foot = systems.of(start)[0].curve.project(Point::new(45.0, 0.0), 100.0).expect("in the lead-in");
        assert!((foot.s - 5.0).abs() < 1e-6);
    }

    #[test]
    fn who_drives_against_the_only_lanelet_gets_its_reverse() {
        let here = |lanelet, turn| Here { lanelet, s: 0.0, distance: 0.0, turn };
        let both = [here(3, 0.1), here(4, 3.1)];
        let found: Vec<Start> = starts(&both).map(|(start, _)| start).collect();
        assert_eq!(found, [Start { lanelet: 3, reversed: false }]);
        let found: Vec<Start> = starts(&both[1..]).map(|(start, _)| start).collect();
        assert_eq!(found, [Start { lanelet: 4, reversed: true }]);
        assert_eq!(starts(&[]).count(), 0);
    }
}
