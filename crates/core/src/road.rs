//! The roads: lanelets and their relations, which of them lie at a point, and the drivable area.

mod coverage;
mod edges;
mod filler;
mod follow;
mod grid;
mod ground;
mod heights;
mod judge;
mod lanelet;
mod open_ends;
mod pieces;
mod surface;
mod users;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

pub use edges::Segment;
pub(crate) use follow::Chains;
pub use heights::heights_are_apart;
pub use judge::RoadJudge;
pub use lanelet::Lanelet;
pub use pieces::EdgePieces;
pub use users::Users;

use std::sync::OnceLock;

use crate::error::Result;
use crate::geometry::{Aabb, Point, Pose, wrap_angle};
use crate::limits::LANELET_LENGTH_MAX;
use crate::settings::{between, settings};
use coverage::DrivableArea;
use follow::LaneCurve;
use ground::GroundMap;
use surface::{Surface, strip};

/// A lanelet as a file states it.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneletInput {
    /// Its id.
    pub id: i64,
    /// Left bound in driving direction, world frame [m].
    pub left: Vec<Point>,
    /// Right bound; CommonRoad gives it as many vertices as the left one.
    pub right: Vec<Point>,
    /// Ids of the lanelets that lead into it.
    pub predecessors: Vec<i64>,
    /// Ids of the lanelets into which it leads.
    pub successors: Vec<i64>,
    /// Id of the left neighbour, and whether it runs in the same direction.
    pub adjacent_left: Option<(i64, bool)>,
    /// Id of the right neighbour, and whether it runs in the same direction.
    pub adjacent_right: Option<(i64, bool)>,
    /// Speed limit [m/s]; NaN: unknown.
    pub speed_limit: f64,
    /// The kinds of participants for which it is a lane; others drive on it only where nothing else leads on.
    pub users: Users,
}

impl LaneletInput {
    /// A lane for all kinds between two bounds, without a limit, neighbours, predecessors and successors.
    pub fn between(id: i64, left: Vec<Point>, right: Vec<Point>) -> Self {
        Self {
            id,
            left,
            right,
            predecessors: Vec::new(),
            successors: Vec::new(),
            adjacent_left: None,
            adjacent_right: None,
            speed_limit: f64::NAN,
            users: Users::ALL,
        }
    }
}

settings! {
    /// Extent of the road, and what must stay on it.
    pub struct RoadSettings as RoadSettings {
        /// Width up to which gaps between lanelets count as road; a footprint may also overhang the edge by this much.
        gap_tolerance: f64 ["m"] = 0.1, between(0.0, 1.0);
        /// Length by which the road continues straight where the map ends (lanelets without successor or predecessor).
        open_end_length: f64 ["m"] = 120.0, between(0.0, LANELET_LENGTH_MAX);
        /// Part of the vehicle that must stay on the road. "wheels": the rectangle from the rear to the front axle, as
        /// wide as the vehicle; the body may reach over the edge, as above a kerb. "body": the whole footprint.
        /// Contacts always count with the whole body.
        judge: RoadJudge = RoadJudge::Wheels;
        /// Distance by which wheels may cross the edge in bends (curvature of at least 0.08 1/m).
        turn_tolerance: f64 ["m"] = 0.3, between(0.0, 2.0);
        /// Distance by which the body may reach beyond the lanelets with judge "wheels".
        overhang_max: f64 ["m"] = 0.8, between(0.0, 10.0);
    }
}

/// A lanelet that fits a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneMatch {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Arc length of the foot on its centre line [m].
    pub s: f64,
    /// Distance to the centre line [m], left positive.
    pub d: f64,
    /// Orientation minus direction of the lane [rad], in (-pi, pi].
    pub heading_error: f64,
}

/// The lanelets that fit a pose, best first, and memory of the search for them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Matching {
    inside: Vec<usize>,
    near: Vec<usize>,
    pub(crate) found: Vec<LaneMatch>,
}

/// All lanelets of a map, sorted by id, with a grid index. Immutable.
///
/// What belongs to no lanelet but is drivable: straight continuations beyond open ends (a lanelet without successor or
/// predecessor, whose neighbours in the same direction have none either, and behind which no other lanelet lies), and
/// small gaps between lanelets that are stated to follow each other (up to 3 m) or to be neighbours (up to 0.5 m).
#[derive(Debug, Clone)]
pub struct RoadNetwork {
    lanelets: Vec<Lanelet>,
    settings: RoadSettings,
    /// Successors of every lanelet, the straightest first.
    straightest_successors: Vec<Vec<usize>>,
    straightest_predecessors: Vec<Vec<usize>>,
    curves: Vec<LaneCurve>,
    area: DrivableArea,
    /// Made when they are asked for first.
    pieces: OnceLock<EdgePieces>,
    ground: OnceLock<GroundMap>,
    heights: heights::Heights,
}

impl RoadNetwork {
    /// Checks the lanelets, completes their relations and builds the index.
    ///
    /// Relations stated on one side only are completed, unknown ids dropped, and so are successors that start more
    /// than 3 m from the end. Where a successor starts before the end, the lanelets are cut so that they meet; what is
    /// cut off stays drivable. Lanelets that share a bound become neighbours if nothing else is stated.
    ///
    /// # Errors
    /// `InvalidInput` naming the lanelet: no lanelet at all, an id used twice, a bound with fewer than two vertices, a
    /// coordinate that is not a number or beyond [`crate::limits`], a centre line without length or too long; or naming
    /// the setting that is negative or too large.
    pub fn new(inputs: Vec<LaneletInput>, settings: RoadSettings) -> Result<Self> {
        settings.validate()?;
        let (lanelets, cut_off) = lanelet::linked(inputs)?;
        let mut fillers = open_ends::continuations(&lanelets, settings.open_end_length);
        fillers.extend(cut_off);
        fillers.extend(open_ends::seams(&lanelets));
        let mut triangles = Vec::new();
        for (i, lanelet) in lanelets.iter().enumerate() {
            strip(&lanelet.left, &lanelet.right, Some(i as u32), &mut triangles);
        }
        for filler in &fillers {
            strip(&filler.left, &filler.right, None, &mut triangles);
        }
        let surface = Surface::new(triangles, settings.gap_tolerance);
        let edges = edges::road_edges(&lanelets, &fillers, &surface, settings.gap_tolerance.max(0.01));
        let (straightest_successors, straightest_predecessors) = follow::straightest(&lanelets);
        let mut road = Self {
            area: DrivableArea::new(surface, edges, settings.gap_tolerance),
            lanelets,
            settings,
            straightest_successors,
            straightest_predecessors,
            curves: Vec::new(),
            pieces: OnceLock::new(),
            ground: OnceLock::new(),
            heights: heights::Heights::default(),
        };
        road.curves = (0..road.lanelets.len()).map(|i| LaneCurve::of(&road, i)).collect();
        if settings.judge != RoadJudge::Body {
            road.find_bends();
        }
        Ok(road)
    }

    /// All lanelets, ascending ids.
    pub fn lanelets(&self) -> &[Lanelet] {
        &self.lanelets
    }

    /// The settings it was built with.
    pub fn settings(&self) -> &RoadSettings {
        &self.settings
    }

    /// Index of the lanelet with an id.
    pub fn index_of(&self, id: i64) -> Option<usize> {
        self.lanelets.binary_search_by_key(&id, |lanelet| lanelet.id).ok()
    }

    /// Lanelets that contain a point, ascending. A point on a common border is in both.
    pub fn lanelets_at(&self, point: Point) -> Vec<usize> {
        let mut found = Vec::new();
        self.find_lanelets_at(point, &mut found);
        found
    }

    /// Lanelets at most `radius` [m] away from a point, ascending.
    pub fn lanelets_near(&self, point: Point, radius: f64) -> Vec<usize> {
        let mut found = Vec::new();
        self.find_lanelets_near(point, radius, &mut found);
        found
    }

    fn find_lanelets_at(&self, point: Point, found: &mut Vec<usize>) {
        let here = Aabb { min: point, max: point };
        self.area.surface.find_lanelets(&here, found, |triangle| triangle.contains(point));
    }

    fn find_lanelets_near(&self, point: Point, radius: f64, found: &mut Vec<usize>) {
        let around = Aabb { min: point, max: point }.grown(radius);
        self.area.surface.find_lanelets(&around, found, |triangle| triangle.is_within(point, radius));
    }

    /// Lanelets within `tolerance` [m] of the position whose direction differs by at most `angle_max` [rad]. Best
    /// first: lanelets that contain the position, then by heading error, then by offset, then by id.
    pub fn matching(&self, pose: Pose, tolerance: f64, angle_max: f64) -> Vec<LaneMatch> {
        let mut matching = Matching::default();
        self.find_matching(pose, tolerance, angle_max, &mut matching);
        matching.found
    }

    /// The largest speed limit of the lanelets at a pose that lead its way (within 90 degrees) [m/s], infinite if one of
    /// them has none, NaN if none leads its way; and the least difference of headings from any lanelet there [rad], NaN
    /// beside all of them.
    pub fn lane_rules(&self, pose: Pose) -> (f64, f64) {
        let found = self.matching(pose, 0.0, std::f64::consts::PI);
        let leading = found.iter().filter(|lane| lane.heading_error.abs() <= std::f64::consts::FRAC_PI_2);
        let limit = leading.map(|lane| self.lanelets[lane.lanelet].speed_limit);
        let limit = limit.map(|limit| if limit.is_nan() { f64::INFINITY } else { limit }).reduce(f64::max);
        let error = found.iter().map(|lane| lane.heading_error.abs()).reduce(f64::min);
        (limit.unwrap_or(f64::NAN), error.unwrap_or(f64::NAN))
    }

    /// As `matching`, into memory that is reused.
    pub(crate) fn find_matching(&self, pose: Pose, tolerance: f64, angle_max: f64, memory: &mut Matching) {
        let Matching { inside, near, found } = memory;
        self.find_lanelets_at(pose.position, inside);
        self.find_lanelets_near(pose.position, tolerance, near);
        found.clear();
        found.extend(near.iter().filter_map(|&lanelet| {
            let foot = self.lanelets[lanelet].center.project(pose.position);
            let heading_error = wrap_angle(pose.orientation - self.curves[lanelet].heading_at(foot.s));
            let fits = heading_error.abs() <= angle_max;
            fits.then_some(LaneMatch { lanelet, s: foot.s, d: foot.d, heading_error })
        }));
        found.sort_unstable_by(|a, b| {
            let outside = |found: &LaneMatch| !inside.contains(&found.lanelet);
            outside(a)
                .cmp(&outside(b))
                .then(a.heading_error.abs().total_cmp(&b.heading_error.abs()))
                .then(a.d.abs().total_cmp(&b.d.abs()))
                .then(a.lanelet.cmp(&b.lanelet))
        });
    }
}
