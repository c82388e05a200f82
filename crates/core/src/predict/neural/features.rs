//! What the network is told about a vehicle: its past, its neighbours, its paths.

use super::candidate_path::CandidatePath;
use super::feature_table::{Feature, N_NEIGHBOUR, N_NEIGHBOURS, N_PATH, NEIGHBOUR, NOW, PAST, PATH, SMOOTHNESS};
use super::history::{History, INSTANT, N_INSTANTS};
use super::motion_smoothness::motion_smoothness;
use super::paths::{FREE, LEFT, N_OWN, N_PATHS, RIGHT};
use super::surroundings::{PresentBody, Surroundings};
use super::traffic::{GAP_MAX, Traffic};
use crate::geometry::Point;
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// Neighbours are within this distance [m].
const NEIGHBOUR_DISTANCE: f64 = 60.0;
/// Participants farther away [m] in x or y of the world are ignored, up to the size of a cell.
const SIGHT_RADIUS: f64 = 100.0;
/// Curves are driven with this lateral acceleration [m/s²].
const LATERAL_ACCELERATION: f64 = 3.0;
/// No curve allows more [m/s].
const CURVE_SPEED_MAX: f64 = 40.0;
/// Ends of the stretches whose mean curvature is told [m].
const STRETCHES: [f64; 7] = [5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0];
/// The known road is examined this far [m].
const END_MAX: f64 = 100.0;
/// Features are kept within this value: nothing that is broken gets far.
const FEATURE_LIMIT: f64 = 10.0;

fn write(out: &mut [f32], features: &[Feature], values: &[f64]) {
    debug_assert!(out.len() == values.len() && features.len() == values.len(), "one value per feature");
    for ((out, feature), value) in out.iter_mut().zip(features).zip(values) {
        *out = (value / feature.scale).clamp(-FEATURE_LIMIT, FEATURE_LIMIT) as f32;
    }
}

fn flag(value: bool) -> f64 {
    f64::from(u8::from(value))
}

/// Writes the features of a vehicle, `N_AGENT` of them.
pub fn write_agent(out: &mut [f32], scene: &Scene, body: &PresentBody, history: &History) {
    let (past, now) = out.split_at_mut(N_INSTANTS * PAST.len());
    let (now, even) = now.split_at_mut(NOW.len());
    let mut known = [None; N_INSTANTS];
    for (k, (out, instant)) in past.chunks_exact_mut(PAST.len()).zip(&history.instants).enumerate() {
        known[k] = instant.map(|then| {
            let delta = then.position - body.position;
            let expected = -history.velocity * (k + 1) as f64 * INSTANT;
            let ahead = delta.dot(body.axis) - expected;
            [ahead, body.axis.cross(delta), then.velocity - history.velocity]
        });
        write(out, &PAST, &known[k].map_or([0.0; PAST.len()], |[ahead, left, change]| [ahead, left, change, 1.0]));
    }
    let n_exact = history.instants.iter().take_while(|instant| instant.is_some_and(|then| then.is_exact)).count();
    write(even, &SMOOTHNESS, &motion_smoothness(&known, n_exact));
    let kind = scene.participants.kind[body.row];
    let is_car = matches!(kind, ParticipantKind::Car | ParticipantKind::PriorityVehicle | ParticipantKind::Taxi);
    let named = [ParticipantKind::Truck, ParticipantKind::Bus, ParticipantKind::Motorcycle, ParticipantKind::Bicycle];
    let [is_truck, is_bus, is_motorcycle, is_bicycle] = named.map(|name| flag(kind == name));
    write(
        now,
        &NOW,
        &[
            history.velocity,
            history.change.unwrap_or(0.0) / 0.5,
            history.acceleration.unwrap_or(0.0),
            history.yaw_rate.unwrap_or(0.0),
            2.0 * body.half_length,
            2.0 * body.half_width,
            flag(is_car),
            is_truck,
            is_bus,
            is_motorcycle,
            is_bicycle,
            flag(!is_car && !named.contains(&kind)),
            history.stillness.known,
            history.stillness.unmoved,
        ],
    );
}

/// Writes the features of the neighbours (`N_NEIGHBOURS` times `N_NEIGHBOUR`) and of the paths (`N_PATHS` times
/// `N_PATH`), all zero where there is none.
pub fn write_surroundings<'a>(
    neighbours: &mut [f32],
    paths: &mut [f32],
    own: &PresentBody,
    velocity: f64,
    candidates: &[Option<CandidatePath>; N_PATHS],
    surroundings: &'a Surroundings,
) {
    neighbours.fill(0.0);
    paths.fill(0.0);
    let mut nearest: [Option<(f64, &'a PresentBody)>; N_NEIGHBOURS] = [None; N_NEIGHBOURS];
    let mut traffic: [Traffic<'a>; N_PATHS] = [Traffic::default(); N_PATHS];
    surroundings.visit(own.position, SIGHT_RADIUS, |other| {
        if other.row == own.row {
            return;
        }
        let distance_squared = (other.position - own.position).norm_squared();
        if distance_squared <= NEIGHBOUR_DISTANCE * NEIGHBOUR_DISTANCE {
            insert(&mut nearest, distance_squared, other);
        }
        for (path, traffic) in candidates.iter().zip(&mut traffic) {
            if let Some(path) = path {
                traffic.meet(path, own, other);
            }
        }
    });
    for (out, (_, other)) in neighbours.chunks_exact_mut(N_NEIGHBOUR).zip(nearest.iter().flatten()) {
        write(out, &NEIGHBOUR, &neighbour(own, velocity, other));
    }
    let n_own = candidates[..N_OWN].iter().flatten().count() as f64;
    for (slot, (out, path)) in paths.chunks_exact_mut(N_PATH).zip(candidates).enumerate() {
        if let Some(path) = path {
            write(out, &PATH, &path_values(slot, path, velocity, &traffic[slot], n_own));
        }
    }
}

/// Keeps the nearest ones in order; equal distances by row.
fn insert<'a>(nearest: &mut [Option<(f64, &'a PresentBody)>; N_NEIGHBOURS], distance: f64, body: &'a PresentBody) {
    let is_before = |other: &Option<(f64, &PresentBody)>| {
        other.is_none_or(|(d, known)| distance.total_cmp(&d).then(body.row.cmp(&known.row)).is_lt())
    };
    if !is_before(&nearest[N_NEIGHBOURS - 1]) {
        return;
    }
    let mut i = N_NEIGHBOURS - 1;
    while i > 0 && is_before(&nearest[i - 1]) {
        nearest[i] = nearest[i - 1];
        i -= 1;
    }
    nearest[i] = Some((distance, body));
}

fn neighbour(own: &PresentBody, velocity: f64, other: &PresentBody) -> [f64; N_NEIGHBOUR] {
    let delta = other.position - own.position;
    let relative: Point = other.axis * other.velocity - own.axis * velocity;
    [
        delta.dot(own.axis),
        own.axis.cross(delta),
        relative.dot(own.axis),
        own.axis.cross(relative),
        other.axis.dot(own.axis),
        own.axis.cross(other.axis),
        2.0 * other.half_length,
        2.0 * other.half_width,
        other.velocity,
        flag(other.is_static),
        1.0,
    ]
}

fn path_values(slot: usize, path: &CandidatePath, velocity: f64, traffic: &Traffic<'_>, n_own: f64) -> [f64; N_PATH] {
    let mut curvature = [0.0; STRETCHES.len()];
    let mut segment = path.segment_at(0.0);
    let mut heading = path.pose_from(0.0, &mut segment).1;
    let mut from = 0.0;
    for (curvature, to) in curvature.iter_mut().zip(STRETCHES) {
        let next = path.pose_from(to, &mut segment).1;
        *curvature = (next - heading) / (to - from);
        (heading, from) = (next, to);
    }
    let curve_speed = |n: usize| {
        let sharpest = curvature[..n].iter().fold(0.0_f64, |sharpest, k| sharpest.max(k.abs()));
        (LATERAL_ACCELERATION / sharpest.max(1e-9)).sqrt().min(CURVE_SPEED_MAX) - velocity
    };
    let has_limit = path.speed_limit.is_finite();
    let Traffic { leader, second, follower, crossing } = traffic;
    let own_time = |s: f64| (s / velocity.max(0.5)).min(8.0);
    [
        flag(slot < N_OWN),
        flag(slot == LEFT),
        flag(slot == RIGHT),
        flag(slot == FREE),
        path.share,
        path.offset,
        path.heading_error,
        path.width,
        curvature[0],
        curvature[1],
        curvature[2],
        curvature[3],
        curvature[4],
        curvature[5],
        curvature[6],
        curve_speed(4),
        curve_speed(6),
        curve_speed(7),
        path.end.clamp(0.0, END_MAX),
        flag(has_limit),
        if has_limit { path.speed_limit } else { 0.0 },
        leader.map_or(GAP_MAX, |other| other.gap),
        leader.map_or(0.0, |other| other.velocity),
        leader.map_or(0.0, |other| other.velocity - velocity),
        leader.map_or(0.0, |other| other.body.change),
        leader.map_or(0.0, |other| other.offset),
        leader.map_or(0.0, |other| 2.0 * other.body.half_length),
        flag(leader.is_some()),
        second.map_or(GAP_MAX, |other| other.gap),
        second.map_or(0.0, |other| other.velocity),
        flag(second.is_some()),
        follower.map_or(GAP_MAX, |other| other.gap),
        follower.map_or(0.0, |other| other.velocity - velocity),
        flag(follower.is_some()),
        crossing.map_or(GAP_MAX, |other| other.s),
        crossing.map_or(0.0, |other| other.time),
        crossing.map_or(0.0, |other| own_time(other.s)),
        crossing.map_or(0.0, |other| other.speed),
        crossing.map_or(0.0, |other| other.cos),
        crossing.map_or(0.0, |other| other.sin),
        flag(crossing.is_some()),
        n_own,
    ]
}
