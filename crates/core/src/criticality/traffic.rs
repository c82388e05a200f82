//! The evaluated traffic: recorded states with footprints, completed, and the position of each participant on the road.

use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::shape::Shape;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::limits::{NUMBER_MAX, is_possible};
use crate::road::RoadNetwork;
use crate::trajectory::States;

/// A vehicle whose heading differs less than this from a lane's drives along it [rad].
pub(super) const ALONG_ANGLE: f64 = FRAC_PI_4;

/// Recorded traffic on its road; static participants stand.
#[derive(Debug, Clone)]
pub struct Traffic {
    pub(super) dt: f64,
    pub(super) road: Arc<RoadNetwork>,
    pub(super) states: States,
    pub(super) shape: Vec<Shape>,
    pub(super) is_static: Vec<bool>,
}

impl Traffic {
    /// Checks the parts; accelerations that are not numbers are derived from the speeds (central differences, one-sided
    /// at the ends of what is known, 0 for a single state).
    ///
    /// # Errors
    /// `InvalidInput`: dt not positive, tables of different lengths, ids not ascending, a state that is not a number
    /// (naming participant and time step).
    pub fn new(
        dt: f64,
        road: Arc<RoadNetwork>,
        states: States,
        shape: Vec<Shape>,
        is_static: Vec<bool>,
    ) -> Result<Self> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::invalid(format!("the time step size must be a positive number of seconds, not {dt}")));
        }
        let n = states.ids.len();
        if shape.len() != n || is_static.len() != n {
            return Err(Error::invalid(format!(
                "{n} participants, but {} shapes and {} static flags",
                shape.len(),
                is_static.len()
            )));
        }
        states.check("participant")?;
        for (id, shape) in states.ids.iter().zip(&shape) {
            shape.check_numbers().map_err(|error| Error::invalid(format!("participant {id}: {error}")))?;
        }
        let mut traffic = Self { dt, road, states, shape, is_static };
        for row in 0..n {
            traffic.complete(row)?;
        }
        Ok(traffic)
    }

    fn complete(&mut self, row: usize) -> Result<()> {
        let (n, table) = (self.states.n_steps, &mut self.states);
        let start = row * n;
        for column in 0..n {
            let i = start + column;
            if !table.valid[i] {
                continue;
            }
            if self.is_static[row] {
                (table.velocity[i], table.acceleration[i]) = (0.0, 0.0);
            }
            if ![table.x[i], table.y[i], table.orientation[i], table.velocity[i]].iter().all(|v| is_possible(*v)) {
                let time_step = table.first_time_step + column as i64;
                return Err(Error::invalid(format!(
                    "participant {} has a state that is not a number at time step {time_step}, or beyond {NUMBER_MAX:e}",
                    table.ids[row]
                )));
            }
        }
        for column in 0..n {
            let i = start + column;
            if table.valid[i] && !table.acceleration[i].is_finite() {
                let before = if column > 0 && table.valid[i - 1] { i - 1 } else { i };
                let after = if column + 1 < n && table.valid[i + 1] { i + 1 } else { i };
                let change = table.velocity[after] - table.velocity[before];
                table.acceleration[i] = change / ((after - before).max(1) as f64 * self.dt);
            }
        }
        Ok(())
    }

    /// Number of participants.
    #[expect(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.states.ids.len()
    }

    /// Row of a participant.
    pub fn row(&self, id: i64) -> Option<usize> {
        self.states.row(id)
    }

    #[inline]
    pub(super) fn index(&self, row: usize, column: usize) -> usize {
        row * self.states.n_steps + column
    }

    #[inline]
    pub(super) fn is_there(&self, row: usize, column: usize) -> bool {
        self.states.valid[self.index(row, column)]
    }

    #[inline]
    pub(super) fn position(&self, row: usize, column: usize) -> Point {
        let i = self.index(row, column);
        Point::new(self.states.x[i], self.states.y[i])
    }

    #[inline]
    pub(super) fn pose(&self, row: usize, column: usize) -> Pose {
        let i = self.index(row, column);
        Pose::new(self.states.x[i], self.states.y[i], self.states.orientation[i])
    }

    /// Height of the ways that a row drives, per column [m]; empty where the map states none.
    pub(super) fn heights(&self, row: usize) -> Vec<Option<f64>> {
        if !self.road.has_heights() {
            return Vec::new();
        }
        let pose = |column: usize| self.is_there(row, column).then(|| self.pose(row, column));
        self.road.heights_along(&(0..self.states.n_steps).map(pose).collect::<Vec<_>>())
    }

    /// First and last column in which a row is there.
    pub(super) fn span(&self, row: usize) -> Option<(usize, usize)> {
        let valid = &self.states.valid[row * self.states.n_steps..(row + 1) * self.states.n_steps];
        Some((valid.iter().position(|v| *v)?, valid.iter().rposition(|v| *v)?))
    }
}

/// A lanelet under a centre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Here {
    pub lanelet: u32,
    /// Arc length on its centre line [m].
    pub s: f64,
    /// Distance to its centre line [m].
    pub distance: f64,
    /// Heading minus direction of the lanelet [rad].
    pub turn: f64,
}

/// The way of one participant over the lanelets.
#[derive(Debug, Clone, Default)]
pub(super) struct LaneletTrack {
    starts: Vec<u32>,
    here: Vec<Here>,
    /// Unit vectors of the heading, per column.
    headings: Vec<Point>,
    /// Lanelets it drives along at some step, each with the last column at which it does.
    lane: Vec<(u32, u32)>,
    /// First and last columns of its stays on lanelets, in the order of their beginnings.
    stays: Vec<(u32, usize, usize)>,
    /// Height of the ways that it drives, per column [m]; empty where the map states none.
    heights: Vec<Option<f64>>,
    is_static: bool,
}

impl LaneletTrack {
    fn of(traffic: &Traffic, row: usize) -> Self {
        let is_static = traffic.is_static[row];
        let n = traffic.states.n_steps;
        let mut track = Self { starts: vec![0], is_static, heights: traffic.heights(row), ..Self::default() };
        let mut found: Vec<Here> = Vec::new();
        let mut last: Option<usize> = None;
        for column in 0..n {
            if traffic.is_there(row, column) {
                let pose = traffic.pose(row, column);
                if !(is_static && last.is_some()) {
                    found = lanelets_here(&traffic.road, pose, track.height(column));
                    track.here.extend(&found);
                    track.headings.push(Point::from_angle(pose.orientation));
                } else {
                    track.headings.push(track.headings[track.headings.len() - 1]);
                }
                for here in &found {
                    let goes_on = |stay: &&mut (u32, usize, usize)| stay.0 == here.lanelet && stay.2 + 1 >= column;
                    match track.stays.iter_mut().rev().find(goes_on) {
                        Some(stay) => stay.2 = column,
                        None => track.stays.push((here.lanelet, column, column)),
                    }
                }
                for here in found.iter().filter(|here| here.turn.abs() <= ALONG_ANGLE) {
                    match track.lane.iter_mut().find(|(lanelet, _)| *lanelet == here.lanelet) {
                        Some((_, until)) => *until = column as u32,
                        None => track.lane.push((here.lanelet, column as u32)),
                    }
                }
                last = Some(column);
            } else {
                track.headings.push(Point::default());
            }
            track.starts.push(track.here.len() as u32);
        }
        track
    }

    /// Lanelets that contain the centre at a column.
    #[inline]
    pub(super) fn here(&self, column: usize) -> &[Here] {
        if self.is_static {
            return &self.here;
        }
        &self.here[self.starts[column] as usize..self.starts[column + 1] as usize]
    }

    /// Last column until which its way from a column on is one along these lanelets.
    pub(super) fn follows(&self, lanelets: &[u32], column: usize) -> usize {
        let mut until = column;
        for lanelet in lanelets {
            let goes_on = |stay: &&(u32, usize, usize)| stay.0 == *lanelet && stay.1 <= until + 1 && stay.2 > until;
            until = self.stays.iter().rfind(goes_on).map_or(until, |stay| stay.2);
        }
        until
    }

    /// Height at a column [m]; `None` where it is not known.
    #[inline]
    pub(super) fn height(&self, column: usize) -> Option<f64> {
        self.heights.get(column).copied().flatten()
    }

    #[inline]
    pub(super) fn heading(&self, column: usize) -> Point {
        self.headings[column]
    }

    /// Lanelets that the centre drives along from a column to the end of the track.
    #[inline]
    pub(super) fn lane_from(&self, column: usize) -> impl Iterator<Item = usize> {
        self.lane.iter().filter(move |(_, until)| *until as usize >= column).map(|(lanelet, _)| *lanelet as usize)
    }
}

fn lanelets_here(road: &RoadNetwork, pose: Pose, height: Option<f64>) -> Vec<Here> {
    let place = |lanelet: usize| {
        let foot = road.lanelets()[lanelet].center.project(pose.position);
        let turn = wrap_angle(pose.orientation - road.heading_at(lanelet, foot.s));
        Here { lanelet: lanelet as u32, s: foot.s, distance: foot.distance, turn }
    };
    let is_level = |lanelet: &usize| road.is_level(*lanelet, pose.position, height);
    road.lanelets_at(pose.position).into_iter().filter(is_level).map(place).collect()
}

/// The lanelets that each participant passes.
pub(super) fn tracks(traffic: &Traffic) -> Vec<LaneletTrack> {
    (0..traffic.states.ids.len()).into_par_iter().map(|row| LaneletTrack::of(traffic, row)).collect()
}

/// The participants present at each column: (row, position).
pub(super) fn columns(traffic: &Traffic) -> Vec<Vec<(u32, Point)>> {
    let there = |column: usize| {
        let rows = (0..traffic.states.ids.len()).filter(|row| traffic.is_there(*row, column));
        rows.map(|row| (row as u32, traffic.position(row, column))).collect()
    };
    (0..traffic.states.n_steps).map(there).collect()
}

/// How far a footprint reaches from its centre [m] along and across a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extents {
    pub front: f64,
    pub back: f64,
    pub left: f64,
    pub right: f64,
}

impl Extents {
    /// `cos` and `sin` of the heading relative to the direction.
    pub(super) fn of(shape: &Shape, cos: f64, sin: f64) -> Self {
        let (along, across) = (Point::new(cos, -sin), Point::new(sin, cos));
        let nothing = f64::NEG_INFINITY;
        let mut extents = Self { front: nothing, back: nothing, left: nothing, right: nothing };
        for part in shape.parts() {
            for vertex in &part.vertices {
                let (x, y) = (vertex.dot(along), vertex.dot(across));
                extents.front = extents.front.max(x + part.radius);
                extents.back = extents.back.max(part.radius - x);
                extents.left = extents.left.max(y + part.radius);
                extents.right = extents.right.max(part.radius - y);
            }
        }
        extents
    }
}
