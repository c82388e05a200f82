//! The three manoeuvres of UN R157 that a lane-keeping system meets, with a reference driver in its place: a vehicle cuts in,
//! the leader leaves the lane and reveals a standing vehicle, the leader brakes. Steps of 0.1 s: first the new speeds, then
//! the positions.

use rayon::prelude::*;

use super::drivers::{CC_TIME, Driver, Encounter, Reaction, Seen};
use crate::error::{Error, Result};

/// Step [s].
const DT: f64 = 0.1;
/// Steps of a case.
const N_STEPS: usize = 350;
/// Footprint of both vehicles [m].
pub const LENGTH: f64 = 4.3;
/// The same [m].
pub const WIDTH: f64 = 1.9;
/// Length of the vehicle that a cut-out reveals [m]: JRC's program places it as if it were as long as the others.
pub const REVEALED_LENGTH: f64 = 5.0;
/// Middles of the lanes of a cut-in: that from which the other comes, and that of the driver [m].
const LANES: (f64, f64) = (3.5, 7.0);
/// Sideways distance between both before a cut-in [m].
pub const SIDE: f64 = 1.6;
/// A cut-in begins with this sideways acceleration [m/s²].
pub const SIDEWAYS_ACCELERATION: f64 = 1.5;
/// What is ahead of a leader is seen once the leader is so far aside [m].
pub const REVEALED_ASIDE: f64 = 0.375;

/// How a case ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ending {
    /// The driver hits the other.
    pub crash: bool,
    /// ... and is ahead of it then, so that the other comes from the side.
    pub is_beside: bool,
    /// How much faster the driver is at the contact [m/s]; NaN without a contact.
    pub impact_speed: f64,
    /// Least time to collision with a slower vehicle in the way [s]; infinite without any.
    pub ttc_min: f64,
}

impl Ending {
    const OPEN: Self = Self { crash: false, is_beside: false, impact_speed: f64::NAN, ttc_min: f64::INFINITY };

    fn hits(&mut self, impact_speed: f64, is_beside: bool) {
        (self.crash, self.impact_speed, self.is_beside) = (true, impact_speed, is_beside);
    }

    fn note(&mut self, seen: &Seen) {
        if seen.side < 0.0 && seen.is_ahead && seen.velocity > seen.other_velocity {
            self.ttc_min = self.ttc_min.min((seen.gap / (seen.velocity - seen.other_velocity)).max(0.0));
        }
    }
}

/// A slower vehicle comes from the lane beside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutIn {
    /// Speed of the driver [m/s] ...
    pub velocity: f64,
    /// ... and of the other [m/s].
    pub other_velocity: f64,
    /// Gap when the other has its sideways speed [m].
    pub gap: f64,
    /// Its sideways speed [m/s].
    pub sideways: f64,
}

/// The leader leaves the lane before a standing vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutOut {
    /// Speed of driver and leader [m/s].
    pub velocity: f64,
    /// From the leader to the standing vehicle [m].
    pub front_distance: f64,
    /// Sideways speed of the leader [m/s].
    pub sideways: f64,
}

/// The leader brakes to a halt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Following {
    /// Speed of driver and leader [m/s].
    pub velocity: f64,
    /// Braking of the leader [m/s²].
    pub deceleration: f64,
}

/// Endings of all cases in their order, on all cores.
///
/// # Errors
/// `InvalidInput` naming the first case whose numbers are none.
pub fn drive_all<C: Sync, E: Send>(
    cases: &[C],
    check: impl Fn(&C) -> Result<()>,
    drive: impl Fn(&C) -> E + Send + Sync,
) -> Result<Vec<E>> {
    for (row, case) in cases.iter().enumerate() {
        check(case).map_err(|error| Error::invalid(format!("case {row}: {error}")))?;
    }
    Ok(cases.par_iter().map(drive).collect())
}

/// Larger speeds and distances would be driven for ever [m/s], [m].
const LARGEST: f64 = 1000.0;

fn check(what: &str, value: f64, is_right: bool, must: &str) -> Result<()> {
    if value > LARGEST {
        return Err(Error::invalid(format!("{what} must be at most {LARGEST}, is {value}")));
    }
    if is_right { Ok(()) } else { Err(Error::invalid(format!("{what} must {must}, is {value}"))) }
}

fn check_speeds(velocity: f64, others: &[(&str, f64)]) -> Result<()> {
    check("a speed", velocity, velocity.is_finite() && velocity >= 0.0, "not be negative")?;
    others.iter().try_for_each(|(what, value)| check(what, *value, value.is_finite() && *value > 0.0, "be positive"))
}

/// A driver under way.
struct Ego {
    reaction: Reaction,
    set_velocity: f64,
    x: f64,
    velocity: f64,
    before: Option<f64>,
}

impl Ego {
    fn new(driver: Driver, velocity: f64) -> Self {
        Self { reaction: Reaction::new(driver), set_velocity: velocity, x: 0.0, velocity, before: None }
    }

    /// What it sees of a vehicle at `x` with a speed.
    fn sees(&self, (x, velocity, length): (f64, f64, f64), side: f64, toward: f64) -> Seen {
        Seen {
            velocity: self.velocity,
            acceleration: self.before.map_or(0.0, |before| (self.velocity - before) / DT),
            other_velocity: velocity,
            gap: (x - self.x).abs() - 0.5 * (LENGTH + length),
            side,
            toward,
            is_ahead: x >= self.x,
            lengths: LENGTH + length,
        }
    }

    fn step(&mut self, seen: &Seen, is_danger: bool) {
        let next = self.reaction.next_velocity(seen, is_danger, self.set_velocity, DT);
        (self.before, self.velocity) = (Some(self.velocity), next);
        self.x += next * DT;
    }
}

/// Steps before the stated gap in which the sideways speed of a cut-in grows.
pub fn ramp_steps(sideways: f64) -> usize {
    (sideways / (SIDEWAYS_ACCELERATION * DT)) as usize
}

/// Steps with the stated sideways speed; without one the other never arrives.
pub fn lateral_steps(sideways: f64) -> usize {
    ((10.0 * (SIDE + WIDTH) / sideways).floor() as usize).saturating_add(1)
}

impl CutIn {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `InvalidInput` naming the first that is none.
    pub fn check(&self) -> Result<()> {
        check("the gap", self.gap, self.gap.is_finite() && self.gap >= 0.0, "not be negative")?;
        check(
            "the other's speed",
            self.other_velocity,
            self.other_velocity.is_finite() && self.other_velocity >= 0.0,
            "not be negative",
        )?;
        let sideways = self.sideways;
        check("the sideways speed", sideways, sideways.is_finite() && sideways >= 0.0, "not be negative")?;
        check_speeds(self.velocity, &[])
    }

    /// With a driver in the place of the system.
    pub fn drive(&self, driver: Driver) -> Ending {
        let &Self { velocity, other_velocity, gap, sideways } = self;
        let n_ramp = ramp_steps(sideways);
        let ramp = |step: usize| SIDEWAYS_ACCELERATION * DT * (step + 1) as f64;
        let n_lateral = lateral_steps(sideways);
        let mut ego = Ego::new(driver, velocity);
        let mut x = gap + LENGTH + (velocity - other_velocity) * n_ramp as f64 * DT;
        let mut y = LANES.0 - (0..n_ramp).map(|step| ramp(step) * DT).sum::<f64>();
        let (mut elapsed, mut was_aside) = (0.0, true);
        let mut ending = Ending::OPEN;
        for step in 0..N_STEPS {
            // The other reaches its sides of 0 and 0.5 m exactly at a step in some cases, and only rounding decides then. That
            // of JRC's program is kept: positions add up for contacts, and time for what is seen.
            let touching = (LANES.1 - y).abs() - WIDTH;
            let side = if step < n_ramp { touching } else { (LANES.1 - LANES.0 - sideways * elapsed).abs() - WIDTH };
            let toward = match step {
                _ if step < n_ramp => ramp(step),
                _ if step - n_ramp < n_lateral => sideways,
                _ => 0.0,
            };
            let seen = ego.sees((x, other_velocity, LENGTH), side, toward);
            if touching < 0.0 && seen.gap < 0.0 {
                ending.hits(ego.velocity - other_velocity, ego.x > x);
                return ending;
            }
            ending.note(&seen);
            let is_danger = driver.sees_danger(&seen, Encounter::CutIn);
            if driver == Driver::Cc && was_aside && side <= 0.0 {
                was_aside = false;
                // Once the other is in the lane far enough ahead, following it is no cut-in any more.
                let time = (seen.gap / (ego.velocity - other_velocity)).abs();
                if time > CC_TIME || time.is_nan() {
                    return ending;
                }
            }
            ego.step(&seen, is_danger);
            x += other_velocity * DT;
            y += toward * DT;
            elapsed += if step >= n_ramp && toward > 0.0 { DT } else { 0.0 };
        }
        ending
    }
}

impl CutOut {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `InvalidInput` naming the first that is none.
    pub fn check(&self) -> Result<()> {
        let distance = self.front_distance;
        check("the distance", distance, distance.is_finite() && distance >= 0.0, "not be negative")?;
        check_speeds(self.velocity, &[("the sideways speed", self.sideways)])
    }

    /// With a driver in the place of the system; says whether the leader itself hits the standing vehicle.
    pub fn drive(&self, driver: Driver) -> (Ending, bool) {
        let &Self { velocity, front_distance, sideways } = self;
        let mut ego = Ego::new(driver, velocity);
        let mut x = driver.kept_distance(velocity) + LENGTH;
        let revealed = x + LENGTH + front_distance;
        let (mut y, mut leader_velocity, mut leader_crash, mut has_stopped) = (0.0, velocity, false, false);
        let mut ending = Ending::OPEN;
        for _ in 0..N_STEPS {
            if !leader_crash && y < WIDTH && (revealed - x).abs() < 0.5 * (LENGTH + REVEALED_LENGTH) {
                (leader_crash, leader_velocity) = (true, 0.0);
            }
            if has_stopped {
                break;
            }
            let leader = ego.sees((x, leader_velocity, LENGTH), y - WIDTH, if leader_crash { 0.0 } else { -sideways });
            let standing = ego.sees((revealed, 0.0, REVEALED_LENGTH), -WIDTH, 0.0);
            let hit = [&leader, &standing].into_iter().find(|seen| seen.gap < 0.0 && seen.side < 0.0);
            if let Some(seen) = hit {
                ending.hits(ego.velocity - seen.other_velocity, false);
                break;
            }
            // A leader that has hit what it should have avoided stands there, in view.
            let seen = if leader_crash { &leader } else { &standing };
            let in_view = leader_crash || y >= REVEALED_ASIDE;
            if in_view {
                ending.note(seen);
            }
            let is_danger = in_view && driver.sees_danger(seen, Encounter::Ahead);
            ego.step(if in_view { seen } else { &leader }, is_danger);
            has_stopped = ego.velocity <= 0.0;
            x += leader_velocity * DT;
            y += if leader_crash { 0.0 } else { sideways * DT };
        }
        (ending, leader_crash)
    }
}

impl Following {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `InvalidInput` naming the first that is none.
    pub fn check(&self) -> Result<()> {
        check_speeds(self.velocity, &[("the deceleration", self.deceleration)])
    }

    /// With a driver in the place of the system.
    pub fn drive(&self, driver: Driver) -> Ending {
        self.drive_from(driver, driver.kept_distance(self.velocity))
    }

    /// The same from another gap at the start [m].
    fn drive_from(&self, driver: Driver, gap: f64) -> Ending {
        let mut ego = Ego::new(driver, self.velocity);
        let mut x = gap + LENGTH;
        let mut leader_velocity = self.velocity;
        let mut ending = Ending::OPEN;
        for _ in 0..N_STEPS {
            let seen = ego.sees((x, leader_velocity, LENGTH), -WIDTH, 0.0);
            if seen.gap < 0.0 {
                ending.hits(ego.velocity - leader_velocity, false);
                break;
            }
            ending.note(&seen);
            ego.step(&seen, driver.sees_danger(&seen, Encounter::Ahead));
            leader_velocity = (leader_velocity - self.deceleration * DT).max(0.0);
            x += leader_velocity * DT;
        }
        ending
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kmh(speed: f64) -> f64 {
        speed / 3.6
    }

    #[test]
    fn of_cut_ins_before_110_km_h_the_near_ones_are_avoidable_for_no_driver_and_the_far_ones_for_all() {
        for (gap, expected) in [
            (25.0, [true, true, true, true]),
            (45.0, [true, true, false, false]),
            (61.0, [true, false, false, false]),
            (81.0, [false, false, false, false]),
        ] {
            let case = CutIn { velocity: kmh(110.0), other_velocity: kmh(40.0), gap, sideways: 1.1 };
            assert_eq!(Driver::ALL.map(|driver| case.drive(driver).crash), expected, "{gap} m");
        }
    }

    #[test]
    fn a_vehicle_revealed_too_late_is_hit_with_what_braking_left() {
        let case = CutOut { velocity: kmh(80.0), front_distance: 2.0, sideways: 2.9 };
        let (ending, leader_crash) = case.drive(Driver::Cc);
        assert!(ending.crash && leader_crash && ending.impact_speed > 0.0 && ending.impact_speed < kmh(80.0));
        let far = CutOut { front_distance: 120.0, ..case };
        let (ending, leader_crash) = far.drive(Driver::Cc);
        assert!(!ending.crash && !leader_crash && ending.ttc_min > 0.0);
    }

    #[test]
    fn of_leaders_that_brake_only_the_hardest_is_too_much_for_rss() {
        // Its parameters take 6 m/s² for the hardest braking of others.
        let hard = Following { velocity: kmh(120.0), deceleration: 0.9 * 9.81 };
        let ending = hard.drive(Driver::Rss);
        assert!(ending.crash && (ending.impact_speed - 4.860_837_333_333_319).abs() < 1e-9);
        assert!(!hard.drive(Driver::Cc).crash && !hard.drive(Driver::Fsm).crash);
    }

    #[test]
    fn whether_fsm_stops_behind_the_hardest_braking_depends_on_what_rounding_leaves_of_the_first_gap() {
        // At the distance that it keeps, PFS is exactly 0. A hair less, and it reacts one step earlier: that suffices in
        // the only four followings of the grid in which it crashes, and changes none of the others.
        let hair = 2e-9;
        let mut decided = Vec::new();
        for v in (12..=128).step_by(2).map(f64::from) {
            for share in (1..=19).map(|i| 0.05 * f64::from(i)) {
                let case = Following { velocity: kmh(v), deceleration: share * 9.81 };
                let kept = Driver::Fsm.kept_distance(case.velocity);
                let crash = |gap| case.drive_from(Driver::Fsm, gap).crash;
                assert_eq!(crash(kept), crash(kept + hair), "{v} km/h, {share} g");
                assert!(!crash(kept - hair), "{v} km/h, {share} g");
                if crash(kept) {
                    decided.push((v, (100.0 * share).round()));
                }
            }
        }
        assert_eq!(decided, [122.0, 124.0, 126.0, 128.0].map(|v| (v, 95.0)));
    }

    #[test]
    fn numbers_that_are_no_case_are_named() {
        let case = CutIn { velocity: 20.0, other_velocity: 10.0, gap: 20.0, sideways: 1.0 };
        assert!(case.check().is_ok());
        for (wrong, words) in [
            (CutIn { velocity: -1.0, ..case }, "a speed must not be negative, is -1"),
            (CutIn { gap: f64::NAN, ..case }, "the gap must not be negative, is NaN"),
            (CutIn { sideways: -0.1, ..case }, "the sideways speed must not be negative, is -0.1"),
        ] {
            assert_eq!(wrong.check().expect_err("refused").to_string(), words);
        }
    }
}
