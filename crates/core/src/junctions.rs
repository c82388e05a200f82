//! Junctions, derived from the lanelets: the areas that two ways share, and which of both goes first.

mod areas;
mod precedence;
#[cfg(test)]
mod tests;

use crate::control::Control;
use crate::geometry::shape::PlacedShape;
use crate::road::RoadNetwork;

/// How two lanelets meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum AreaKind {
    /// Each leads across the other.
    Cross = 0,
    /// Both lead into the same lanelet; the area lasts to the end of both.
    Merge = 1,
    /// They run against each other.
    Opposed = 2,
}

impl AreaKind {
    /// All kinds; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 3] = [Self::Cross, Self::Merge, Self::Opposed];
}

/// Why one way goes before another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// No rule decides: the first to arrive goes first.
    Arrival = 0,
    /// Signs.
    Sign = 1,
    /// A turn across oncoming traffic waits.
    Oncoming = 2,
    /// Driveways, ramps and the like wait.
    Minor = 3,
    /// The main road, by speed limits or the shape of the junction.
    MainRoad = 4,
    /// Priority to the right, or to the left.
    Side = 5,
    /// A continuing lane goes before a lane that ends.
    Continues = 6,
    /// The smaller turn.
    Turn = 7,
}

impl Reason {
    /// All reasons; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 8] = [
        Self::Arrival,
        Self::Sign,
        Self::Oncoming,
        Self::Minor,
        Self::MainRoad,
        Self::Side,
        Self::Continues,
        Self::Turn,
    ];
}

/// A stretch of a lanelet in an area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// Index of the lanelet.
    pub lanelet: usize,
    /// Arc length on the lanelet's centre line at which the area begins [m].
    pub entry: f64,
    /// ... and at which it ends [m].
    pub exit: f64,
}

/// What two lanelets have in common so that vehicles on both cannot use it at once.
#[derive(Debug, Clone, PartialEq)]
pub struct Area {
    /// How they meet.
    pub kind: AreaKind,
    /// The stretches of both lanelets, the lower index first.
    pub sides: [Side; 2],
    /// What two vehicles have beside each other [m]; infinite except for lanelets that run against each other.
    pub width: f64,
    /// Convex hull of the shared ground.
    pub hull: PlacedShape,
    /// Number of the junction.
    pub junction: usize,
    /// The position in `sides` of the side that goes first; `None`: the first to arrive.
    pub first: Option<usize>,
    /// Why.
    pub reason: Reason,
    /// The ways come to it from the same side: lanes that become one.
    pub is_side_by_side: bool,
}

impl Area {
    /// A sign makes a side wait.
    pub(crate) fn waits_for_a_sign(&self, side: usize) -> bool {
        self.reason == Reason::Sign && self.first == Some(1 - side)
    }
}

/// All junctions of a map.
#[derive(Debug, Clone, Default)]
pub struct Junctions {
    /// The areas, ordered by the indices of their lanelets.
    pub areas: Vec<Area>,
    /// For each lanelet the positions of its areas, and of its side in each.
    of_lanelet: Vec<Vec<(usize, usize)>>,
    /// Number of junctions: areas that are connected by common lanelets.
    pub n_junctions: usize,
}

impl Junctions {
    /// Finds and orders everything that vehicles share.
    pub fn of(road: &RoadNetwork, control: &Control) -> Self {
        let mut areas = areas::find(road);
        let mut of_lanelet = vec![Vec::new(); road.lanelets().len()];
        for (index, area) in areas.iter().enumerate() {
            for (side, stretch) in area.sides.iter().enumerate() {
                of_lanelet[stretch.lanelet].push((index, side));
            }
        }
        let n_junctions = number(&mut areas, &of_lanelet);
        let mut found = Self { areas, of_lanelet, n_junctions };
        precedence::decide_all(&mut found, road, control);
        found
    }

    /// Positions of the areas of a lanelet, and of its side in each.
    pub fn of_lanelet(&self, lanelet: usize) -> &[(usize, usize)] {
        &self.of_lanelet[lanelet]
    }
}

/// Gives areas that are connected by common lanelets the same number; returns how many there are.
fn number(areas: &mut [Area], of_lanelet: &[Vec<(usize, usize)>]) -> usize {
    let mut n_junctions = 0;
    let mut numbered = vec![false; areas.len()];
    for first in 0..areas.len() {
        if numbered[first] {
            continue;
        }
        let mut waiting = vec![first];
        while let Some(index) = waiting.pop() {
            if std::mem::replace(&mut numbered[index], true) {
                continue;
            }
            areas[index].junction = n_junctions;
            for side in areas[index].sides {
                waiting.extend(of_lanelet[side.lanelet].iter().map(|(area, _)| *area).filter(|area| !numbered[*area]));
            }
        }
        n_junctions += 1;
    }
    n_junctions
}
