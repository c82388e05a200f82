//! Time to contact of footprints that keep their speed and heading.

use rayon::prelude::*;

use super::footing::is_within_one_lane;
use super::traffic::Traffic;
use crate::collision::first_contact;
use crate::geometry::{Point, Pose};

/// Farther from straight ahead than this, others count only in the open: 30 degrees.
const AHEAD_COS: f64 = 0.866_025_403_784_438_6;
/// Others more than 150 degrees off are behind.
const BEHIND_COS: f64 = -AHEAD_COS;
/// Vehicles slower than this stand [m/s].
const STANDING_SPEED: f64 = 0.005;

/// A request for times to contact.
#[derive(Debug, Clone)]
pub struct StraightRequest {
    /// Rows of the traffic, each with the distance from its rear axle forward to its centre [m].
    pub judged: Vec<(usize, f64)>,
    /// Lanelets that cross others, by index.
    pub crossing: Vec<bool>,
    /// Contacts later than this are none [s].
    pub horizon: f64,
    /// Number of threads; results do not depend on it.
    pub threads: usize,
}

/// Time to contact at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StraightTime {
    /// Time until footprints touch [s]; infinite without a contact, NaN where the participant is absent.
    pub time: f64,
    /// Id of the other one; -1: none.
    pub partner: i64,
}

/// Earliest contact of each judged participant at each time step if it and one other keep speed and heading.
///
/// Others count within 30 degrees ahead of the rear axle; while the footprint is not within one lane, or the centre is
/// on a lanelet that crosses others, within 150 degrees. Where a participant reverses, ahead is behind its front axle. A
/// standing participant has no contact.
///
/// # Returns
/// Shape (judged, time steps), row-major.
pub fn straight_times(traffic: &Traffic, request: &StraightRequest) -> Vec<StraightTime> {
    let n = traffic.states.n_steps;
    let has_heights = traffic.road.has_heights();
    let heights: Vec<_> =
        (0..traffic.states.ids.len()).filter(|_| has_heights).map(|row| traffic.heights(row)).collect();
    let are_apart = |row: usize, other: usize, column: usize| {
        let at = |row: usize| (traffic.pose(row, column), heights[row][column]);
        has_heights && traffic.road.are_apart_at(at(row), at(other))
    };
    let one = |(row, axle): &(usize, f64)| -> Vec<StraightTime> {
        (0..n).map(|column| straight_time(traffic, request, (*row, *axle), column, &are_apart)).collect()
    };
    // The global thread pool is left alone: without threads of its own the calling thread does it all.
    let pool = (request.threads > 1).then(|| rayon::ThreadPoolBuilder::new().num_threads(request.threads).build());
    match pool {
        Some(Ok(pool)) => pool.install(|| request.judged.par_iter().map(one).collect::<Vec<_>>()).concat(),
        _ => request.judged.iter().map(one).collect::<Vec<_>>().concat(),
    }
}

/// `are_apart` tells of two rows whether one is above the other at a column.
fn straight_time(
    traffic: &Traffic,
    request: &StraightRequest,
    (row, axle): (usize, f64),
    column: usize,
    are_apart: &(dyn Fn(usize, usize, usize) -> bool + Sync),
) -> StraightTime {
    let none = StraightTime { time: f64::INFINITY, partner: -1 };
    if !traffic.is_there(row, column) {
        return StraightTime { time: f64::NAN, ..none };
    }
    let speed = traffic.states.velocity[traffic.index(row, column)];
    if speed.abs() <= STANDING_SPEED {
        return none;
    }
    let pose = traffic.pose(row, column);
    // The direction in which it moves.
    let heading = Point::from_angle(pose.orientation) * if speed < 0.0 { -1.0 } else { 1.0 };
    let rear = pose.position - heading * axle;
    let shape = &traffic.shape[row];
    let mut least_cos = None;
    let (mut nearest, mut partner) = (1.0, -1);
    for other in (0..traffic.states.ids.len()).filter(|other| *other != row) {
        if !traffic.is_there(other, column) || are_apart(row, other, column) {
            continue;
        }
        let there = traffic.pose(other, column);
        let away = there.position - rear;
        let cos = away.dot(heading) / away.norm().max(1e-9);
        if cos < BEHIND_COS {
            continue;
        }
        let velocity = traffic.states.velocity[traffic.index(other, column)];
        let (from, to) = (moved(pose, speed, request.horizon), moved(there, velocity, request.horizon));
        let body = &traffic.shape[other];
        let reach = shape.bounding_radius() + body.bounding_radius();
        let (offset, shift) =
            (there.position - pose.position, (to.position - there.position) - (from.position - pose.position));
        if nearest_approach(offset, shift) > reach + 0.01 {
            continue;
        }
        if cos < AHEAD_COS {
            let is_open = *least_cos.get_or_insert_with(|| is_in_the_open(traffic, request, row, pose));
            if !is_open {
                continue;
            }
        }
        if let Some(fraction) = first_contact(shape, pose, from, body, there, to)
            && (fraction < nearest || (fraction <= nearest && partner < 0))
        {
            (nearest, partner) = (fraction, traffic.states.ids[other]);
        }
    }
    if partner < 0 { none } else { StraightTime { time: nearest * request.horizon, partner } }
}

fn is_in_the_open(traffic: &Traffic, request: &StraightRequest, row: usize, pose: Pose) -> bool {
    let crosses = |lanelet: &usize| request.crossing.get(*lanelet).copied().unwrap_or(false);
    traffic.road.lanelets_at(pose.position).iter().any(crosses)
        || !is_within_one_lane(&traffic.road, &traffic.shape[row], pose)
}

fn moved(pose: Pose, velocity: f64, time: f64) -> Pose {
    Pose { position: pose.position + Point::from_angle(pose.orientation) * (velocity * time), ..pose }
}

/// Smallest distance of two points during a motion [m], from their offset at the start and its change.
fn nearest_approach(offset: Point, shift: Point) -> f64 {
    let length_squared = shift.norm_squared();
    let fraction = if length_squared > 0.0 { (-offset.dot(shift) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (offset + shift * fraction).norm()
}
