//! One evaluated vehicle at one time step: the participants around it, which of them count, and its leader.

use crate::conduct::STATIONARY_SPEED;
use std::cell::OnceCell;

use super::formulas;
use super::overlap::Overlaps;
use super::paths::{Path, PathCode, PathSystems, starts};
use super::settings::{LeadMembership, Settings, ThwMode};
use super::traffic::{ALONG_ANGLE, Extents, LaneletTrack, Traffic};
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, wrap_angle};

/// Recorded footprints are this inexact [m]: bodies that overlap less were beside each other.
const GRAZING_OVERLAP: f64 = 0.3;

/// Everything that does not change from one moment to the next.
pub(super) struct Context<'a> {
    pub traffic: &'a Traffic,
    pub settings: &'a Settings,
    pub tracks: &'a [LaneletTrack],
    pub columns: &'a [Vec<(u32, Point)>],
    pub paths: &'a PathSystems,
    /// There if something needs it.
    pub overlaps: Option<&'a Overlaps>,
    /// Pairs (row, row, column) that touched on the way to a column, whatever their footprints do at it; sorted.
    pub contacts: &'a [(u32, u32, u32)],
}

/// A value with the partner and the path that were decisive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Decisive {
    pub value: f64,
    /// Row; `u32::MAX`: no partner.
    pub partner: u32,
    pub via: Via,
}

/// Where a value was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Via {
    /// No path is needed, or there is none.
    Nothing,
    Path(PathCode),
    /// Where two lanelets overlap: the own one, the other one's.
    ConflictArea(u32, u32),
}

impl Decisive {
    pub(super) const fn without_partner(value: f64) -> Self {
        Self { value, partner: u32::MAX, via: Via::Nothing }
    }

    pub(super) fn keep_smaller(&mut self, value: f64, partner: u32, via: Via) {
        if value < self.value {
            *self = Self { value, partner, via };
        }
    }

    fn keep_larger(&mut self, value: f64, partner: u32, via: Via) {
        if value > self.value {
            *self = Self { value, partner, via };
        }
    }
}

/// What follows from the vehicles ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Following {
    pub hw: Decisive,
    pub thw: Decisive,
    pub ttc: Decisive,
    pub a_long_req: Decisive,
    pub a_lat_req: Decisive,
}

impl Following {
    pub(super) const UNKNOWN: Self = Self::starting_with(f64::NAN, f64::NAN);
    const FREE: Self = Self::starting_with(f64::INFINITY, 0.0);

    const fn starting_with(far: f64, none: f64) -> Self {
        let (far, none) = (Decisive::without_partner(far), Decisive::without_partner(none));
        Self { hw: far, thw: far, ttc: far, a_long_req: none, a_lat_req: none }
    }
}

/// A participant within the radius.
struct Neighbour {
    row: u32,
    /// The footprints cannot be nearer than this [m].
    distance_at_least: f64,
    touches: bool,
    /// They touch for certain: a run says so, or they overlap by more than recordings are inexact.
    collides: bool,
    /// It drives above or below.
    is_apart: bool,
    considered: OnceCell<bool>,
}

/// A path that the judged vehicle can take now, and where on it it is.
struct OwnPath<'a> {
    path: &'a Path,
    code: PathCode,
    reach: usize,
    s: f64,
    d: f64,
    extents: Extents,
    velocity: (f64, f64),
    acceleration: f64,
    /// None of the other paths is followed longer.
    is_driven: bool,
}

/// What follows from the vehicles ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ahead {
    /// Of all on any path.
    pub all: Following,
    /// Of those in the way: on the path that is driven, where they stand or drive along it, and bodies would meet.
    pub in_the_way: Following,
}

pub(super) struct Moment<'a> {
    context: &'a Context<'a>,
    row: usize,
    column: usize,
    neighbours: Vec<Neighbour>,
    own: Vec<OwnPath<'a>>,
    /// Lanelets of all own paths, ascending.
    corridor: OnceCell<Vec<u32>>,
    /// Lanelets under the own footprint.
    under: OnceCell<Vec<usize>>,
}

/// Components of a vector that lies along the heading, in the frame of a path's tangent.
fn components(size: f64, cos: f64, sin: f64) -> (f64, f64) {
    (size * cos, size * sin)
}

/// A body without the margin by which recordings are inexact.
fn shrunk(body: &OrientedBox) -> OrientedBox {
    let inner = |half: f64| (half - 0.5 * GRAZING_OVERLAP).max(0.0);
    OrientedBox { half_length: inner(body.half_length), half_width: inner(body.half_width), ..*body }
}

impl<'a> Moment<'a> {
    pub(super) fn new(context: &'a Context<'a>, row: usize, column: usize) -> Self {
        let mut moment = Self {
            context,
            row,
            column,
            neighbours: Vec::new(),
            own: Vec::new(),
            corridor: OnceCell::new(),
            under: OnceCell::new(),
        };
        moment.find_neighbours();
        moment.find_paths();
        moment
    }

    fn find_neighbours(&mut self) {
        let Context { traffic, settings, tracks, columns, contacts, .. } = self.context;
        let (row, column) = (self.row, self.column);
        let (pose, shape) = (traffic.pose(row, column), &traffic.shape[row]);
        for &(other, position) in &columns[column] {
            let away = (position - pose.position).norm_squared();
            let other_shape = &traffic.shape[other as usize];
            let reach = shape.bounding_radius() + other_shape.bounding_radius();
            let is_near = away < settings.radius * settings.radius;
            if other as usize == row || !(is_near || away <= reach * reach) {
                continue;
            }
            let at = |row: usize| (traffic.pose(row, column), tracks[row].height(column));
            let is_apart = traffic.road.has_heights() && traffic.road.are_apart_at(at(row), at(other as usize));
            let distance_at_least = away.sqrt() - reach;
            let (first, second) = (other.min(row as u32), other.max(row as u32));
            let (body, other_pose) = (shape.oriented_box(pose), traffic.pose(other as usize, column));
            let is_known = contacts.binary_search(&(first, second, column as u32)).is_ok();
            let touches =
                (distance_at_least <= 1e-6 && !is_apart && shape.overlaps(pose, other_shape, other_pose)) || is_known;
            let collides =
                touches && (is_known || shrunk(&body).overlaps(&shrunk(&other_shape.oriented_box(other_pose))));
            // Participants in contact count however far apart their centres are.
            if !(is_near || touches) {
                continue;
            }
            let row = other;
            let considered = OnceCell::new();
            self.neighbours.push(Neighbour { row, distance_at_least, touches, collides, is_apart, considered });
        }
    }

    fn find_paths(&mut self) {
        let Context { traffic, settings, tracks, paths, .. } = self.context;
        let (row, column) = (self.row, self.column);
        let i = traffic.index(row, column);
        let (position, heading) = (traffic.position(row, column), tracks[row].heading(column));
        for (start, here) in starts(tracks[row].here(column)) {
            let length = traffic.road.lanelets()[here.lanelet as usize].length;
            let ahead = if start.reversed { here.s } else { length - here.s };
            for (number, path) in paths.of(start).iter().enumerate() {
                let reach = path.reach(ahead, settings.radius);
                // A loop brings those behind on its first lanelet in front.
                if path.shared >= reach && !path.is_closed() {
                    continue;
                }
                let Some(foot) = path.curve.project(position, settings.radius) else { continue };
                let (cos, sin) = (foot.tangent.dot(heading), foot.tangent.cross(heading));
                self.own.push(OwnPath {
                    path,
                    code: PathCode::new(start, number, reach),
                    reach,
                    s: foot.s,
                    d: foot.d,
                    extents: Extents::of(&traffic.shape[row], cos, sin),
                    velocity: components(traffic.states.velocity[i], cos, sin),
                    acceleration: components(traffic.states.acceleration[i], cos, sin).0,
                    is_driven: false,
                });
            }
        }
        let follows = |own: &OwnPath<'_>| tracks[row].follows(&own.path.lanelets[..own.reach], column);
        let until: Vec<usize> = self.own.iter().map(follows).collect();
        let longest = until.iter().max();
        self.own.iter_mut().zip(&until).for_each(|(own, until)| own.is_driven = Some(until) == longest);
    }

    /// Headway, time headway, time to collision and the required accelerations, over all participants ahead.
    pub(super) fn following(&self) -> Ahead {
        if self.own.is_empty() {
            return Ahead { all: Following::UNKNOWN, in_the_way: Following::UNKNOWN };
        }
        let mut found = Ahead { all: Following::FREE, in_the_way: Following::FREE };
        let touched = self.neighbours.iter().find(|neighbour| neighbour.touches);
        let collided = self.neighbours.iter().find(|neighbour| neighbour.collides);
        for (other, following) in [(touched, &mut found.all), (collided, &mut found.in_the_way)] {
            let Some(other) = other else { continue };
            for measure in [&mut following.hw, &mut following.thw, &mut following.ttc] {
                measure.keep_smaller(0.0, other.row, Via::Nothing);
            }
        }
        for neighbour in self.neighbours.iter().filter(|neighbour| !neighbour.touches) {
            let other = neighbour.row as usize;
            let under = match self.context.settings.lead_membership {
                LeadMembership::Center => None,
                LeadMembership::Footprint => Some(self.under_footprint(other)),
            };
            for own in &self.own {
                let member = match &under {
                    None => {
                        let here = self.context.tracks[other].here(self.column);
                        here.iter().filter_map(|one| own.path.place(one.lanelet, own.reach)).max()
                    }
                    Some(under) => under.iter().filter_map(|one| own.path.place(*one as u32, own.reach)).max(),
                };
                // On lanelets that an earlier path shares, with the one behind them, nothing new is found.
                let is_new = |place| own.path.shared < place + 2 || own.path.is_closed();
                let Some(place) = member else { continue };
                if (is_new(place) || own.is_driven) && self.considers(neighbour) {
                    self.follow(own, other, is_new(place), &mut found);
                }
            }
        }
        found
    }

    /// What follows from a participant ahead on an own path; among all of them it counts where `is_new`.
    fn follow(&self, own: &OwnPath<'_>, other: usize, is_new: bool, found: &mut Ahead) {
        let Context { traffic, settings, tracks, .. } = self.context;
        let position = traffic.position(other, self.column);
        let Some(foot) = own.path.curve.project(position, settings.radius) else { return };
        let heading = tracks[other].heading(self.column);
        let (cos, sin) = (foot.tangent.dot(heading), foot.tangent.cross(heading));
        let extents = Extents::of(&traffic.shape[other], cos, sin);
        let place = own.path.seen_from(own.s, foot.s, 0.0);
        let headway = place - own.s - own.extents.front - extents.back;
        if headway <= 0.0 || (own.path.is_closed() && place - own.s > settings.radius) {
            return;
        }
        let i = traffic.index(other, self.column);
        let velocity = components(traffic.states.velocity[i], cos, sin);
        let acceleration = components(traffic.states.acceleration[i], cos, sin);
        let time_headway = match settings.thw_mode {
            ThwMode::Normalized => formulas::time_headway(headway, own.velocity.0),
            ThwMode::Recorded => self.time_to_reach(own, place - extents.back),
        };
        let closing = velocity.0 - own.velocity.0;
        let ttc = formulas::time_to_collision(headway, closing, acceleration.0 - own.acceleration);
        let required = if settings.leader_stops {
            formulas::required_acceleration_stopping(headway, own.velocity.0, velocity.0, acceleration.0)
        } else {
            formulas::required_acceleration(headway, closing, acceleration.0)
        };
        let offset =
            |time: f64| foot.d - own.d + (velocity.1 - own.velocity.1) * time + 0.5 * acceleration.1 * time * time;
        let (left, right) = (extents.left + own.extents.right, extents.right + own.extents.left);
        let speed = traffic.states.velocity[i];
        let is_along = cos.abs() >= ALONG_ANGLE.cos() || speed.abs() < STATIONARY_SPEED;
        let time = if ttc.is_finite() { ttc.min(settings.ttc_threshold) } else { 0.0 };
        // Oncoming traffic whose lane crosses the path follows its own lane, not the bends of the path.
        let straight = || own.path.curve.project(position + heading * (speed * time), settings.radius);
        let meets = |beside: f64| beside > -left && beside < right;
        let stays = || straight().is_some_and(|there| meets(there.d - own.d - own.velocity.1 * time));
        let is_in_the_way = own.is_driven && is_along && meets(offset(time)) && (speed * cos >= 0.0 || stays());
        let (row, via) = (other as u32, Via::Path(own.code));
        for (following, counts) in [(&mut found.all, is_new), (&mut found.in_the_way, is_in_the_way)] {
            if !counts {
                continue;
            }
            following.hw.keep_smaller(headway, row, via);
            following.thw.keep_smaller(time_headway, row, via);
            following.ttc.keep_smaller(ttc, row, via);
            following.a_long_req.keep_smaller(required, row, via);
            if ttc.is_finite() {
                let lateral = formulas::required_lateral_acceleration(ttc, offset(ttc), left, right);
                following.a_lat_req.keep_larger(lateral, row, via);
            }
        }
    }

    /// Time until the front is recorded at an arc length of the path [s].
    fn time_to_reach(&self, own: &OwnPath<'_>, s: f64) -> f64 {
        let Context { traffic, settings, tracks, .. } = self.context;
        let reached = (self.column..traffic.states.n_steps).find(|column| {
            traffic.is_there(self.row, *column)
                && own.path.curve.project(traffic.position(self.row, *column), settings.radius).is_some_and(|foot| {
                    let heading = tracks[self.row].heading(*column);
                    let (cos, sin) = (foot.tangent.dot(heading), foot.tangent.cross(heading));
                    let place = own.path.seen_from(own.s, foot.s, own.extents.front);
                    place + Extents::of(&traffic.shape[self.row], cos, sin).front >= s
                })
        });
        reached.map_or(f64::INFINITY, |column| (column - self.column) as f64 * traffic.dt)
    }

    /// Smallest distance of the footprints to any participant that counts [m], and its row; infinite without one.
    pub(super) fn nearest(&self) -> (f64, u32) {
        let Context { traffic, .. } = self.context;
        let (pose, shape) = (traffic.pose(self.row, self.column), &traffic.shape[self.row]);
        let mut nearest = (f64::INFINITY, u32::MAX);
        let mut consider = |neighbour: &Neighbour| {
            if neighbour.is_apart || neighbour.distance_at_least > nearest.0 || !self.considers(neighbour) {
                return;
            }
            let other = neighbour.row as usize;
            let distance = if neighbour.touches {
                0.0
            } else {
                shape.distance(pose, &traffic.shape[other], traffic.pose(other, self.column))
            };
            if distance < nearest.0 || (distance == nearest.0 && neighbour.row < nearest.1) {
                nearest = (distance, neighbour.row);
            }
        };
        // Apparently nearest participants first: then most others need no exact distance.
        let by_bound = |a: &&Neighbour, b: &&Neighbour| a.distance_at_least.total_cmp(&b.distance_at_least);
        if let Some(first) = self.neighbours.iter().filter(|one| !one.is_apart).min_by(by_bound) {
            consider(first);
        }
        self.neighbours.iter().for_each(consider);
        nearest
    }

    /// Traffic in the opposite direction counts only where the ways meet; contact always counts.
    fn considers(&self, neighbour: &Neighbour) -> bool {
        *neighbour.considered.get_or_init(|| {
            let other = neighbour.row as usize;
            !self.context.settings.oncoming_filter
                || neighbour.touches
                || !self.is_opposite(other)
                || self.ways_meet(other)
        })
    }

    fn is_opposite(&self, other: usize) -> bool {
        let Context { traffic, settings, tracks, .. } = self.context;
        let limit = settings.opposite_angle;
        let orientation = traffic.pose(other, self.column).orientation;
        if self.own.is_empty() {
            return wrap_angle(orientation - traffic.pose(self.row, self.column).orientation).abs() > limit;
        }
        let cannot_be = self.own.iter().all(|own| {
            let (middle, half) = own.path.curve.directions();
            wrap_angle(orientation - middle).abs() + half <= limit
        });
        if cannot_be {
            return false;
        }
        let position = traffic.position(other, self.column);
        let feet = self.own.iter().filter_map(|own| own.path.curve.project(position, settings.radius));
        let nearest = feet.min_by(|a, b| a.d.abs().total_cmp(&b.d.abs()));
        match nearest {
            Some(foot) => foot.tangent.dot(tracks[other].heading(self.column)) < limit.cos(),
            None => wrap_angle(orientation - traffic.pose(self.row, self.column).orientation).abs() > limit,
        }
    }

    /// The own footprint is on the other one's lane, the other one's lane crosses an own path, or the other one's
    /// footprint is on an own path.
    fn ways_meet(&self, other: usize) -> bool {
        let Context { tracks, .. } = self.context;
        let overlaps = self.overlaps();
        let own_under = self.under.get_or_init(|| self.under_footprint(self.row));
        let corridor = self.corridor.get_or_init(|| {
            let mut all: Vec<u32> =
                self.own.iter().flat_map(|own| own.path.lanelets[..own.reach].iter().copied()).collect();
            all.sort_unstable();
            all.dedup();
            all
        });
        let mut lane = tracks[other].lane_from(self.column);
        lane.any(|lanelet| {
            own_under.contains(&lanelet) || corridor.iter().any(|own| overlaps.of(lanelet, *own as usize))
        }) || self.under_footprint(other).iter().any(|lanelet| corridor.binary_search(&(*lanelet as u32)).is_ok())
    }

    fn under_footprint(&self, row: usize) -> Vec<usize> {
        let Context { traffic, tracks, .. } = self.context;
        let (pose, height) = (traffic.pose(row, self.column), tracks[row].height(self.column));
        let mut found = self.overlaps().under(&traffic.road, &traffic.shape[row], pose);
        found.retain(|lanelet| traffic.road.is_level(*lanelet, pose.position, height));
        found
    }

    fn overlaps(&self) -> &Overlaps {
        self.context.overlaps.expect("made whenever the settings ask for it")
    }
}
