//! From the network's outputs to positions: profiles of arc length and offset over time, modes, covariances.

use super::candidate_path::CandidatePath;
use super::feature_table::N_AGENT;
use super::inputs::{Inputs, KNOT_TIME, N_KNOTS, Settling};
use super::network::{MODE_OUTPUTS, Merging, Network};
use super::profile::Profile;
use super::tail;
use crate::geometry::{Point, Pose, wrap_angle};
use crate::predict::{STATIONARY_VARIANCE, write};
use crate::scene::Scene;
use crate::trajectory::Predictions;

/// Standard deviation of a position now [m], before calibration.
const SIGMA_NOW: f64 = 0.05;
/// No standard deviation is smaller [m].
const SIGMA_MIN: f64 = 0.02;
/// Bounds of the logarithm of how fast a standard deviation grows [m/s].
const LOG_RATE: (f64, f64) = (-5.0, 2.0);
/// A mode that moves less than this within the knots [m] counts as standing still for a stationary vehicle.
const STAYING_DISTANCE: f64 = 1.0;
/// From this speed on [m/s] a vehicle turns with its motion; slower, it turns less the slower it is.
const TURNING_SPEED: f64 = 1.5;

/// What a vehicle does on a path: values at 0, 0.5, ... 3 s.
#[derive(Debug, Clone, Copy)]
struct Mode {
    probability: f64,
    slot: usize,
    /// Arc length [m], not decreasing.
    s: [f64; N_KNOTS + 1],
    /// Offset [m] besides the settling.
    beside: [f64; N_KNOTS + 1],
    /// Standard deviations [m] along and across the path.
    sigma: [[f64; N_KNOTS + 1]; 2],
    /// Stands where it is, exactly.
    stays: bool,
}

/// Position of a mode at a knot, and the direction of its path there.
#[derive(Debug, Clone, Copy)]
struct Knot {
    position: Point,
    axis: Point,
}

impl Mode {
    /// It is the same drive as another mode: along and across the path the positions at all knots are nearer to each other
    /// than a distance, or than a share of their standard deviations (geometric mean).
    fn is_same(&self, other: &Self, at: &[Knot; N_KNOTS], of: &[Knot; N_KNOTS], merging: &Merging) -> bool {
        if self.stays || other.stays {
            return of.iter().zip(at).all(|(of, at)| of.position.distance(at.position) < merging.distance);
        }
        at.iter().zip(of).enumerate().all(|(j, (at, of))| {
            let offset = of.position - at.position;
            [offset.dot(at.axis), at.axis.cross(offset)].into_iter().enumerate().all(|(axis, apart)| {
                let of_sigma = |share: f64| share * (self.sigma[axis][j + 1] * other.sigma[axis][j + 1]).sqrt();
                apart.abs() < merging.distance
                    || merging.share > 0.0 && apart.abs() < merging.distance.max(of_sigma(merging.share))
            })
        })
    }

    /// Takes over probability and spread of a mode that is the same drive. On one path the positions become means, with
    /// the heights of both densities as weights: what is certain keeps its place.
    fn absorb(&mut self, other: &Self, at: &[Knot; N_KNOTS], of: &[Knot; N_KNOTS], merging: &Merging) {
        let share = other.probability / (self.probability + other.probability);
        self.probability += other.probability;
        if self.stays || other.stays {
            return;
        }
        for (j, (at, of)) in at.iter().zip(of).enumerate() {
            let offset = of.position - at.position;
            for (axis, apart) in [offset.dot(at.axis), at.axis.cross(offset)].into_iter().enumerate() {
                let (mine, theirs) = (self.sigma[axis][j + 1], other.sigma[axis][j + 1]);
                let mut beside = share * apart * apart;
                if self.slot == other.slot {
                    let weight = share / theirs / (share / theirs + (1.0 - share) / mine);
                    let (values, others) =
                        if axis == 0 { (&mut self.s, &other.s) } else { (&mut self.beside, &other.beside) };
                    values[j + 1] += weight * (others[j + 1] - values[j + 1]);
                    beside = (share * (1.0 - weight).powi(2) + (1.0 - share) * weight * weight) * apart * apart;
                }
                let moment = (1.0 - share) * mine * mine + share * theirs * theirs + beside;
                let variance = if merging.moment < 1.0 {
                    let geometric = mine.powf(2.0 - 2.0 * share) * theirs.powf(2.0 * share) + beside;
                    moment.powf(merging.moment) * geometric.powf(1.0 - merging.moment)
                } else {
                    moment
                };
                self.sigma[axis][j + 1] = variance.sqrt();
            }
        }
        for j in 0..N_KNOTS {
            self.s[j + 1] = self.s[j + 1].max(self.s[j]);
        }
    }
}

/// Modes of a vehicle in memory that is reused.
#[derive(Debug, Default)]
pub(super) struct Modes {
    all: Vec<Mode>,
    kept: Vec<(Mode, [Knot; N_KNOTS])>,
}

/// A vehicle of the inputs and where it is now.
pub(super) struct Vehicle<'a> {
    pub(super) inputs: &'a Inputs,
    /// Row of the inputs.
    pub(super) i: usize,
    pub(super) pose: Pose,
}

impl<'a> Vehicle<'a> {
    /// Of a scene.
    pub(super) fn new(scene: &Scene, inputs: &'a Inputs, i: usize) -> Self {
        Self { inputs, i, pose: scene.state(inputs.rows[i]).pose() }
    }

    fn path(&self, slot: usize) -> &'a CandidatePath {
        self.inputs.candidates[self.i][slot].as_ref().expect("modes have a path")
    }

    /// Writes the row of a table from the network's outputs for this vehicle, (paths, modes,
    /// `MODE_OUTPUTS`).
    /// Nothing is written and false returned if they are not numbers.
    pub(super) fn decode(
        &self,
        network: &Network,
        outputs: &[f32],
        out: &mut Predictions,
        row: usize,
        dt: f64,
        memory: &mut Modes,
    ) -> bool {
        if outputs.iter().any(|value| !value.is_finite()) {
            return false;
        }
        let Modes { all: modes, kept } = memory;
        self.find_modes(network, outputs, modes);
        if self.inputs.standing[self.i] {
            stay_or_go(modes);
        }
        // Most probable first; the sort keeps the order of equal ones.
        modes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        self.merge(modes, kept, &network.merging);
        modes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let tail = network.tail;
        modes.truncate(out.n_modes - usize::from(tail.is_some()));
        let total: f64 = modes.iter().map(|mode| mode.probability).sum();
        for (k, mode) in modes.iter().enumerate() {
            out.probability[row * out.n_modes + k] = mode.probability / total;
            self.write_mode(mode, out, row, k, dt);
        }
        if let Some(tail) = tail {
            tail::add(tail[usize::from(self.inputs.standing[self.i])], modes.len(), out, row);
        }
        true
    }

    fn find_modes(&self, network: &Network, outputs: &[f32], modes: &mut Vec<Mode>) {
        let valid = &self.inputs.candidates[self.i];
        let spread = network.spread_of(&self.inputs.agent[self.i * N_AGENT..][..N_AGENT]);
        let outputs = outputs.chunks_exact(MODE_OUTPUTS).enumerate();
        let outputs = outputs.filter(|(k, _)| valid[k / network.n_modes].is_some());
        modes.clear();
        modes.extend(outputs.map(|(k, values)| self.mode(network, &spread, k / network.n_modes, values)));
        let most = modes.iter().map(|mode| mode.probability).fold(f64::NEG_INFINITY, f64::max);
        for mode in &mut *modes {
            mode.probability = (mode.probability - most).exp();
        }
        let total: f64 = modes.iter().map(|mode| mode.probability).sum();
        modes.iter_mut().for_each(|mode| mode.probability /= total);
    }

    /// A mode whose probability is still its logit.
    fn mode(&self, network: &Network, spread: &[f64; 2], slot: usize, values: &[f32]) -> Mode {
        let velocity = self.inputs.velocity[self.i];
        let [first_s, first_d] = [0, 1].map(|axis| spread[axis] * network.calibration[axis][0] * SIGMA_NOW);
        let mut mode = Mode {
            // The temperature is fitted to moving vehicles.
            probability: f64::from(values[0]) / if self.inputs.standing[self.i] { 1.0 } else { network.temperature },
            slot,
            s: [0.0; N_KNOTS + 1],
            beside: [0.0; N_KNOTS + 1],
            sigma: [[first_s; N_KNOTS + 1], [first_d; N_KNOTS + 1]],
            stays: false,
        };
        for (j, knot) in values[1..].chunks_exact(4).enumerate() {
            let time = (j + 1) as f64 * KNOT_TIME;
            let [speed, lateral, log_s, log_d] = [0, 1, 2, 3].map(|k| f64::from(knot[k]));
            let [speed, lateral] = [(speed, 0), (lateral, 1)].map(|(value, axis)| {
                let zone = network.dead_zone[axis];
                value - value.clamp(-zone, zone)
            });
            mode.s[j + 1] = (time * (velocity + speed)).max(mode.s[j]);
            mode.beside[j + 1] = time * lateral;
            for (axis, log) in [log_s, log_d].into_iter().enumerate() {
                let grown = SIGMA_NOW + time * log.clamp(LOG_RATE.0, LOG_RATE.1).exp();
                mode.sigma[axis][j + 1] = spread[axis] * network.calibration[axis][j] * grown;
            }
        }
        mode
    }

    /// Modes that are the same drive become one: on a straight road a lane and the free path lead to the same places,
    /// and two ways to drive a path can differ by less than is known of each.
    fn merge(&self, modes: &mut Vec<Mode>, kept: &mut Vec<(Mode, [Knot; N_KNOTS])>, merging: &Merging) {
        kept.clear();
        for mode in &*modes {
            let knots = self.knots(mode);
            match kept.iter_mut().find(|(into, of)| into.is_same(mode, of, &knots, merging)) {
                Some((into, of)) => {
                    into.absorb(mode, of, &knots, merging);
                    *of = self.knots(into);
                }
                None => kept.push((*mode, knots)),
            }
        }
        modes.clear();
        modes.extend(kept.iter().map(|(mode, _)| *mode));
    }

    /// Where a mode is at the knots.
    fn knots(&self, mode: &Mode) -> [Knot; N_KNOTS] {
        if mode.stays {
            let axis = Point::from_angle(self.pose.orientation);
            return [Knot { position: self.pose.position, axis }; N_KNOTS];
        }
        let path = self.path(mode.slot);
        let settling = self.inputs.settling(self.i, mode.slot).expect("modes have a path");
        let mut segment = path.segment_at(0.0);
        std::array::from_fn(|j| {
            let (foot, heading, _) = path.at(mode.s[j + 1], &mut segment);
            let axis = Point::from_angle(heading);
            Knot { position: foot + axis.left() * (settling.at(mode.s[j + 1]).0 + mode.beside[j + 1]), axis }
        })
    }

    fn write_mode(&self, mode: &Mode, out: &mut Predictions, row: usize, k: usize, dt: f64) {
        let start = out.offset(row, k);
        if mode.stays {
            for step in 0..out.n_steps {
                write(out, start + step, self.pose, 0.0, (STATIONARY_VARIANCE, 0.0, STATIONARY_VARIANCE));
            }
            return;
        }
        let path = self.path(mode.slot);
        let settling = self.inputs.settling(self.i, mode.slot).expect("modes have a path");
        let along = Profile::monotone(&mode.s, self.inputs.velocity[self.i]);
        let beside = Profile::smooth(&mode.beside);
        let mut orientation = self.pose.orientation;
        let mut segment = path.segment_at(0.0);
        for step in 0..out.n_steps {
            let time = (step + 1) as f64 * dt;
            let motion = MovingPoint::at(time, &along, &beside, &settling, path, &mut segment);
            let turn = wrap_angle(motion.direction - orientation) * (motion.speed / TURNING_SPEED).min(1.0);
            orientation += turn;
            let pose = Pose { position: motion.position, orientation: wrap_angle(orientation) };
            let covariance = covariance(mode, time, motion.axis);
            write(out, start + step, pose, motion.speed, covariance);
        }
    }
}

/// For a stationary vehicle: all modes that hardly move become one motionless mode.
fn stay_or_go(modes: &mut Vec<Mode>) {
    let stays = |mode: &Mode| mode.s[N_KNOTS] < STAYING_DISTANCE;
    if let Some(first) = modes.iter().copied().find(stays) {
        let probability = modes.iter().filter(|mode| stays(mode)).map(|mode| mode.probability).sum();
        modes.retain(|mode| !stays(mode));
        modes.insert(0, Mode { probability, stays: true, ..first });
    }
}

/// Where a vehicle is and how it moves.
struct MovingPoint {
    position: Point,
    /// Unit vector along the path.
    axis: Point,
    /// Direction of the motion [rad].
    direction: f64,
    /// Speed [m/s].
    speed: f64,
}

impl MovingPoint {
    /// `segment` is that of the last call; the arc length never decreases.
    fn at(
        time: f64,
        along: &Profile,
        beside: &Profile,
        settling: &Settling,
        path: &CandidatePath,
        segment: &mut usize,
    ) -> Self {
        let (s, s_dot) = along.at(time, true);
        let (settled, slope) = settling.at(s);
        let (more, more_dot) = beside.at(time, false);
        let (d, d_dot) = (settled + more, slope * s_dot + more_dot);
        let (foot, heading, curvature) = path.at(s, segment);
        let axis = Point::from_angle(heading);
        // On the inside of a bend the way is shorter than the path.
        let forward = s_dot * (1.0 - curvature * d).clamp(0.5, 1.5);
        Self {
            position: foot + axis.left() * d,
            axis,
            direction: heading + d_dot.atan2(forward),
            speed: (forward * forward + d_dot * d_dot).sqrt(),
        }
    }
}

/// Positive definite covariance (xx, xy, yy) [m²] of a mode at a time [s], world frame, for a unit vector
/// along the path.
fn covariance(mode: &Mode, time: f64, axis: Point) -> (f64, f64, f64) {
    let end = N_KNOTS as f64 * KNOT_TIME;
    let [along, across] = [0, 1].map(|axis| {
        let sigma = &mode.sigma[axis];
        let value = if time >= end {
            sigma[N_KNOTS] * time / end
        } else {
            let j = (time / KNOT_TIME) as usize;
            sigma[j] + (time / KNOT_TIME - j as f64) * (sigma[j + 1] - sigma[j])
        };
        value.max(SIGMA_MIN).powi(2)
    });
    let (sin, cos) = (axis.y, axis.x);
    (along * cos * cos + across * sin * sin, (along - across) * sin * cos, along * sin * sin + across * cos * cos)
}
