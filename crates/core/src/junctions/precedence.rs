//! Which of two ways over an area goes first: lights, signs, and what follows from the geometry.

use std::f64::consts::PI;

use super::{Area, AreaKind, Junctions, Reason, Side};
use crate::control::{Control, RANK_WITHOUT_SIGN, STOP_RANK};
use crate::geometry::wrap_angle;
use crate::road::RoadNetwork;
use crate::turn::Turn;

/// A way arrives along the chord of its last metres before the junction [m].
const CHORD_LENGTH: f64 = 5.0;
/// The part of a lanelet up to an area is inside the junction if it is shorter than this [m].
const INSIDE_LENGTH: f64 = 40.0;
/// Ways that arrive within this angle come from the same side, within this one of PI against each other [rad].
const SAME_SIDE: f64 = 30.0 / 180.0 * PI;
/// A limit that is higher by this makes the main road [m/s].
const LIMIT_STEP: f64 = 4.0;
/// A lanelet that keeps straighter by this angle goes on, the other one ends [rad].
const STRAIGHTER_ANGLE: f64 = 0.02;
/// A turn that is smaller by this goes first [rad].
const TURN_STEP: f64 = 20.0 / 180.0 * PI;

/// Decides for each area which side goes first, and why.
pub(super) fn decide_all(found: &mut Junctions, road: &RoadNetwork, control: &Control) {
    let of_area = |area: &Area| area.sides.map(|side| Approach::of(found, road, control, side));
    let approaches: Vec<[Approach; 2]> = found.areas.iter().map(of_area).collect();
    let arrivals = arrivals(found, &approaches);
    for (area, both) in found.areas.iter_mut().zip(&approaches) {
        area.is_side_by_side = area.kind == AreaKind::Merge && come_from_the_same_side(both);
        (area.first, area.reason) = decide(area, both, &arrivals[area.junction], (road, control));
    }
}

/// How a way comes to an area.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Approach {
    /// Direction of arrival [rad].
    heading: f64,
    /// Change of heading over the junction [rad].
    angle: f64,
    /// The turn as the file states it, otherwise by the angle.
    turn: Turn,
    /// What its sign is worth, or a way without one.
    rank: u8,
    has_lights: bool,
    is_minor: bool,
    /// Limit before the junction [m/s]; NaN: unknown.
    limit: f64,
}

impl Approach {
    /// Of the way over one side of an area.
    fn of(found: &Junctions, road: &RoadNetwork, control: &Control, side: Side) -> Self {
        let lanelets = road.lanelets();
        let (mut inside, mut before) = (vec![side.lanelet], None);
        let mut entry = side.entry;
        while entry < INSIDE_LENGTH {
            let Some(&previous) = road.predecessors_straightest_first(inside[0]).first() else { break };
            let is_part = found.of_lanelet(previous).iter().any(|(area, _)| {
                let side = found.areas[*area].sides.iter().find(|side| side.lanelet == previous);
                // An area at the beginning of a long lanelet belongs to the junction before it.
                side.is_some_and(|side| lanelets[previous].length - side.exit < INSIDE_LENGTH)
                    && lanelets[previous].length < INSIDE_LENGTH
            });
            if !is_part || inside.contains(&previous) {
                before = Some(previous);
                break;
            }
            entry += lanelets[previous].length;
            inside.insert(0, previous);
        }
        // On a long lanelet the junction begins at the area.
        let (place, from) = if entry < INSIDE_LENGTH { (inside[0], 0.0) } else { (side.lanelet, side.entry) };
        let heading = chord(road, place, from - CHORD_LENGTH, from);
        let rest = lanelets[side.lanelet].length - side.exit;
        let leaves = if rest < INSIDE_LENGTH {
            road.heading_at(side.lanelet, lanelets[side.lanelet].length)
        } else {
            chord(road, side.lanelet, side.exit, side.exit + CHORD_LENGTH)
        };
        let angle = wrap_angle(leaves - heading);
        let priorities = &control.priorities;
        let stated = inside.iter().find_map(|lanelet| priorities.turns.get(lanelet).copied());
        let turn = stated.unwrap_or(Turn::of_angle(angle));
        let arrival = before.unwrap_or(inside[0]);
        let rank = before.iter().chain(&inside).find_map(|lanelet| priorities.ranks.get(lanelet));
        let counts = |lights: &[usize]| lights.iter().any(|light| !control.lights[*light].phases.is_empty());
        let has_lights = control
            .lines
            .iter()
            .filter(|line| Some(line.lanelet) == before)
            .any(|line| line.lights.iter().any(|(next, lights)| inside.contains(next) && counts(lights)));
        Self {
            heading,
            angle,
            turn,
            rank: rank.map_or(RANK_WITHOUT_SIGN, |ranks| ranks[turn as usize]),
            has_lights,
            is_minor: priorities.minor.contains(&arrival),
            limit: lanelets[arrival].speed_limit,
        }
    }
}

/// Heading of a chord of the straightest way through a lanelet [rad].
fn chord(road: &RoadNetwork, lanelet: usize, from: f64, to: f64) -> f64 {
    let chord = road.beside(lanelet, to) - road.beside(lanelet, from);
    if chord.norm() > 1e-6 { chord.angle() } else { road.heading_at(lanelet, to) }
}

/// The ways that arrive at every junction.
fn arrivals<'a>(found: &Junctions, approaches: &'a [[Approach; 2]]) -> Vec<Vec<&'a Approach>> {
    let mut arrivals = vec![Vec::new(); found.n_junctions];
    for (area, both) in found.areas.iter().zip(approaches) {
        arrivals[area.junction].extend(both);
    }
    arrivals
}

/// Both ways arrive in about the same direction.
fn come_from_the_same_side([a, b]: &[Approach; 2]) -> bool {
    wrap_angle(b.heading - a.heading).abs() <= SAME_SIDE
}

/// The side that goes first, and why: the first rule that tells.
fn decide(
    area: &Area,
    [a, b]: &[Approach; 2],
    arrivals: &[&Approach],
    (road, control): (&RoadNetwork, &Control),
) -> (Option<usize>, Reason) {
    let priorities = &control.priorities;
    let angle = wrap_angle(b.heading - a.heading);
    let is_oncoming = angle.abs() >= PI - SAME_SIDE;
    let both_have_lights = a.has_lights && b.has_lights;
    let greater = |a: f64, b: f64| if a > b { Some(0) } else { (b > a).then_some(1) };
    let only = |a: bool, b: bool| greater(f64::from(a), f64::from(b));
    if area.kind == AreaKind::Opposed {
        return (None, Reason::Arrival);
    }
    if !both_have_lights {
        if let Some(first) = greater(f64::from(a.rank), f64::from(b.rank)) {
            return (Some(first), Reason::Sign);
        }
        if arrivals.iter().all(|approach| approach.rank == STOP_RANK) {
            return (None, Reason::Arrival);
        }
    }
    let across = if priorities.left_hand { Turn::Right } else { Turn::Left };
    if is_oncoming && let Some(first) = only(a.turn != across, b.turn != across) {
        return (Some(first), Reason::Oncoming);
    }
    if !both_have_lights {
        if let Some(first) = only(!a.is_minor, !b.is_minor) {
            return (Some(first), Reason::Minor);
        }
        let has_signs = [a, b].iter().any(|one| one.rank != RANK_WITHOUT_SIGN || one.has_lights);
        if !has_signs
            && angle.abs() > SAME_SIDE
            && let Some(first) = main_road([a, b], arrivals, control)
        {
            return (Some(first), Reason::MainRoad);
        }
    }
    if angle.abs() > SAME_SIDE && !is_oncoming && priorities.priority_side != 0 {
        let from_the_right = angle > 0.0;
        return (Some(usize::from(from_the_right == (priorities.priority_side > 0))), Reason::Side);
    }
    if area.kind == AreaKind::Merge && angle.abs() <= SAME_SIDE {
        let bends = area.sides.map(|side| bend(road, side.lanelet));
        if (bends[0] - bends[1]).abs() >= STRAIGHTER_ANGLE {
            return (greater(-bends[0], -bends[1]), Reason::Continues);
        }
    }
    if (a.angle.abs() - b.angle.abs()).abs() >= TURN_STEP {
        return (greater(-a.angle.abs(), -b.angle.abs()), Reason::Turn);
    }
    (None, Reason::Arrival)
}

/// The main road of two without signs: the faster one, or at a T the road that goes on.
fn main_road([a, b]: [&Approach; 2], arrivals: &[&Approach], control: &Control) -> Option<usize> {
    // Not a number compares false.
    if a.limit >= b.limit + LIMIT_STEP {
        return Some(0);
    }
    if b.limit >= a.limit + LIMIT_STEP {
        return Some(1);
    }
    let goes_on =
        |heading: f64| arrivals.iter().any(|other| wrap_angle(other.heading - heading).abs() >= PI - SAME_SIDE);
    match [a, b].map(|one| goes_on(one.heading)) {
        [true, false] if control.priorities.derives_main_road => Some(0),
        [false, true] if control.priorities.derives_main_road => Some(1),
        _ => None,
    }
}

/// Largest difference of a lanelet's headings from the last one [rad].
fn bend(road: &RoadNetwork, lanelet: usize) -> f64 {
    let length = road.lanelets()[lanelet].length;
    let last = road.heading_at(lanelet, length);
    let n = length.ceil().max(1.0) as usize;
    (0..=n).map(|i| wrap_angle(road.heading_at(lanelet, length * i as f64 / n as f64) - last).abs()).fold(0.0, f64::max)
}
