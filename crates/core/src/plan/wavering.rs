//! How drivers waver: smooth random parts of the acceleration and of the place in the lane, without memory, so that any
//! step of any plan has them.

use std::f64::consts::TAU;

use super::PlanRequest;
use crate::conduct::EXPECTED_DECELERATION;
use crate::route::PathPiece;
use crate::settings::{between, positive, settings};

/// Waves of which it consists.
const N_WAVES: usize = 16;
/// A draw of zero has no logarithm.
const DRAW_MIN: f64 = 1e-12;
/// A slower driver wavers less, in proportion to its speed [m/s].
const SLOW: f64 = 2.0;

/// A driver reaches the place in its lane where it wants to be within this time [s], ...
const KEEPING_TIME: f64 = 1.5;
/// ... or on the way on which that place changes, if it changes with the way, but within this time [s], ...
const KEEPING_TIME_MAX: f64 = 10.0;
/// ... unless it is farther away than this [m], as in a lane change, ...
const KEEPING_OFFSET: f64 = 1.0;
/// ... and stays this far from the edges of its lane [m].
const EDGE_GAP: f64 = 0.2;
/// Where it entered is this near the start of its route [m].
const ENTRY_NEAR: f64 = 20.0;
/// The random part of its place is not that of its acceleration.
const LATERAL_SEED: usize = 1 << 33;

settings! {
    /// How a driver wavers.
    pub struct Wavering as Wavering {
        /// Standard deviation of a random part of the acceleration: how much the driver wavers. `frenet` changes its desired
        /// speed instead, by `noise_length` times as much.
        noise: f64 ["m/s²"] = 0.0, between(0.0, 5.0);
        /// Time over which that part changes.
        noise_length: f64 ["s"] = 1.5, positive(60.0);
        /// Which random parts these are, that of the place in the lane among them.
        noise_seed: usize = 0, between(0.0, 4_294_967_295.0);
    }

    /// How a driver wavers, and where it is in its lane.
    pub struct PlaceInLane as PlaceInLane(wavering: Wavering) {
        /// Where in its lane it wants to be, to the left of the middle.
        lateral_offset: f64 ["m"] = 0.0, between(-2.0, 2.0);
        /// Share of its offset from the middle of the lane at the start that it keeps besides.
        lateral_kept: f64 = 0.0, between(0.0, 1.0);
        /// Standard deviation of a random part of that place.
        lateral_noise: f64 ["m"] = 0.0, between(0.0, 1.0);
        /// Time over which that part changes.
        lateral_length: f64 ["s"] = 2.0, positive(60.0);
        /// Way on which that part changes instead, however long it takes; 0: it changes with time.
        lateral_way: f64 ["m"] = 0.0, between(0.0, 1000.0);
    }
}

impl Wavering {
    /// The random part of the acceleration.
    pub(super) fn noise(&self) -> Option<Noise> {
        Noise::new(self.noise, self.noise_length, self.noise_seed)
    }

    /// What becomes of a desired speed [m/s], for planners that choose their acceleration themselves: it differs by what the
    /// noise makes of a speed in the time over which it lasts.
    pub(super) fn desired(&self, wanted: f64, request: &PlanRequest) -> f64 {
        let Some(noise) = self.noise() else { return wanted };
        let (time, velocity) = (request.time_step as f64 * request.dt, request.state.velocity);
        // Whoever wants to be much slower brakes for something.
        let change = wanted - velocity;
        (wanted + self.noise_length * (noise.added(change, time, velocity) - change)).max(0.0)
    }
}

impl PlaceInLane {
    /// Where beside the middle of a lane of a width [m] it wants to be at an arc length [m], to the left [m].
    pub(super) fn aside(&self, request: &PlanRequest, s: f64, width: impl FnOnce() -> f64) -> f64 {
        if !self.keeps_place() {
            return 0.0;
        }
        let mut aside = self.lateral_offset;
        if self.lateral_kept > 0.0 {
            let entry = request.entry.pose();
            let rear_axle = request.vehicle.rear_axle_from_center(entry);
            let foot = request.route.path.project_near(rear_axle, request.route.start_s, ENTRY_NEAR);
            aside += self.lateral_kept * foot.map_or(0.0, |foot| foot.1);
        }
        let seed = self.wavering.noise_seed.wrapping_add(LATERAL_SEED);
        let (length, at) = if self.lateral_way > 0.0 {
            let velocity = request.state.velocity.max(0.0);
            (self.lateral_way, s + velocity * self.keeping_time(velocity))
        } else {
            (self.lateral_length, request.time_step as f64 * request.dt + KEEPING_TIME)
        };
        if let Some(noise) = Noise::new(self.lateral_noise, length, seed) {
            aside += noise.value(at);
        }
        let room = (0.5 * (width() - request.vehicle.width) - EDGE_GAP).max(0.0);
        aside.clamp(-room, room)
    }

    /// The same at an arc length of the route's path [m].
    pub(super) fn aside_of_path(&self, request: &PlanRequest, s: f64) -> f64 {
        self.aside(request, s, || width(request, s))
    }

    /// Time within which an offset from that place is given up at a speed [m, m/s, s], of a driver who otherwise takes
    /// `usual` for it.
    pub(super) fn time_to_reach(&self, offset: f64, velocity: f64, usual: f64) -> f64 {
        if self.keeps_place() && offset.abs() < KEEPING_OFFSET { self.keeping_time(velocity) } else { usual }
    }

    /// Within which it reaches that place [s].
    fn keeping_time(&self, velocity: f64) -> f64 {
        KEEPING_TIME.max((self.lateral_way / velocity.max(f64::MIN_POSITIVE)).min(KEEPING_TIME_MAX))
    }

    /// It wants to be elsewhere than in the middle of its lane.
    fn keeps_place(&self) -> bool {
        self.lateral_offset != 0.0 || self.lateral_kept > 0.0 || self.lateral_noise > 0.0
    }
}

/// Width of the lane at an arc length of the route's path [m].
fn width(request: &PlanRequest, s: f64) -> f64 {
    let distance = |piece: &&PathPiece| if piece.has(s) { piece.distance(s) } else { f64::INFINITY };
    let nearest = request.route.pieces.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.map_or(f64::INFINITY, |piece| {
        let lanelet = &request.road.lanelets()[piece.lanelet];
        lanelet.width_at((s - piece.start).clamp(0.0, lanelet.length))
    })
}

/// A Gaussian process with unit variance and the correlation exp(-t² / (2 length²)), as a sum of random waves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Standard deviation.
    sd: f64,
    /// Angular frequencies [rad/s] and phases [rad].
    waves: [(f64, f64); N_WAVES],
}

impl Noise {
    /// For a standard deviation, a correlation length [s] and a seed; `None` without any noise.
    pub(super) fn new(sd: f64, length: f64, seed: usize) -> Option<Self> {
        if sd <= 0.0 {
            return None;
        }
        let mut state = seed as u64;
        let mut draw = || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let waves = std::array::from_fn(|_| {
            let (u, v, w) = (draw().max(DRAW_MIN), draw(), draw());
            ((-2.0 * u.ln()).sqrt() * (TAU * v).cos() / length, TAU * w)
        });
        Some(Self { sd, waves })
    }

    /// At a time [s], in the unit of the standard deviation.
    pub(super) fn value(&self, time: f64) -> f64 {
        self.sd * self.at(time)
    }

    fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.waves.iter().map(|(omega, phase)| (omega * time + phase).cos()).sum();
        (2.0 / N_WAVES as f64).sqrt() * sum
    }

    /// What becomes of a wanted acceleration [m/s²] at a time [s] and a speed [m/s].
    pub(super) fn added(&self, wanted: f64, time: f64, velocity: f64) -> f64 {
        // Who has to brake harder than is expected of anybody does not waver.
        if wanted < -EXPECTED_DECELERATION { wanted } else { wanted + self.value(time) * (velocity / SLOW).min(1.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: usize) -> Noise {
        Noise::new(1.0, 1.4, seed).expect("noise")
    }

    #[test]
    fn its_values_are_those_of_the_formula() {
        for (seed, time, expected) in
            [(1, 0.0, 0.269608910207), (1, 1.0, 0.205417315023), (1, 2.0, 0.042305619154), (42, 0.0, -1.163295974536)]
        {
            assert!((noise(seed).at(time) - expected).abs() < 1e-9, "{seed} {time}");
        }
    }

    #[test]
    fn over_seeds_it_has_unit_variance_and_its_correlation_length() {
        let n = 2000;
        let pairs: Vec<(f64, f64)> = (0..n).map(|seed| (noise(seed).at(0.0), noise(seed).at(1.4))).collect();
        let sum = |part: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(part).sum::<f64>() / n as f64;
        let (first, second) = (sum(&|pair| pair.0 * pair.0).sqrt(), sum(&|pair| pair.1 * pair.1).sqrt());
        let correlation = sum(&|pair| pair.0 * pair.1) / (first * second);
        assert!((first - 1.0).abs() < 0.05 && (second - 1.0).abs() < 0.05, "{first} {second}");
        assert!((correlation - (-0.5_f64).exp()).abs() < 0.03, "{correlation}");
    }

    #[test]
    fn who_stands_or_has_to_brake_hard_does_not_waver() {
        let own = noise(3);
        assert_eq!(own.added(0.5, 1.0, 0.0), 0.5);
        assert_eq!(own.added(-4.0, 1.0, 10.0), -4.0);
        assert_eq!(own.added(0.5, 1.0, 10.0) - 0.5, 2.0 * (own.added(0.5, 1.0, 1.0) - 0.5));
        assert_eq!(Noise::new(0.0, 1.4, 3), None);
    }
}
