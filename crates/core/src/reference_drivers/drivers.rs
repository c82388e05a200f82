//! What each driver takes for danger, how long it takes to react, and how it brakes.
//!
//! Sources: UN Regulation No. 157, Annex 4, Appendix 3 and paragraph 5.2.5.2; Shalev-Shwartz, Shammah, Shashua, "On a
//! Formal Model of Safe and Scalable Self-driving Cars", arXiv 1708.06374 (RSS); Mattas et al., "Fuzzy Surrogate Safety
//! Metrics for real-time assessment of rear-end collision risk", Accident Analysis and Prevention 148, 2020, 105794
//! (FSM). Numbers, units and the order of a step: those of JRC's comparison of the four.

use super::rss;

/// Full braking of `Cc`, `Rss` and `Fsm`: 0.774 g [m/s²] ...
pub const DECELERATION_MAX: f64 = 0.774 * 9.81;
/// ... which grows by this [m/s³].
const JERK: f64 = 12.65;
/// What `Cc` loses by taking its foot off the pedal while it reacts [m/s²].
const COASTING: f64 = 0.4;
/// Braking of `R157` [m/s²].
const R157_DECELERATION: f64 = 6.0;
/// Constant of the time to collision that `R157` takes for critical [s]: its delay and a step.
const R157_TIME: f64 = 0.35 + 0.1;
/// Sideways distance at which `R157` sees a vehicle in its lane [m]: that vehicle is 0.3 m over the line between two lanes
/// of 3.5 m with vehicles of 1.9 m in their middle.
const R157_SIDE: f64 = 0.5;
/// A cut-in is dangerous for `Cc` up to this time to collision [s].
pub(super) const CC_TIME: f64 = 2.0;
/// Reaction time of `Rss` and `Fsm` [s].
const REACTION_TIME: f64 = 0.75;
/// Comfortable and hard braking of `Fsm`, and that expected of others [m/s²].
const FSM_COMFORTABLE: f64 = 4.0;
const FSM_HARD: f64 = 6.0;
const FSM_OTHERS: f64 = 7.0;
/// Gap that `Fsm` keeps in front of a standing vehicle [m].
const FSM_STANDING_GAP: f64 = 2.0;
/// Gaps below this are no gap [m].
const GAP_MIN: f64 = 1e-3;
/// With acceleration `a`, before a reaction, a driver approaches its set speed at most so hard [m/s²].
pub const APPROACH: f64 = 1.0;

/// A reference driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Driver {
    /// Competent and careful human driver (UN R157, Annex 4, Appendix 3).
    Cc,
    /// Minimum of UN R157, paragraph 5.2.5.2; defined for cut-ins only.
    R157,
    /// Responsibility-Sensitive Safety.
    Rss,
    /// Fuzzy safety model.
    Fsm,
}

/// How the other vehicle came to be ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encounter {
    /// It comes from the side.
    CutIn,
    /// It is revealed ahead by a leader that leaves the lane, or is a leader that brakes: `Cc` reacts to it in any case.
    Ahead,
    /// Any traffic. `Cc` sees danger in a vehicle in its way that leaves less than two seconds and the way of braking to its
    /// speed: this contains the rule of cut-ins, and reacts to standing vehicles from as far as `Ahead` has to.
    Traffic,
}

/// What a driver sees of one other vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// The driver's speed [m/s] ...
    pub velocity: f64,
    /// ... and what the last step did to it [m/s²].
    pub acceleration: f64,
    /// The other's speed along the driver's way [m/s].
    pub other_velocity: f64,
    /// Between the footprints along the way [m]; negative if they are beside each other.
    pub gap: f64,
    /// Between the other's footprint and the driver's way [m]; not positive: it is in the way.
    pub side: f64,
    /// The other's speed towards the way [m/s].
    pub toward: f64,
    /// Its centre is not behind the driver's.
    pub is_ahead: bool,
    /// Length of both footprints [m].
    pub lengths: f64,
}

impl Driver {
    /// All, in the order of tables.
    pub const ALL: [Self; 4] = [Self::Cc, Self::R157, Self::Rss, Self::Fsm];

    /// Its name, everywhere.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cc => "cc",
            Self::R157 => "r157",
            Self::Rss => "rss",
            Self::Fsm => "fsm",
        }
    }

    /// From seeing danger to braking [s].
    pub fn delay(self) -> f64 {
        if self == Self::R157 { 0.35 } else { REACTION_TIME }
    }

    /// Gap that it keeps to a leader of its speed [m]; that of `R157`, which has none, is that of `Cc`.
    pub fn kept_distance(self, velocity: f64) -> f64 {
        match self {
            Self::Cc | Self::R157 => 2.0 * velocity,
            Self::Fsm => {
                let (safe, _) = proactive(velocity, velocity);
                safe + FSM_STANDING_GAP
            }
            Self::Rss => {
                let r = REACTION_TIME;
                // The leader may be as much slower as the reaction takes, and no vehicle reverses.
                let slower = (velocity - 2.0 * rss::JRC.acceleration * r).max(0.0);
                let reach = rss::JRC.braking_way(velocity);
                reach - slower * slower / (2.0 * rss::JRC.braking_max) + rss::JRC.acceleration * r * r
            }
        }
    }

    /// Whether it sees danger.
    pub fn sees_danger(self, seen: &Seen, encounter: Encounter) -> bool {
        let &Seen { velocity: v, other_velocity: u, gap, side, toward, .. } = seen;
        match (self, encounter) {
            (Self::Cc, Encounter::Ahead) => return true,
            _ if !seen.is_ahead => return false,
            _ => {}
        }
        match self {
            Self::Cc if encounter == Encounter::CutIn => side <= 0.0 && (gap / (v - u)).abs() <= CC_TIME,
            Self::Cc => {
                let faster = v - u;
                let room = faster * CC_TIME + faster * faster / (2.0 * DECELERATION_MAX);
                side <= 0.0 && faster > 0.0 && gap <= room
            }
            Self::R157 => {
                let faster = v - u;
                // Of a vehicle beside, too, as in JRC's program: its whole grid of cut-ins says so.
                side <= R157_SIDE && (gap / faster).abs() <= faster / 12.0 + R157_TIME
            }
            Self::Rss => {
                let sideways = rss::JRC_LATERAL.sideways(toward.abs());
                gap < rss::JRC.same_direction_unbounded(v, u) && side < sideways
            }
            Self::Fsm => {
                let arrives = || toward > 0.0 && v > u && side / toward <= (gap + seen.lengths) / (v - u) + 0.1;
                (side <= 0.0 || arrives()) && seen.proactive() + seen.critical() > 0.0
            }
        }
    }

    /// How much a danger asks of it: the deceleration that it finds right, then that which takes back the difference of the
    /// speeds within the gap [m/s²]. Of several, it reacts to the greatest.
    pub fn urgency(self, seen: &Seen) -> (f64, f64) {
        let faster = (seen.velocity - seen.other_velocity).max(0.0);
        (self.deceleration_max(seen), faster * faster / (2.0 * seen.gap.max(GAP_MIN)))
    }

    /// Largest deceleration that it finds right for what it sees [m/s²].
    pub fn deceleration_max(self, seen: &Seen) -> f64 {
        match self {
            Self::Cc | Self::Rss => DECELERATION_MAX,
            Self::R157 => R157_DECELERATION,
            Self::Fsm => {
                let critical = seen.critical();
                if critical > 0.0 {
                    FSM_COMFORTABLE + (FSM_HARD - FSM_COMFORTABLE) * critical
                } else {
                    FSM_COMFORTABLE * seen.proactive()
                }
            }
        }
    }
}

/// 0 above `safe`, 1 below `unsafe_`, linear between. At `safe` itself, which is the distance that `Fsm` keeps, rounding is no
/// danger.
fn ramp(x: f64, safe: f64, unsafe_: f64) -> f64 {
    if x >= safe - 1e-9 {
        0.0
    } else if x <= unsafe_ {
        1.0
    } else {
        (safe - x) / (safe - unsafe_)
    }
}

/// Gaps above which `Fsm` is at ease behind a vehicle, and below which it brakes as hard as is comfortable [m].
fn proactive(v: f64, u: f64) -> (f64, f64) {
    let (reaction, others) = (REACTION_TIME * v, u * u / (2.0 * FSM_OTHERS));
    let own = |deceleration: f64| v * v / (2.0 * deceleration);
    (reaction + own(FSM_COMFORTABLE) - others + FSM_STANDING_GAP, reaction + own(FSM_HARD) - others)
}

impl Seen {
    /// Proactive fuzzy surrogate safety metric (PFS), 0 to 1: what if the other brakes?
    pub fn proactive(&self) -> f64 {
        let (safe, unsafe_) = proactive(self.velocity, self.other_velocity);
        ramp(self.gap - FSM_STANDING_GAP, safe, unsafe_)
    }

    /// Critical fuzzy surrogate safety metric (CFS), 0 to 1: what if both go on as they are?
    pub fn critical(&self) -> f64 {
        let &Self { velocity: v, other_velocity: u, gap, .. } = self;
        if v <= u {
            return 0.0;
        }
        let a = self.acceleration.max(-FSM_COMFORTABLE);
        let later = v + REACTION_TIME * a;
        if later < u {
            let way = (v - u) * (v - u) / (2.0 * self.acceleration.abs());
            return if gap < way { 1.0 } else { 0.0 };
        }
        let reaction = REACTION_TIME * (v + 0.5 * REACTION_TIME * a - u);
        let own = |deceleration: f64| (later - u) * (later - u) / (2.0 * deceleration);
        ramp(gap, reaction + own(FSM_COMFORTABLE), reaction + own(FSM_HARD))
    }
}

/// What rounding may leave of a delay that is a whole number of steps [s].
const DELAY_ROUNDING: f64 = 1e-9;

/// A driver in the course of its reaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reaction {
    driver: Driver,
    /// What is left of its delay [s]; it brakes once nothing is.
    left: f64,
    /// Deceleration that it has built up [m/s²].
    built_up: f64,
    /// It has seen danger.
    has_begun: bool,
}

impl Reaction {
    /// Before any danger.
    pub fn new(driver: Driver) -> Self {
        let built_up = if driver == Driver::Cc { COASTING } else { 0.0 };
        Self { driver, left: driver.delay(), built_up, has_begun: false }
    }

    /// The driver that reacts.
    pub fn driver(&self) -> Driver {
        self.driver
    }

    /// It has seen danger: from then on it does not accelerate any more.
    pub fn has_begun(&self) -> bool {
        self.has_begun
    }

    /// It has not begun to brake.
    pub fn is_waiting(&self) -> bool {
        self.left > DELAY_ROUNDING
    }

    /// Deceleration in the next `dt` [s] in view of danger [m/s²].
    pub fn brake(&mut self, seen: &Seen, dt: f64) -> f64 {
        self.has_begun = true;
        if self.left > DELAY_ROUNDING {
            self.left -= dt;
            return if self.driver == Driver::Cc { COASTING } else { 0.0 };
        }
        if self.driver == Driver::R157 {
            return R157_DECELERATION;
        }
        self.built_up = (self.built_up + JERK * dt).min(DECELERATION_MAX);
        self.built_up.min(self.driver.deceleration_max(seen))
    }

    /// Speed after the next `dt` [s], in danger or not, for a set speed [m/s].
    pub fn next_velocity(&mut self, seen: &Seen, is_danger: bool, set_velocity: f64, dt: f64) -> f64 {
        let velocity = seen.velocity;
        if is_danger {
            (velocity - self.brake(seen, dt) * dt).max(0.0)
        } else if self.has_begun {
            velocity
        } else {
            velocity + (set_velocity - velocity).clamp(-APPROACH * dt, APPROACH * dt)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AHEAD: Seen = Seen {
        velocity: 20.0,
        acceleration: 0.0,
        other_velocity: 10.0,
        gap: 18.0,
        side: -1.9,
        toward: 0.0,
        is_ahead: true,
        lengths: 8.6,
    };

    #[test]
    fn a_delay_takes_eight_steps_or_four_and_braking_grows() {
        for (driver, expected) in [
            // 0.4 m/s² for eight steps, then 0.4 + 1.265 m/s² more with every step
            (Driver::Cc, [0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 0.4, 1.665, 2.93]),
            (Driver::R157, [0.0, 0.0, 0.0, 0.0, 6.0, 6.0, 6.0, 6.0, 6.0, 6.0]),
            (Driver::Rss, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.265, 2.53]),
        ] {
            let mut reaction = Reaction::new(driver);
            let found: Vec<f64> = (0..10).map(|_| reaction.brake(&AHEAD, 0.1)).collect();
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{driver:?}: {found:?}");
            let last = (0..20).map(|_| reaction.brake(&AHEAD, 0.1)).last().expect("twenty");
            assert!((last - if driver == Driver::R157 { 6.0 } else { 7.59294 }).abs() < 1e-12);
        }
    }

    #[test]
    fn a_delay_that_is_a_whole_number_of_steps_takes_no_step_more() {
        for (dt, driver, expected) in [
            (0.05, Driver::Rss, 15),
            (0.05, Driver::R157, 7),
            (0.03, Driver::Rss, 25),
            (0.07, Driver::R157, 5),
            // 0.76 s
            (0.04, Driver::Rss, 19),
        ] {
            let mut reaction = Reaction::new(driver);
            let steps = (0..100).take_while(|_| reaction.brake(&AHEAD, dt) == 0.0).count();
            assert_eq!(steps, expected, "{driver:?} {dt}");
        }
    }

    #[test]
    fn a_slow_vehicle_is_more_urgent_than_a_nearer_one_of_almost_the_same_speed() {
        let near = Seen { gap: 10.0, other_velocity: 19.0, ..AHEAD };
        let slow = Seen { gap: 25.0, other_velocity: 2.0, ..AHEAD };
        for driver in Driver::ALL {
            assert!(driver.urgency(&slow) > driver.urgency(&near), "{driver:?}");
        }
    }

    #[test]
    fn no_driver_sees_danger_in_a_vehicle_behind_or_one_that_is_as_fast_and_far() {
        for driver in Driver::ALL {
            for encounter in [Encounter::CutIn, Encounter::Traffic] {
                assert!(!driver.sees_danger(&Seen { is_ahead: false, gap: 1.0, ..AHEAD }, encounter), "{driver:?}");
                let gone = Seen { other_velocity: 20.0, gap: 60.0, ..AHEAD };
                assert!(!driver.sees_danger(&gone, encounter), "{driver:?}");
                assert!(driver.sees_danger(&Seen { gap: 5.0, ..AHEAD }, encounter), "{driver:?}");
            }
        }
    }

    #[test]
    fn the_fuzzy_measures_are_those_of_the_formulas() {
        // v 20, u 10: safe 15 + 50 - 100/14 + 2, unsafe 15 + 400/12 - 100/14
        let (safe, unsafe_): (f64, f64) = (15.0 + 50.0 - 100.0 / 14.0 + 2.0, 15.0 + 400.0 / 12.0 - 100.0 / 14.0);
        for gap in [safe + 3.0, 0.5 * (safe + unsafe_) + 2.0, unsafe_] {
            let expected = ((safe - (gap - 2.0)) / (safe - unsafe_)).clamp(0.0, 1.0);
            assert!((Seen { gap, ..AHEAD }.proactive() - expected).abs() < 1e-12, "{gap}");
        }
        // Without braking: 7.5 + 100/8 and 7.5 + 100/12
        assert_eq!(Seen { gap: 20.1, ..AHEAD }.critical(), 0.0);
        assert_eq!(Seen { gap: 15.8, ..AHEAD }.critical(), 1.0);
        assert!((AHEAD.critical() - (20.0 - 18.0) / (100.0 / 8.0 - 100.0 / 12.0)).abs() < 1e-12);
        // It will be slower than the other within the reaction: 4 m/s² takes 100/8 m, wherever it is bound for.
        let braking = Seen { other_velocity: 18.0, acceleration: -4.0, ..AHEAD };
        assert_eq!(Seen { gap: 0.4, ..braking }.critical(), 1.0);
        assert_eq!(Seen { gap: 0.6, ..braking }.critical(), 0.0);
    }

    #[test]
    fn without_danger_the_set_speed_is_approached_until_the_first_reaction() {
        let mut reaction = Reaction::new(Driver::Rss);
        assert_eq!(reaction.next_velocity(&AHEAD, false, 25.0, 0.1), 20.1);
        assert_eq!(reaction.next_velocity(&AHEAD, false, 19.0, 0.1), 19.9);
        assert_eq!(reaction.next_velocity(&AHEAD, true, 25.0, 0.1), 20.0);
        assert!(reaction.has_begun());
        assert_eq!(reaction.next_velocity(&AHEAD, false, 25.0, 0.1), 20.0);
    }
}
