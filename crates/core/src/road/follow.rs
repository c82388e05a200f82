//! Following lanes: which chains of lanelets lie ahead, and poses along them.

use super::RoadNetwork;
use super::lanelet::Lanelet;
use crate::geometry::{Point, Pose, wrap_angle};

/// Pieces of a stretch of lane shorter than this [m] are left out: they are rounding, and no polygon.
const PIECE_LENGTH_MIN: f64 = 0.01;

/// Knots of a lane curve are about this far apart [m].
const KNOT_SPACING: f64 = 1.0;
/// The heading is that of the chord this far [m] to both sides.
const HEADING_REACH: f64 = 2.0;
/// The curvature is the change of heading this far [m] to both sides.
const CURVATURE_REACH: f64 = 3.0;
/// ... and this number of knots: lanelets of less than a millimetre must not cost more than others.
const REACH_KNOTS_MAX: f64 = 3000.0;
/// How straight a branch is shows after this length [m].
const BRANCH_LENGTH: f64 = 20.0;
/// Longest chain of lanelets: a bound for maps with lanelets of no length that lead into each other.
const FOLLOWED_LANELETS_MAX: usize = 512;

/// Centre line of a lanelet for stepping along: heading and curvature are smoothed across joints.
#[derive(Debug, Clone)]
pub(super) struct LaneCurve {
    spacing: f64,
    positions: Vec<Point>,
    /// Not wrapped.
    headings: Vec<f64>,
    curvatures: Vec<f64>,
}

impl LaneCurve {
    /// Needs the lanelets and their straightest neighbours, not the curves.
    pub(super) fn of(road: &RoadNetwork, lanelet: usize) -> Self {
        let center = &road.lanelets[lanelet].center;
        let positions = center.resampled(KNOT_SPACING);
        let spacing = center.length() / (positions.len() - 1) as f64;
        // Chord headings at uniform arc lengths from before the start to beyond the end.
        let extra = (CURVATURE_REACH / spacing).ceil().clamp(1.0, REACH_KNOTS_MAX) as usize;
        let n = positions.len() + 2 * extra;
        let mut headings: Vec<f64> = Vec::with_capacity(n);
        for k in 0..n {
            let s = (k as f64 - extra as f64) * spacing;
            let chord = road.beside(lanelet, s + HEADING_REACH) - road.beside(lanelet, s - HEADING_REACH);
            let last = headings.last().copied();
            let heading = if chord.norm() > 1e-6 { chord.angle() } else { last.unwrap_or(0.0) };
            headings.push(last.map_or(heading, |last| last + wrap_angle(heading - last)));
        }
        let curvatures = (0..positions.len())
            .map(|k| (headings[k + 2 * extra] - headings[k]) / (2.0 * extra as f64 * spacing))
            .collect();
        let headings = headings[extra..extra + positions.len()].to_vec();
        Self { spacing, positions, headings, curvatures }
    }

    #[inline]
    fn knot(&self, s: f64) -> (usize, f64) {
        let at = (s / self.spacing).clamp(0.0, (self.positions.len() - 1) as f64);
        let i = (at as usize).min(self.positions.len() - 2);
        (i, at - i as f64)
    }

    /// Smoothed heading at an arc length [m], not wrapped.
    #[inline]
    pub(super) fn heading_at(&self, s: f64) -> f64 {
        let (i, u) = self.knot(s);
        self.headings[i] + u * (self.headings[i + 1] - self.headings[i])
    }

    #[inline]
    pub(super) fn curvature_at(&self, s: f64) -> f64 {
        let (i, u) = self.knot(s);
        self.curvatures[i] + u * (self.curvatures[i + 1] - self.curvatures[i])
    }

    #[inline]
    fn position_at(&self, s: f64) -> Point {
        let (i, u) = self.knot(s);
        self.positions[i].lerp(self.positions[i + 1], u)
    }
}

/// Chains of lanelets, in memory that is reused.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chains {
    /// The chains, the first `n` of which count, and what of the distance lies beyond their ends [m].
    found: Vec<(Vec<usize>, f64)>,
    n: usize,
}

impl Chains {
    pub(crate) fn clear(&mut self) {
        self.n = 0;
    }

    /// Number of chains.
    pub(crate) fn n(&self) -> usize {
        self.n
    }

    /// Lanelets of a chain in driving order.
    pub(crate) fn get(&self, i: usize) -> &[usize] {
        &self.found[i].0
    }

    fn push(&mut self, stem: &[usize], last: usize, rest: f64) {
        if self.n == self.found.len() {
            self.found.push((Vec::with_capacity(stem.len() + 8), rest));
        }
        let (chain, left) = &mut self.found[self.n];
        chain.clear();
        chain.extend_from_slice(stem);
        chain.push(last);
        *left = rest;
        self.n += 1;
    }
}

/// Successors and predecessors of every lanelet, sorted: lanes for all its users first, then by least bend, then by id.
pub(super) fn straightest(lanelets: &[Lanelet]) -> (Vec<Vec<usize>>, Vec<Vec<usize>>) {
    let chord = |i: usize, from: f64, to: f64| {
        let line = &lanelets[i].center;
        let chord = line.at(to) - line.at(from);
        if chord.norm() > 1e-6 { chord.angle() } else { line.direction_at(from).angle() }
    };
    let sorted = |i: usize, related: &[usize], bend: &dyn Fn(usize) -> f64| {
        let narrows = |j: usize| !lanelets[j].users.covers(lanelets[i].users);
        let mut keyed: Vec<(bool, f64, usize)> = related.iter().map(|j| (narrows(*j), bend(*j), *j)).collect();
        keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        keyed.into_iter().map(|key| key.2).collect()
    };
    let rounded = |angle: f64| (wrap_angle(angle).abs() * 1e6).round();
    let successors = |i: usize| {
        let length = lanelets[i].length;
        let leaving = chord(i, length - 2.0 * HEADING_REACH, length);
        sorted(i, &lanelets[i].successors, &|j| {
            let reach = lanelets[j].length.min(BRANCH_LENGTH);
            rounded(chord(j, reach - 2.0 * HEADING_REACH, reach) - leaving)
        })
    };
    let predecessors = |i: usize| {
        let entering = chord(i, 0.0, 2.0 * HEADING_REACH);
        sorted(i, &lanelets[i].predecessors, &|j| {
            let start = (lanelets[j].length - BRANCH_LENGTH).max(0.0);
            rounded(chord(j, start, start + 2.0 * HEADING_REACH) - entering)
        })
    };
    ((0..lanelets.len()).map(successors).collect(), (0..lanelets.len()).map(predecessors).collect())
}

impl RoadNetwork {
    /// Successors of a lanelet, the straightest first.
    pub fn successors_straightest_first(&self, lanelet: usize) -> &[usize] {
        &self.straightest_successors[lanelet]
    }

    /// Predecessors of a lanelet, the straightest first.
    pub fn predecessors_straightest_first(&self, lanelet: usize) -> &[usize] {
        &self.straightest_predecessors[lanelet]
    }

    /// Heading of the lane at an arc length of its centre line, smoothed over 4 m and across joints [rad].
    pub fn heading_at(&self, lanelet: usize, s: f64) -> f64 {
        self.curves[lanelet].heading_at(s)
    }

    /// The smoothed centre line of a lanelet from its start to its end: knots, the heading of the lane at each of them
    /// (smoothed over 4 m and across joints, not wrapped [rad]), and the arc length between them, about 1 m.
    pub fn lane_knots(&self, lanelet: usize) -> (&[Point], &[f64], f64) {
        let curve = &self.curves[lanelet];
        (&curve.positions, &curve.headings, curve.spacing)
    }

    /// Point of the centre line, continued into the straightest neighbours, then straight.
    pub(crate) fn beside(&self, lanelet: usize, s: f64) -> Point {
        let (mut at, mut s) = (lanelet, s);
        for _ in 0..FOLLOWED_LANELETS_MAX {
            let line = &self.lanelets[at].center;
            if s < 0.0 {
                match self.straightest_predecessors[at].first() {
                    Some(&before) => {
                        at = before;
                        s += self.lanelets[before].length;
                        continue;
                    }
                    None => return line.at(0.0) + line.direction_at(0.0) * s,
                }
            }
            if s > line.length() {
                match self.straightest_successors[at].first() {
                    Some(&after) => {
                        s -= line.length();
                        at = after;
                        continue;
                    }
                    None => return line.at(line.length()) + line.direction_at(line.length()) * (s - line.length()),
                }
            }
            return line.at(s);
        }
        self.lanelets[at].center.at(s)
    }

    /// Chains of lanelets ahead of arc length `s` of a lanelet, each long enough for `distance` [m] or ending where the
    /// road does; at most `max_paths`.
    ///
    /// Every chain starts with the lanelet itself. The first one is the straightest at every fork; the others follow in
    /// the order in which they branch off, nearer forks first. A chain may pass a lanelet again where roads form a loop.
    pub fn paths_from(&self, lanelet: usize, s: f64, distance: f64, max_paths: usize) -> Vec<Vec<usize>> {
        let mut chains = Chains::default();
        self.find_paths(lanelet, s, distance, max_paths, &mut chains);
        chains.found.into_iter().map(|(chain, _)| chain).collect()
    }

    /// The same, after the chains that are there already.
    pub(crate) fn find_paths(&self, lanelet: usize, s: f64, distance: f64, max_paths: usize, chains: &mut Chains) {
        let first = chains.n;
        if max_paths == 0 {
            return;
        }
        chains.push(&[], lanelet, distance - (self.lanelets[lanelet].length - s));
        loop {
            let mut grown = false;
            for i in first..chains.n {
                let (chain, rest) = &chains.found[i];
                let rest = *rest;
                let successors = &self.straightest_successors[chain[chain.len() - 1]];
                if rest <= 0.0 || successors.is_empty() || chain.len() >= FOLLOWED_LANELETS_MAX {
                    continue;
                }
                grown = true;
                let room = max_paths - (chains.n - first);
                for &branch in successors.iter().skip(1).take(room) {
                    let stem = std::mem::take(&mut chains.found[i].0);
                    chains.push(&stem, branch, rest - self.lanelets[branch].length);
                    chains.found[i].0 = stem;
                }
                let (chain, left) = &mut chains.found[i];
                chain.push(successors[0]);
                *left = rest - self.lanelets[successors[0]].length;
            }
            if !grown {
                return;
            }
        }
    }

    /// Pose at `distance` [m] beyond arc length `start_s` of the first lanelet of a chain, at lateral offset `d` [m] (left
    /// positive), and its unit vector. Straight on before the first and beyond the last lanelet. No allocation.
    ///
    /// # Panics
    /// If the chain is empty or an index is no lanelet's.
    pub fn chain_pose(&self, chain: &[usize], start_s: f64, distance: f64, d: f64) -> (Pose, Point) {
        let (curve, s, overshoot) = self.along_chain(chain, start_s + distance);
        let heading = curve.heading_at(s);
        let axis = Point::from_angle(heading);
        let position = curve.position_at(s) + axis * overshoot + axis.left() * d;
        (Pose { position, orientation: heading }, axis)
    }

    /// Curvature [1/m] of the middle of the lane at a place as of `chain_pose`; 0 before the first and beyond the last
    /// lanelet.
    ///
    /// # Panics
    /// As `chain_pose`.
    pub fn chain_curvature(&self, chain: &[usize], start_s: f64, distance: f64) -> f64 {
        let (curve, s, overshoot) = self.along_chain(chain, start_s + distance);
        if overshoot == 0.0 { curve.curvature_at(s) } else { 0.0 }
    }

    /// The lane of a chain at an arc length [m] from its start, the arc length there, and what lies beyond its ends.
    #[inline]
    fn along_chain(&self, chain: &[usize], mut s: f64) -> (&LaneCurve, f64, f64) {
        let mut at = 0;
        while at + 1 < chain.len() && s > self.lanelets[chain[at]].length {
            s -= self.lanelets[chain[at]].length;
            at += 1;
        }
        let overshoot = if s < 0.0 { s } else { (s - self.lanelets[chain[at]].length).max(0.0) };
        (&self.curves[chain[at]], s, overshoot)
    }

    /// Outlines of the stretch of lane from `before` [m] behind to `after` [m] ahead of arc length `s` of a lanelet,
    /// continued into the straightest predecessors and successors. In driving order, one outline per lanelet.
    pub fn lane_stretch(&self, lanelet: usize, s: f64, before: f64, after: f64) -> Vec<Vec<Point>> {
        let length = |i: usize| self.lanelets[i].length;
        let mut stretch = Vec::new();
        // Walk back; `missing` lies before the start of `at`.
        let (mut at, mut missing) = (lanelet, before - s);
        let mut behind = Vec::new();
        while missing > PIECE_LENGTH_MIN && behind.len() < FOLLOWED_LANELETS_MAX {
            let Some(&previous) = self.straightest_predecessors[at].first() else { break };
            behind.push(self.lanelets[previous].outline_between(length(previous) - missing, length(previous)));
            missing -= length(previous);
            at = previous;
        }
        stretch.extend(behind.into_iter().rev());
        if s - before < length(lanelet) && s + after > 0.0 {
            stretch.push(self.lanelets[lanelet].outline_between(s - before, s + after));
        }
        let (mut at, mut missing) = (lanelet, s + after - length(lanelet));
        while missing > 0.0 && stretch.len() < 2 * FOLLOWED_LANELETS_MAX {
            let Some(&next) = self.straightest_successors[at].first() else { break };
            stretch.push(self.lanelets[next].outline_between(0.0, missing));
            missing -= length(next);
            at = next;
        }
        stretch
    }
}
