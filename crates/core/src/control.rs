//! Traffic control: traffic lights, the lines before which vehicles stop, signs of priority, lines between lanes,
//! crosswalks. Immutable once built.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, Result};
use crate::geometry::Point;
use crate::road::RoadNetwork;
use crate::turn::Turn;

/// What a traffic light shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Signal {
    /// Nothing: it is switched off, or its phase is inactive.
    Dark = 0,
    /// Green.
    Green = 1,
    /// Yellow.
    Yellow = 2,
    /// Red, or red and yellow.
    Red = 3,
}

impl Signal {
    /// All signals; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 4] = [Self::Dark, Self::Green, Self::Yellow, Self::Red];

    /// It holds nobody. Yellow and red hold who could still stop.
    pub fn lets_go(self) -> bool {
        matches!(self, Self::Green | Self::Dark)
    }
}

/// A traffic light with its cycle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrafficLight {
    /// Its id.
    pub id: i64,
    /// Time step at which its cycle begins.
    pub offset: i64,
    /// Length in time steps and signal of each phase; none: it is dark.
    pub phases: Vec<(i64, Signal)>,
}

impl TrafficLight {
    /// Length of its cycle in time steps.
    fn cycle(&self) -> i64 {
        self.phases.iter().map(|(length, _)| length).sum()
    }

    /// The same; 0 if it always shows the same.
    pub fn changing_cycle(&self) -> i64 {
        if self.phases.windows(2).any(|pair| pair[0].1 != pair[1].1) { self.cycle() } else { 0 }
    }

    /// What it shows at a time step: the phase at (time step - offset) modulo the length of the cycle.
    pub fn signal(&self, time_step: i64) -> Signal {
        let cycle = self.cycle();
        if cycle <= 0 {
            return Signal::Dark;
        }
        let mut left = time_step.wrapping_sub(self.offset).rem_euclid(cycle);
        for (length, signal) in &self.phases {
            left -= length;
            if left < 0 {
                return *signal;
            }
        }
        Signal::Dark
    }
}

/// A line before which vehicles stop for a red light or a stop sign.
#[derive(Debug, Clone, PartialEq)]
pub struct StopLine {
    /// Index of the lanelet that ends at it or contains it.
    pub lanelet: usize,
    /// Its ends, world frame [m].
    pub ends: [Point; 2],
    /// Every vehicle stops here, whatever the lights show.
    pub has_stop_sign: bool,
    /// For each lanelet that follows, the positions in `Control::lights` of the lights that count on the way there.
    pub lights: Vec<(usize, Vec<usize>)>,
    /// Lanelets that follow onto which drivers may turn on red after stopping.
    pub turns_on_red: Vec<usize>,
}

/// A stop line as a file states it; lanelets are ids.
#[derive(Debug, Clone, PartialEq)]
pub struct StopLineInput {
    /// The lanelet that ends at it or contains it.
    pub lanelet: i64,
    /// Its ends, world frame [m].
    pub ends: [Point; 2],
    /// Every vehicle stops here, whatever the lights show.
    pub has_stop_sign: bool,
    /// For each lanelet that follows, the positions of the lights that count on the way there.
    pub lights: Vec<(i64, Vec<usize>)>,
    /// Lanelets that follow onto which drivers may turn on red after stopping.
    pub turns_on_red: Vec<i64>,
}

/// What a stop sign is worth, the least of all signs: where every way has one, the first to arrive goes first.
pub const STOP_RANK: u8 = 1;
/// What a way without a sign is worth.
pub const RANK_WITHOUT_SIGN: u8 = 3;

/// What a file says about priority at junctions; lanelets are indices.
#[derive(Debug, Clone, PartialEq)]
pub struct Priorities {
    /// Turns of the lanelets that lead across junctions, where the file states them.
    pub turns: BTreeMap<usize, Turn>,
    /// For lanelets that lead to a junction and have a sign: what it is worth for each turn
    /// (`scenario/signs.py` of the package), from `STOP_RANK` on.
    pub ranks: BTreeMap<usize, [u8; 3]>,
    /// Lanelets from which others are entered with care: driveways, ramps, bus stops.
    pub minor: BTreeSet<usize>,
    /// Vehicles drive on the left.
    pub left_hand: bool,
    /// Without any sign, vehicles from the right (1), from the left (-1) or from neither side (0) go first.
    pub priority_side: i8,
    /// At a T without signs the road that goes on is the main road.
    pub derives_main_road: bool,
}

impl Default for Priorities {
    /// Right-hand traffic, priority to the right, no signs.
    fn default() -> Self {
        Self {
            turns: BTreeMap::new(),
            ranks: BTreeMap::new(),
            minor: BTreeSet::new(),
            left_hand: false,
            priority_side: 1,
            derives_main_road: false,
        }
    }
}

/// Traffic lights, stop lines, priorities, closed lines and crosswalks of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Control {
    /// The lights.
    pub lights: Vec<TrafficLight>,
    /// The lines.
    pub lines: Vec<StopLine>,
    /// Priority at junctions.
    pub priorities: Priorities,
    /// Lanelets whose left and whose right line must not be crossed from there, ascending.
    pub closed: [Vec<usize>; 2],
    /// Indices of the lanelets on which people cross the road, ascending.
    pub crosswalks: Vec<usize>,
}

impl Control {
    /// Checks and keeps the parts; without priorities, closed lines and crosswalks.
    ///
    /// # Errors
    /// `InvalidInput` naming the light or the lanelet: a lanelet or light that does not exist, a phase without length, an
    /// end that is not a number.
    pub fn new(lights: Vec<TrafficLight>, lines: Vec<StopLineInput>, road: &RoadNetwork) -> Result<Self> {
        for light in &lights {
            let mut cycle = 0_i64;
            for (length, _) in &light.phases {
                cycle = if *length > 0 { cycle.saturating_add(*length) } else { i64::MAX };
            }
            if cycle == i64::MAX {
                return Err(Error::invalid(format!("traffic light {}: each phase must last a time step", light.id)));
            }
        }
        let index = |id: i64| road.index_of(id).ok_or(Error::UnknownId { what: "lanelet", id });
        let line = |StopLineInput { lanelet, ends, has_stop_sign, lights: ways, turns_on_red }| {
            if !ends.iter().all(|end| end.is_possible()) {
                return Err(Error::invalid(format!("stop line of lanelet {lanelet}: its ends are not numbers")));
            }
            if ways.iter().flat_map(|(_, found)| found).any(|light| *light >= lights.len()) {
                return Err(Error::invalid(format!("stop line of lanelet {lanelet}: a traffic light is missing")));
            }
            let lights = ways.into_iter().map(|(next, found)| Ok((index(next)?, found))).collect::<Result<_>>()?;
            let turns_on_red = turns_on_red.into_iter().map(index).collect::<Result<_>>()?;
            Ok(StopLine { lanelet: index(lanelet)?, ends, has_stop_sign, lights, turns_on_red })
        };
        let lines = lines.into_iter().map(line).collect::<Result<_>>()?;
        Ok(Self { lights, lines, ..Self::default() })
    }

    /// What some lights show together: one green is green, else one yellow is yellow, else red; dark if all are.
    pub fn signal(&self, lights: &[usize], time_step: i64) -> Signal {
        let mut shown = Signal::Dark;
        for light in lights {
            match self.lights[*light].signal(time_step) {
                Signal::Green => return Signal::Green,
                Signal::Yellow => shown = Signal::Yellow,
                Signal::Red if shown == Signal::Dark => shown = Signal::Red,
                Signal::Red | Signal::Dark => {}
            }
        }
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::testing::straight_road;

    fn light(offset: i64, phases: &[(i64, Signal)]) -> TrafficLight {
        TrafficLight { id: 1, offset, phases: phases.to_vec() }
    }

    #[test]
    fn a_light_shows_the_phase_of_its_cycle() {
        let light = light(790, &[(170, Signal::Green), (30, Signal::Yellow), (800, Signal::Red)]);
        for (time_step, expected) in [
            (0, Signal::Red),
            (789, Signal::Red),
            (790, Signal::Green),
            (959, Signal::Green),
            (960, Signal::Yellow),
            (989, Signal::Yellow),
            (990, Signal::Red),
            (1790, Signal::Green),
        ] {
            assert_eq!(light.signal(time_step), expected, "{time_step}");
        }
        assert_eq!(self::light(0, &[]).signal(5), Signal::Dark);
    }

    #[test]
    fn a_light_that_always_shows_the_same_has_no_changing_cycle() {
        let cycle = |phases: &[(i64, Signal)]| light(3, phases).changing_cycle();
        assert_eq!(cycle(&[(170, Signal::Green), (30, Signal::Yellow), (800, Signal::Red)]), 1000);
        assert_eq!(cycle(&[(170, Signal::Red), (30, Signal::Red)]), 0);
        assert_eq!((cycle(&[(170, Signal::Red)]), cycle(&[])), (0, 0));
    }

    #[test]
    fn of_several_lights_one_green_is_green_and_dark_ones_do_not_count() {
        let single = |signal| light(0, &[(1, signal)]);
        let lights = Signal::ALL.into_iter().map(single).collect();
        let control = Control { lights, ..Control::default() };
        let [dark, green, yellow, red] = [0, 1, 2, 3];
        for (lights, expected) in [
            (vec![red, green], Signal::Green),
            (vec![red, yellow], Signal::Yellow),
            (vec![yellow, red], Signal::Yellow),
            (vec![yellow, green], Signal::Green),
            (vec![red, dark], Signal::Red),
            (vec![dark, dark], Signal::Dark),
            (vec![], Signal::Dark),
        ] {
            assert_eq!(control.signal(&lights, 7), expected, "{lights:?}");
        }
    }

    #[test]
    fn what_does_not_exist_is_named() {
        let road = straight_road(1);
        let ends = [Point::new(50.0, -1.75), Point::new(50.0, 1.75)];
        let line = StopLineInput { lanelet: 1, ends, has_stop_sign: false, lights: vec![], turns_on_red: vec![] };
        let refused = |lights: Vec<TrafficLight>, line: StopLineInput| {
            Control::new(lights, vec![line], &road).expect_err("refused").to_string()
        };
        assert!(refused(vec![light(0, &[(0, Signal::Red)])], line.clone()).starts_with("traffic light 1:"));
        assert!(refused(vec![], StopLineInput { lanelet: 9, ..line.clone() }).contains('9'));
        let unlit = StopLineInput { lights: vec![(1, vec![0])], ..line.clone() };
        assert!(refused(vec![], unlit).starts_with("stop line of lanelet 1:"));
        let nowhere = StopLineInput { ends: [ends[0], Point::new(f64::NAN, 0.0)], ..line };
        assert!(refused(vec![], nowhere).starts_with("stop line of lanelet 1:"));
    }
}
