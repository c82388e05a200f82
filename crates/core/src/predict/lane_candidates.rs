//! Following every lane that fits, one mode each.

use super::{LaneFollowing, go_straight, write};
use crate::geometry::{Point, Pose};
use crate::road::{Chains, LaneMatch, Matching, RoadNetwork};
use crate::trajectory::{Predictions, State};
use crate::vehicle::ParticipantKind;

/// A participant that is faster than the caps (they are on a grid) may brake harder than planned by this factor.
const BRAKING_FACTOR: f64 = 1.5;
/// How it gets back to its speed behind a curve [m/s²].
const ACCELERATION: f64 = 1.0;
/// A lane is the less likely the more lateral acceleration its curves would take although the participant brakes for them: its
/// weight falls like a Gaussian of this standard deviation [m/s²], to a hundredth at most, as curvatures of maps are rough.
const LATERAL_SIGMA: f64 = 2.0;
const UNLIKELY: f64 = 0.01;

/// One lane to follow: a chain of lanelets, where on it, and how well it fits.
#[derive(Debug, Clone, Copy)]
pub(super) struct LaneCandidate {
    /// Index of the chain.
    chain: usize,
    pub(super) s: f64,
    d: f64,
    heading_error: f64,
    pub(super) weight: f64,
}

/// The lanes on which a participant may be, in memory that is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct LaneCandidates {
    matching: Matching,
    chains: Chains,
    /// The lanes that count, best fit first.
    pub(super) found: Vec<LaneCandidate>,
    all: Vec<LaneCandidate>,
    driven: Vec<(LaneCandidate, SpeedCaps)>,
}

impl LaneCandidates {
    /// Lanelets of a lane in driving order.
    pub(super) fn chain(&self, lane: &LaneCandidate) -> &[usize] {
        self.chains.get(lane.chain)
    }

    /// Looks for at most `lanes_max` lanes, branches within `reach` [m] apart; their weights are not normalised.
    pub(super) fn find(&mut self, pose: Pose, reach: f64, lanes_max: usize, road: &RoadNetwork) {
        /// Lanes farther aside than this [m], or in another direction than within this angle [rad], are not its own.
        const OFFSET_MAX: f64 = 1.0;
        const HEADING_MAX: f64 = 0.7;
        /// Deviations that make a lane less likely by a factor of e: [m], [rad].
        const OFFSET_SCALE: f64 = 0.8;
        const HEADING_SCALE: f64 = 0.25;
        /// Lanes that fit worse than the best by this factor are left out.
        const WEIGHT_SHARE: f64 = 0.05;
        let Self { matching, chains, found: kept, all, .. } = self;
        road.find_matching(pose, OFFSET_MAX, HEADING_MAX, matching);
        chains.clear();
        all.clear();
        for found in &matching.found {
            let fit =
                (-(found.d / OFFSET_SCALE).powi(2) - (found.heading_error / HEADING_SCALE).powi(2)).exp().max(1e-12);
            let first = chains.n();
            road.find_paths(found.lanelet, found.s, reach, lanes_max, chains);
            let weight = fit / (chains.n() - first).max(1) as f64;
            let LaneMatch { s, d, heading_error, .. } = *found;
            all.extend((first..chains.n()).map(|chain| LaneCandidate { chain, s, d, heading_error, weight }));
        }
        // Best first; equal weights keep the order in which the road network lists them.
        all.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight).then(a.chain.cmp(&b.chain)));
        kept.clear();
        for lane in &*all {
            let fits = kept.first().is_none_or(|best| lane.weight >= WEIGHT_SHARE * best.weight);
            // Where one lanelet ends and the next begins, both match, and so would the same lane twice.
            let is_new = || !kept.iter().any(|other| is_same_lane(chains.get(other.chain), chains.get(lane.chain)));
            if kept.len() < lanes_max && fits && is_new() {
                kept.push(*lane);
            }
        }
    }
}

/// One chain goes on as the other does, from the first lanelet that both have.
fn is_same_lane(a: &[usize], b: &[usize]) -> bool {
    let continues = |long: &[usize], short: &[usize]| {
        let joint = long.iter().position(|lanelet| *lanelet == short[0]);
        joint.is_some_and(|joint| long[joint..].iter().zip(short).all(|(x, y)| x == y))
    };
    continues(a, b) || continues(b, a)
}

/// Of a participant with this kind and state; `age` is that of the state [s], see `go_straight`.
pub(super) fn follow_lanes(
    out: &mut Predictions,
    i: usize,
    (kind, state, age): (ParticipantKind, &State, f64),
    settings: &LaneFollowing,
    (dt, road): (f64, &RoadNetwork),
    lanes: &mut LaneCandidates,
) {
    let horizon = out.n_steps as f64 * dt;
    let follows = kind.is_vehicle() && state.velocity > 0.0;
    if follows {
        lanes.find(state.pose(), state.velocity * horizon + 10.0, settings.modes_max, road);
    }
    if !follows || lanes.found.is_empty() {
        go_straight(out, i, (state, age), &settings.spread, dt);
        return;
    }
    let mut driven = std::mem::take(&mut lanes.driven);
    driven.clear();
    for lane in &lanes.found {
        let (caps, lateral) = SpeedCaps::along((lane.s, lanes.chain(lane)), (state.velocity, horizon), settings, road);
        let excess = (lateral - settings.lateral_acceleration).max(0.0) / LATERAL_SIGMA;
        let weight = lane.weight * (-0.5 * excess * excess).exp().max(UNLIKELY);
        driven.push((LaneCandidate { weight, ..*lane }, caps));
    }
    driven.sort_by(|(a, _), (b, _)| b.weight.total_cmp(&a.weight));
    let total: f64 = driven.iter().map(|(lane, _)| lane.weight).sum();
    for (mode, (lane, caps)) in driven.iter().enumerate() {
        out.probability[i * out.n_modes + mode] = lane.weight / total;
        follow_lane(out, i, mode, (state, age), (lane, lanes.chain(lane), caps), settings, dt, road);
    }
    lanes.driven = driven;
}

#[expect(clippy::too_many_arguments, reason = "private; the parts of one mode")]
fn follow_lane(
    out: &mut Predictions,
    i: usize,
    mode: usize,
    (state, age): (&State, f64),
    (lane, chain, caps): (&LaneCandidate, &[usize], &SpeedCaps),
    settings: &LaneFollowing,
    dt: f64,
    road: &RoadNetwork,
) {
    let start = out.offset(i, mode);
    // The pose now, seen from the lane: the prediction starts exactly at the participant.
    let (now, _) = road.chain_pose(chain, lane.s, 0.0, lane.d);
    let shift = state.pose().position - now.position;
    let drift = state.velocity * lane.heading_error.sin();
    let (mut distance, mut velocity) = (0.0, state.velocity);
    for k in 0..out.n_steps {
        let time = (k + 1) as f64 * dt;
        let allowed = caps.at(distance + velocity * dt);
        velocity = if velocity > allowed {
            (velocity - BRAKING_FACTOR * settings.deceleration * dt).max(allowed)
        } else {
            (velocity + ACCELERATION * dt).min(allowed).min(state.velocity)
        };
        distance += velocity * dt;
        let d = returning(lane.d, drift, time, settings.return_time);
        let (pose, along) = road.chain_pose(chain, lane.s, distance, d);
        let fade = (1.0 - time / settings.return_time).max(0.0);
        let ahead = returning(lane.d, drift, time + dt, settings.return_time);
        // It heads from here to where it will be beside the lane.
        let course = Point::new((velocity * dt).max(0.05), ahead - d);
        let pose = Pose { position: pose.position + shift * fade, orientation: pose.orientation + course.angle() };
        let axis = (along * course.x + along.left() * course.y) * (1.0 / course.norm());
        write(out, start + k, pose, velocity, settings.spread.covariance(axis, velocity, age + time));
    }
}

/// Cubic from (offset, drift) to (0, 0) within `duration`: the lateral offset at `time`.
fn returning(offset: f64, drift: f64, time: f64, duration: f64) -> f64 {
    if time >= duration {
        return 0.0;
    }
    let u = time / duration;
    let h00 = (1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u);
    let h10 = u * (1.0 - u) * (1.0 - u);
    h00 * offset + h10 * duration * drift
}

/// Speed up to which curves ahead can be driven, on a grid along the lane.
#[derive(Debug, Clone)]
struct SpeedCaps {
    spacing: f64,
    values: [f64; Self::COUNT],
}

impl SpeedCaps {
    const COUNT: usize = 33;

    /// Also the largest lateral acceleration [m/s²] in curves within the horizon [s] of a participant with this velocity that
    /// brakes all the way.
    fn along(
        (s, chain): (f64, &[usize]),
        (velocity, horizon): (f64, f64),
        settings: &LaneFollowing,
        road: &RoadNetwork,
    ) -> (Self, f64) {
        let spacing = (velocity * horizon).max(10.0) / (Self::COUNT - 1) as f64;
        let mut values = [f64::INFINITY; Self::COUNT];
        let mut lateral = 0.0_f64;
        for (j, value) in values.iter_mut().enumerate() {
            let distance = j as f64 * spacing;
            let curvature = road.chain_curvature(chain, s, distance).abs();
            lateral = lateral.max(curvature * (velocity * velocity - 2.0 * settings.deceleration * distance));
            *value = (settings.lateral_acceleration / curvature.max(1e-6)).sqrt();
        }
        for j in (0..Self::COUNT - 1).rev() {
            values[j] = values[j].min((values[j + 1].powi(2) + 2.0 * settings.deceleration * spacing).sqrt());
        }
        (Self { spacing, values }, lateral)
    }

    fn at(&self, distance: f64) -> f64 {
        self.values[((distance / self.spacing) as usize).min(Self::COUNT - 1)]
    }
}
