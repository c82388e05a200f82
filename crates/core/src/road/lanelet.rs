//! One lanelet, and the relations between lanelets put in order.

use super::filler::Filler;
use super::{LaneletInput, Users};
use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::geometry::polyline::Polyline;
use crate::limits::{LANELET_LENGTH_MAX, NUMBER_MAX, ROADS_LENGTH_MAX};

/// Neighbours share a bound if it is within this distance [m] all along.
const SHARED_BOUND_DISTANCE: f64 = 0.1;
/// A successor that starts farther away than this [m] is an error of the map, unless it starts before the end.
const SUCCESSOR_GAP_MAX: f64 = 3.0;
/// Lanelets that overlap their successor by more than this [m] are cut.
const OVERLAP_MIN: f64 = 0.5;
/// Middles of overlapping lanelets are at most this far apart [m].
const OVERLAP_OFFSET_MAX: f64 = 1.0;
/// Smallest length of a cut lanelet [m].
const CUT_LENGTH_MIN: f64 = 1.0;

/// A lanelet of the network. Relations are indices into `RoadNetwork::lanelets`.
#[derive(Debug, Clone)]
pub struct Lanelet {
    /// Its id in the file.
    pub id: i64,
    /// Left bound in driving direction, world frame; as many vertices as `right`, pairwise opposite.
    pub left: Vec<Point>,
    /// Right bound.
    pub right: Vec<Point>,
    /// Middle between the bounds.
    pub center: Polyline,
    /// Left bound, then right bound backwards.
    pub polygon: Vec<Point>,
    /// Lanelets that lead into this one, ascending.
    pub predecessors: Vec<usize>,
    /// Lanelets into which this one leads, ascending.
    pub successors: Vec<usize>,
    /// Left neighbour, and whether it runs in the same direction.
    pub adjacent_left: Option<(usize, bool)>,
    /// Right neighbour, and whether it runs in the same direction.
    pub adjacent_right: Option<(usize, bool)>,
    /// Speed limit [m/s]; NaN: unknown.
    pub speed_limit: f64,
    /// The kinds of participants for which it is a lane.
    pub users: Users,
    /// Length of the centre line [m].
    pub length: f64,
    /// Arc length of the centre line at every pair of bound vertices; not strictly ascending.
    pair_s: Vec<f64>,
}

impl Lanelet {
    /// Geometry of an input; relations are still empty.
    fn from_input(input: &LaneletInput) -> Result<Self> {
        let id = input.id;
        for (side, bound) in [("left", &input.left), ("right", &input.right)] {
            if bound.len() < 2 {
                return Err(Error::invalid(format!(
                    "lanelet {id}: its {side} bound has {} vertices, at least 2 are needed",
                    bound.len()
                )));
            }
            if let Some(i) = bound.iter().position(|point| !point.is_possible()) {
                return Err(Error::invalid(format!(
                    "lanelet {id}: vertex {i} of its {side} bound is not a number up to {NUMBER_MAX:e}"
                )));
            }
        }
        let (left, right) = paired(&input.left, &input.right);
        let middle: Vec<Point> = left.iter().zip(&right).map(|(l, r)| l.lerp(*r, 0.5)).collect();
        let center = Polyline::new(&middle)
            .map_err(|_| Error::invalid(format!("lanelet {id}: its centre line has no length")))?;
        if center.length() > LANELET_LENGTH_MAX {
            let length = center.length();
            return Err(Error::invalid(format!(
                "lanelet {id}: its centre line of {length:.0} m is longer than {LANELET_LENGTH_MAX:.0} m"
            )));
        }
        // The polyline drops near duplicates, the bounds keep them: both are walked together.
        let mut at = 0;
        let pair_s = middle
            .iter()
            .map(|point| {
                if center.points().get(at + 1) == Some(point) {
                    at += 1;
                }
                center.arc_lengths()[at]
            })
            .collect();
        Ok(Self {
            id,
            polygon: left.iter().chain(right.iter().rev()).copied().collect(),
            length: center.length(),
            left,
            right,
            center,
            predecessors: Vec::new(),
            successors: Vec::new(),
            adjacent_left: None,
            adjacent_right: None,
            speed_limit: input.speed_limit,
            users: input.users,
            pair_s,
        })
    }

    /// Left and right bound points opposite to an arc length of the centre line [m], clamped to the ends.
    pub fn bounds_at(&self, s: f64) -> (Point, Point) {
        let i = self.pair_s.partition_point(|pair_s| *pair_s <= s).clamp(1, self.pair_s.len() - 1) - 1;
        let span = self.pair_s[i + 1] - self.pair_s[i];
        let fraction = if span > 0.0 { ((s - self.pair_s[i]) / span).clamp(0.0, 1.0) } else { 1.0 };
        (self.left[i].lerp(self.left[i + 1], fraction), self.right[i].lerp(self.right[i + 1], fraction))
    }

    /// Outline of the part between two arc lengths of the centre line [m], clamped to the ends.
    pub(super) fn outline_between(&self, from: f64, to: f64) -> Vec<Point> {
        let (start, end) = (self.bounds_at(from), self.bounds_at(to));
        let inner = || (0..self.pair_s.len()).filter(|i| self.pair_s[*i] > from && self.pair_s[*i] < to);
        let mut outline = vec![start.0];
        outline.extend(inner().map(|i| self.left[i]));
        outline.extend([end.0, end.1]);
        outline.extend(inner().rev().map(|i| self.right[i]));
        outline.push(start.1);
        outline
    }

    /// Width between the bounds at an arc length of the centre line [m].
    pub fn width_at(&self, s: f64) -> f64 {
        let (left, right) = self.bounds_at(s);
        left.distance(right)
    }

    /// Both bounds between two arc lengths of the centre line [m].
    fn bounds_between(&self, from: f64, to: f64) -> (Vec<Point>, Vec<Point>) {
        let inner = (0..self.pair_s.len()).filter(|i| self.pair_s[*i] > from && self.pair_s[*i] < to);
        let inner = inner.map(|i| (self.left[i], self.right[i]));
        let ends = (self.bounds_at(from), self.bounds_at(to));
        std::iter::once(ends.0).chain(inner).chain(std::iter::once(ends.1)).unzip()
    }

    /// Keeps what lies between two arc lengths of the centre line [m]; the parts before and behind are returned.
    fn cut(&mut self, from: f64, to: f64) -> Result<Vec<Filler>> {
        let parts = [(0.0, from), (to, self.length)].into_iter().filter(|(from, to)| to > from);
        let fillers = parts
            .map(|(from, to)| {
                let (left, right) = self.bounds_between(from, to);
                let backwards = right.iter().rev().copied().collect();
                Filler { borders: vec![left.clone(), backwards], left, right }
            })
            .collect();
        let (left, right) = self.bounds_between(from, to);
        let relations = (std::mem::take(&mut self.predecessors), std::mem::take(&mut self.successors));
        let input = LaneletInput {
            speed_limit: self.speed_limit,
            users: self.users,
            ..LaneletInput::between(self.id, left, right)
        };
        let (adjacent_left, adjacent_right) = (self.adjacent_left, self.adjacent_right);
        let (predecessors, successors) = relations;
        *self = Self { predecessors, successors, adjacent_left, adjacent_right, ..Self::from_input(&input)? };
        Ok(fillers)
    }

    /// First corners, left and right.
    pub(super) fn start(&self) -> (Point, Point) {
        (self.left[0], self.right[0])
    }

    /// Last corners, left and right.
    pub(super) fn end(&self) -> (Point, Point) {
        (self.left[self.left.len() - 1], self.right[self.right.len() - 1])
    }
}

/// The bounds with equally many vertices. CommonRoad promises that; where a file breaks it, both get vertices at the
/// relative arc lengths of either.
fn paired(left: &[Point], right: &[Point]) -> (Vec<Point>, Vec<Point>) {
    if left.len() == right.len() {
        return (left.to_vec(), right.to_vec());
    }
    let (Ok(left_line), Ok(right_line)) = (Polyline::new(left), Polyline::new(right)) else {
        // One bound is a single point: it faces every vertex of the other.
        return if left.len() > right.len() {
            (left.to_vec(), vec![right[0]; left.len()])
        } else {
            (vec![left[0]; right.len()], right.to_vec())
        };
    };
    let mut fractions: Vec<f64> = [&left_line, &right_line]
        .iter()
        .flat_map(|line| line.arc_lengths().iter().map(|s| s / line.length()))
        .collect();
    fractions.sort_by(f64::total_cmp);
    fractions.dedup_by(|a, b| *a - *b < 1e-9);
    let along = |line: &Polyline| fractions.iter().map(|fraction| line.at(fraction * line.length())).collect();
    (along(&left_line), along(&right_line))
}

/// Lanelets sorted by id, with relations completed, and the parts cut off where they overlap.
pub(super) fn linked(mut inputs: Vec<LaneletInput>) -> Result<(Vec<Lanelet>, Vec<Filler>)> {
    if inputs.is_empty() {
        return Err(Error::invalid("a road network needs at least one lanelet"));
    }
    inputs.sort_by_key(|input| input.id);
    if let Some(pair) = inputs.windows(2).find(|pair| pair[0].id == pair[1].id) {
        return Err(Error::invalid(format!("lanelet {}: the id is used twice", pair[0].id)));
    }
    let mut lanelets = inputs.iter().map(Lanelet::from_input).collect::<Result<Vec<_>>>()?;
    let total: f64 = lanelets.iter().map(|lanelet| lanelet.length).sum();
    if total > ROADS_LENGTH_MAX {
        return Err(Error::invalid(format!(
            "all lanelets together are {total:.0} m long, at most {ROADS_LENGTH_MAX:.0} m are possible"
        )));
    }
    let index = |id: i64| inputs.binary_search_by_key(&id, |input| input.id).ok();
    for (i, input) in inputs.iter().enumerate() {
        for j in input.successors.iter().filter_map(|id| index(*id)) {
            link(&mut lanelets, i, j);
        }
        for j in input.predecessors.iter().filter_map(|id| index(*id)) {
            link(&mut lanelets, j, i);
        }
        let neighbour =
            |stated: Option<(i64, bool)>| stated.and_then(|(id, same)| Some((index(id)?, same))).filter(|n| n.0 != i);
        lanelets[i].adjacent_left = neighbour(input.adjacent_left);
        lanelets[i].adjacent_right = neighbour(input.adjacent_right);
    }
    for lanelet in &mut lanelets {
        for related in [&mut lanelet.predecessors, &mut lanelet.successors] {
            related.sort_unstable();
            related.dedup();
        }
    }
    return_adjacency(&mut lanelets);
    derive_adjacency(&mut lanelets);
    return_adjacency(&mut lanelets);
    let cut_off = cut_overlaps(&mut lanelets)?;
    Ok((lanelets, cut_off))
}

/// Relates two lanelets unless they are far apart.
fn link(lanelets: &mut [Lanelet], before: usize, after: usize) {
    let (end, start) = (lanelets[before].center.at(lanelets[before].length), lanelets[after].center.at(0.0));
    if end.distance(start) <= SUCCESSOR_GAP_MAX || overlap(&lanelets[before], &lanelets[after]) > 0.0 {
        lanelets[before].successors.push(after);
        lanelets[after].predecessors.push(before);
    }
}

/// How far the end of a lanelet lies beyond the start of its successor, along both [m]; 0 where they meet or part.
fn overlap(before: &Lanelet, after: &Lanelet) -> f64 {
    let end = after.center.project(before.center.at(before.length));
    let start = before.center.project(after.center.at(0.0));
    let beyond = before.length - start.s;
    let is_along = end.distance <= OVERLAP_OFFSET_MAX && start.distance <= OVERLAP_OFFSET_MAX;
    let rest = start.s.min(after.length - end.s);
    if before.id != after.id && is_along && beyond.min(end.s) > OVERLAP_MIN && rest >= CUT_LENGTH_MIN {
        beyond.min(end.s)
    } else {
        0.0
    }
}

/// Cuts lanelets where all their successors start before their end, and lanelets that start before the end of all their
/// predecessors, so that arc lengths add up along a lane. Returns the parts cut off.
fn cut_overlaps(lanelets: &mut [Lanelet]) -> Result<Vec<Filler>> {
    let least = |overlaps: &mut dyn Iterator<Item = f64>| overlaps.reduce(f64::min).unwrap_or(0.0);
    let ends: Vec<f64> = lanelets
        .iter()
        .map(|lanelet| least(&mut lanelet.successors.iter().map(|next| overlap(lanelet, &lanelets[*next]))))
        .collect();
    let starts: Vec<f64> = lanelets
        .iter()
        .map(|lanelet| {
            let left = |before: &usize| overlap(&lanelets[*before], lanelet) - ends[*before];
            least(&mut lanelet.predecessors.iter().map(left))
        })
        .collect();
    let mut cut_off = Vec::new();
    for (lanelet, (start, end)) in lanelets.iter_mut().zip(starts.into_iter().zip(ends)) {
        let start = if start > OVERLAP_MIN { start } else { 0.0 };
        if start + end > 0.0 && lanelet.length - start - end >= CUT_LENGTH_MIN {
            cut_off.extend(lanelet.cut(start, lanelet.length - end)?);
        }
    }
    Ok(cut_off)
}

/// A neighbour without a neighbour on the shared side gets the lanelet that named it.
fn return_adjacency(lanelets: &mut [Lanelet]) {
    for i in 0..lanelets.len() {
        for (stated, is_left) in [(lanelets[i].adjacent_left, true), (lanelets[i].adjacent_right, false)] {
            let Some((j, same)) = stated else { continue };
            // The left neighbour in the same direction has us on its right; an oncoming one on its left.
            let side = if is_left == same { &mut lanelets[j].adjacent_right } else { &mut lanelets[j].adjacent_left };
            side.get_or_insert((i, same));
        }
    }
}

/// Finds neighbours by shared bounds where nothing is stated.
fn derive_adjacency(lanelets: &mut [Lanelet]) {
    for i in 0..lanelets.len() {
        if lanelets[i].adjacent_left.is_none() {
            let found = (0..lanelets.len()).filter(|j| *j != i).find_map(|j| {
                let (own, other) = (&lanelets[i].left, &lanelets[j]);
                if shared(own, &other.right, false) {
                    Some((j, true))
                } else if shared(own, &other.left, true) {
                    Some((j, false))
                } else {
                    None
                }
            });
            lanelets[i].adjacent_left = found;
        }
        if lanelets[i].adjacent_right.is_none() {
            let found =
                (0..lanelets.len()).filter(|j| *j != i).find(|j| shared(&lanelets[i].right, &lanelets[*j].right, true));
            lanelets[i].adjacent_right = found.map(|j| (j, false));
        }
    }
}

/// Two bounds run along each other from end to end.
fn shared(a: &[Point], b: &[Point], reversed: bool) -> bool {
    let (first, last) = if reversed { (b[b.len() - 1], b[0]) } else { (b[0], b[b.len() - 1]) };
    if a[0].distance(first) > SHARED_BOUND_DISTANCE || a[a.len() - 1].distance(last) > SHARED_BOUND_DISTANCE {
        return false;
    }
    let other = |i: usize| if reversed { b[b.len() - 1 - i] } else { b[i] };
    if a.len() == b.len() && (0..a.len()).all(|i| a[i].distance(other(i)) <= SHARED_BOUND_DISTANCE) {
        return true;
    }
    let near = |points: &[Point], line: &[Point]| {
        Polyline::new(line).is_ok_and(|line| points.iter().all(|p| line.project(*p).distance <= SHARED_BOUND_DISTANCE))
    };
    near(a, b) && near(b, a)
}
