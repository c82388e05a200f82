//! Heights of lanelets: ways that cross one above the other do not meet.

use std::f64::consts::{FRAC_PI_2, PI};

use super::RoadNetwork;
use crate::geometry::{Point, Pose};

/// Ways that are farther apart in height than this [m] do not meet.
const HEIGHT_CLEARANCE: f64 = 3.0;
/// Heading difference [rad] by which, of two equally good ways above each other, the way along the heading is chosen.
const ALIGNED_BY: f64 = 0.1;
/// On a slope the way between two participants is at most their distance times this factor plus this length [m].
const DETOUR_FACTOR: f64 = 1.5;
const DETOUR_MIN: f64 = 10.0;

/// Points of the middle of each lanelet with their heights [m]; none where a map does not state them.
#[derive(Debug, Clone, Default)]
pub(super) struct Heights(Vec<Vec<(Point, f64)>>);

impl RoadNetwork {
    /// The same road with heights, of lanelets by their ids: points of the middle and the height at each [m].
    #[must_use]
    pub fn with_heights(mut self, stated: impl IntoIterator<Item = (i64, Vec<(Point, f64)>)>) -> Self {
        let mut heights = vec![Vec::new(); self.lanelets.len()];
        for (id, points) in stated {
            if let Some(lanelet) = self.index_of(id) {
                heights[lanelet] = points;
            }
        }
        self.heights = Heights(heights);
        self
    }

    /// The map states heights, at least of some lanelets.
    pub fn has_heights(&self) -> bool {
        !self.heights.0.is_empty()
    }

    /// Height of a lanelet where it is nearest to a point [m].
    pub fn height_of(&self, lanelet: usize, point: Point) -> Option<f64> {
        let points = self.heights.0.get(lanelet)?;
        let at = |pair: &[(Point, f64)]| {
            let [(a, low), (b, high)] = [pair[0], pair[1]];
            let along = b - a;
            let share = ((point - a).dot(along) / along.dot(along).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            ((a + along * share).distance(point), low + share * (high - low))
        };
        let best = points.windows(2).map(at).min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, height)| height)
    }

    /// Height at a pose [m]: that of the lanelet there whose direction, or its opposite, fits best. `None` where the
    /// map states none.
    pub fn height_at(&self, pose: Pose) -> Option<f64> {
        let aside = |error: f64| if error.abs() > FRAC_PI_2 { PI - error.abs() + ALIGNED_BY } else { error.abs() };
        let found = self.matching(pose, 0.0, PI);
        let best = found.iter().min_by(|a, b| aside(a.heading_error).total_cmp(&aside(b.heading_error)))?;
        self.height_of(best.lanelet, pose.position)
    }

    /// Height at a pose of a participant that was at another height a moment before [m]: nothing jumps from one road to
    /// the road above. A participant beside all lanelets keeps its height.
    pub fn height_from(&self, before: Option<f64>, pose: Pose) -> Option<f64> {
        let Some(before) = before else { return self.height_at(pose) };
        let here = self.lanelets_at(pose.position);
        if here.is_empty() {
            return Some(before);
        }
        let known = here.iter().filter_map(|lanelet| self.height_of(*lanelet, pose.position));
        let nearest = known.min_by(|a, b| (a - before).abs().total_cmp(&(b - before).abs()));
        let is_unknown = |lanelet: &usize| self.height_of(*lanelet, pose.position).is_none();
        match nearest {
            Some(height) if !apart(height, before) => Some(height),
            _ if here.iter().any(is_unknown) => None,
            _ => self.height_at(pose),
        }
    }

    /// Heights along a track of poses, `None` where there is no pose or no height. Where ways lie one above the other, the
    /// track before and behind tells which of them is driven.
    pub fn heights_along(&self, poses: &[Option<Pose>]) -> Vec<Option<f64>> {
        let mut found = vec![None; poses.len()];
        let is_clear = |pose: &Pose| {
            let here = self.lanelets_at(pose.position);
            let heights: Vec<f64> = here.iter().filter_map(|lanelet| self.height_of(*lanelet, pose.position)).collect();
            heights.len() == here.len() && heights.iter().all(|height| !apart(*height, heights[0])) && !here.is_empty()
        };
        let there = |i: &usize| poses[*i].is_some();
        let clear = (0..poses.len()).find(|i| poses[*i].as_ref().is_some_and(is_clear));
        let Some(seed) = clear.or_else(|| (0..poses.len()).find(there)) else { return found };
        let mut follow = |order: &mut dyn Iterator<Item = usize>| {
            let mut height = None;
            for i in order.filter(there) {
                height = poses[i].and_then(|pose| self.height_from(height, pose));
                found[i] = height;
            }
        };
        follow(&mut (0..=seed).rev());
        follow(&mut (seed..poses.len()));
        found
    }

    /// One is above the other: they neither see nor touch each other.
    // Few maps have ways one above the other; on all others this must not burden the loops that ask.
    #[cold]
    #[inline(never)]
    pub fn are_apart(&self, one: Pose, other: Pose) -> bool {
        self.has_heights() && self.are_apart_at((one, self.height_at(one)), (other, self.height_at(other)))
    }

    /// The same where their heights are known. What follows another one up a slope is not below it.
    pub fn are_apart_at(&self, one: (Pose, Option<f64>), other: (Pose, Option<f64>)) -> bool {
        heights_are_apart(one.1, other.1) && !self.leads_to(one, other) && !self.leads_to(other, one)
    }

    /// The lanelets ahead lead to what is beside or ahead without much of a detour: it is on the same slope.
    fn leads_to(&self, (pose, height): (Pose, Option<f64>), (other, there): (Pose, Option<f64>)) -> bool {
        let reach = DETOUR_FACTOR * pose.position.distance(other.position) + DETOUR_MIN;
        let lanelets_at = |pose: Pose, height| {
            self.lanelets_at(pose.position).into_iter().filter(move |one| self.is_level(*one, pose.position, height))
        };
        let goals: Vec<usize> = lanelets_at(other, there).collect();
        // Lanelets with the arc length at which the pose is, seen from their beginning [m].
        let start = |lanelet: usize| (lanelet, self.lanelets[lanelet].center.project(pose.position).s);
        let mut open: Vec<(usize, f64)> = lanelets_at(pose, height).map(start).collect();
        let mut known: Vec<usize> = open.iter().map(|(lanelet, _)| *lanelet).collect();
        while let Some((lanelet, from)) = open.pop() {
            let here = &self.lanelets[lanelet];
            if goals.iter().any(|goal| *goal == lanelet || self.is_abreast(lanelet, *goal)) {
                let ahead = here.center.project(other.position).s - from;
                if (0.0..=reach).contains(&ahead) {
                    return true;
                }
            }
            let ahead = here.length - from;
            for &next in here.successors.iter().filter(|_| ahead <= reach) {
                if !known.contains(&next) {
                    known.push(next);
                    open.push((next, -ahead));
                }
            }
        }
        false
    }

    /// Two lanelets of one carriageway, whichever way they lead.
    fn is_abreast(&self, lanelet: usize, other: usize) -> bool {
        let mut abreast = vec![lanelet];
        let mut i = 0;
        while i < abreast.len() {
            let here = &self.lanelets[abreast[i]];
            for (next, _) in [here.adjacent_left, here.adjacent_right].into_iter().flatten() {
                if !abreast.contains(&next) {
                    abreast.push(next);
                }
            }
            i += 1;
        }
        abreast.contains(&other)
    }

    /// A lanelet is where something at a height is, neither above nor below it; also where a height is not known.
    pub fn is_level(&self, lanelet: usize, point: Point, height: Option<f64>) -> bool {
        !heights_are_apart(self.height_of(lanelet, point), height)
    }

    /// Two lanelets are one above the other at a point.
    pub fn lanelets_are_apart(&self, [a, b]: [usize; 2], point: Point) -> bool {
        heights_are_apart(self.height_of(a, point), self.height_of(b, point))
    }
}

/// Whether participants at these heights [m] are too far apart to meet; never if a height is unknown.
pub fn heights_are_apart(one: Option<f64>, other: Option<f64>) -> bool {
    one.zip(other).is_some_and(|(one, other)| apart(one, other))
}

fn apart(one: f64, other: f64) -> bool {
    (one - other).abs() > HEIGHT_CLEARANCE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::testing::{lane, open, straight};

    fn bridge(height: f64) -> RoadNetwork {
        let (flat, above) = (straight((-50.0, 0.0), (50.0, 0.0)), straight((0.0, -50.0), (0.0, 50.0)));
        let raised = |points: &[Point], z: f64| points.iter().map(|point| (*point, z)).collect();
        open(vec![lane(1, &flat), lane(2, &above)]).with_heights([(1, raised(&flat, 0.0)), (2, raised(&above, height))])
    }

    #[test]
    fn what_crosses_more_than_3_m_above_is_apart_and_what_crosses_at_3_m_is_not() {
        let at = |orientation| Pose { position: Point::default(), orientation };
        for (height, apart) in [(7.0, true), (-7.0, true), (3.01, true), (3.0, false), (0.0, false)] {
            let road = bridge(height);
            assert_eq!(road.are_apart(at(0.0), at(FRAC_PI_2)), apart, "{height} m");
            assert_eq!(road.are_apart(at(0.1), at(-FRAC_PI_2)), apart, "{height} m, backwards");
            assert_eq!(road.lanelets_are_apart([0, 1], Point::default()), apart);
            assert!(!road.are_apart(at(0.0), at(std::f64::consts::PI)));
        }
    }

    #[test]
    fn heights_rise_between_points_and_where_none_are_stated_nothing_is_apart() {
        let way = straight((0.0, 0.0), (100.0, 0.0));
        let road = open(vec![lane(1, &way)]).with_heights([(1, vec![(way[0], 0.0), (way[way.len() - 1], 10.0)])]);
        let height = road.height_of(0, Point::new(30.0, 2.0)).unwrap();
        assert!((height - 3.0).abs() < 1e-9, "{height} m");
        let none = open(vec![lane(1, &way)]);
        let pose = Pose { position: Point::new(30.0, 0.0), orientation: 0.0 };
        assert!(none.height_at(pose).is_none() && !none.are_apart(pose, pose) && !none.has_heights());
    }
}
