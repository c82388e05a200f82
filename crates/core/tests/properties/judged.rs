//! Criticality of any recording, with any settings that are allowed, and its formulas on any numbers.

use std::sync::Arc;

use interdrive_core::criticality::harm::{CrashBody, Sides, boundary_harm, collision_harm, mass};
use interdrive_core::criticality::{
    ConflictAreas, Connector, Criticality, LeadMembership, Request, Settings, ThwMode, Traffic, evaluate, formulas,
    overlapping_lanelets,
};
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::vehicle::ParticipantKind;

use crate::source::Source;
use crate::traffic;

fn settings(source: &mut Source) -> Settings {
    let default = Settings::default();
    let mut or = |value: f64| if source.is_odd() { source.any(0.0, 2.0 * value) } else { value };
    let (radius, ttc_threshold) = (or(default.radius), or(default.ttc_threshold));
    let (deceleration, lateral_acceleration) = (or(default.deceleration), or(default.lateral_acceleration));
    let (opposite_angle, erosion, overlap_min) =
        (or(default.opposite_angle), or(default.erosion), or(default.overlap_min));
    Settings {
        radius,
        ttc_threshold,
        deceleration,
        lateral_acceleration,
        opposite_angle,
        erosion,
        overlap_min,
        oncoming_filter: !source.chance(80),
        lead_membership: if source.chance(80) { LeadMembership::Footprint } else { LeadMembership::Center },
        thw_mode: if source.chance(80) { ThwMode::Recorded } else { ThwMode::Normalized },
        leader_stops: source.chance(80),
    }
}

/// Any recording is judged or there is a reason in words; judged with one thread and with two, the same bits come out.
pub fn check(source: &mut Source) {
    formulas_of(source);
    let Some(scenario) = traffic::scenario(source) else { return };
    let obstacles = scenario.obstacles;
    let mut ids = obstacles.states.ids.clone();
    if !source.is_odd() {
        let states = &obstacles.states;
        let is_there = |row: usize| states.valid[row * states.n_steps..(row + 1) * states.n_steps].contains(&true);
        ids.retain(|id| states.row(*id).is_some_and(|row| !obstacles.is_static[row] && is_there(row)));
    }
    let n_lanelets = scenario.road.lanelets().len();
    let conflict_areas = if source.chance(128) {
        let connector =
            |source: &mut Source| Connector { lanelet: source.below(n_lanelets), incoming: source.whole(0, 3) };
        ConflictAreas::Stated((0..source.below(5)).map(|_| connector(source)).collect())
    } else {
        ConflictAreas::Crossing
    };
    let contacts = match ids[..] {
        [first, .., last] if source.chance(40) => vec![(first, last, source.whole(0, 30))],
        _ => Vec::new(),
    };
    let settings = settings(source);
    let request = Request { ids, deceleration: Vec::new(), settings, conflict_areas, contacts, threads: 1 };
    overlapping_lanelets(&scenario.road, source.finite(0.0, 0.5), source.finite(0.0, 0.5));
    let states = obstacles.states;
    let judged = Traffic::new(scenario.dt, Arc::clone(&scenario.road), states, obstacles.shape, obstacles.is_static);
    let traffic = match judged {
        Ok(traffic) => traffic,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    match (evaluate(&traffic, &request), evaluate(&traffic, &Request { threads: 2, ..request })) {
        (Ok(one), Ok(two)) => assert_eq!(bits(&one), bits(&two), "one thread, two threads"),
        (Err(one), Err(two)) => assert!(one == two && !one.to_string().is_empty()),
        _ => panic!("an error with one number of threads alone"),
    }
}

fn bits(judged: &Criticality) -> Vec<u64> {
    let series = judged.series.iter().flat_map(|series| {
        let values = series.value.iter().map(|value| value.to_bits());
        values.chain(series.partner.iter().chain(&series.way).map(|id| *id as u64)).collect::<Vec<_>>()
    });
    let extremes = judged.extremes.iter().flatten();
    let extremes = extremes.flat_map(|one| [one.value.to_bits(), one.time_step as u64, one.partner as u64]);
    series.chain(extremes).collect()
}

/// The formulas on any numbers, NaN and infinity included.
fn formulas_of(source: &mut Source) {
    let mut any = || source.any(-50.0, 50.0);
    let (a, b, c, d) = (any(), any(), any(), any());
    formulas::time_headway(a, b);
    formulas::time_to_collision(a, b, c);
    formulas::required_acceleration(a, b, c);
    formulas::required_acceleration_stopping(a, b, c, d);
    formulas::required_lateral_acceleration(a, b, c, d);
    formulas::proportion_of_stopping_distance(a, formulas::minimal_stopping_distance(b, c));
    formulas::exposure(&[a, b, c], d, 0.1);
    let mut body = || {
        let kind = ParticipantKind::ALL[source.below(13)];
        CrashBody {
            kind,
            mass: mass(kind, source.any(1.0, 10.0), source.any(0.5, 3.0)),
            state: traffic::state(source, Pose::new(a, b, c)),
            before: Point::new(source.any(-5.0, 5.0), d),
        }
    };
    let (first, second) = (body(), body());
    boundary_harm(first.kind, a);
    for sides in [Sides::Symmetric, Sides::Asymmetric] {
        collision_harm(&first, &second, sides);
    }
}
