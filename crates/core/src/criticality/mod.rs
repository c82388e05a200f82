//! Criticality: how near recorded or simulated traffic comes to accidents, the measures of every vehicle and time step,
//! and the harm of collisions. Evaluated afterwards, on recorded states. See docs/reference/criticality.md.

pub mod approach;
pub mod blame;
pub mod preventability;
pub mod starting;
mod conflict;
mod curve;
mod evaluation_step;
mod footing;
pub mod formulas;
pub mod harm;
mod measure;
mod overlap;
mod paths;
mod result;
mod settings;
pub mod straight;
#[cfg(test)]
mod tests;
mod traffic;

use std::collections::BTreeSet;

use rayon::prelude::*;

pub use conflict::Connector;
pub use measure::Measure;
pub use result::{Criticality, Exposure, Extreme, LaneletPath, Series};
pub use settings::{LeadMembership, Settings, ThwMode};
pub use traffic::Traffic;

use crate::error::{Error, Result};
use crate::limits::check_threads;
use crate::road::RoadNetwork;
use conflict::{Conflicts, crossing_connectors};
use evaluation_step::{Ahead, Context, Decisive, Following, Moment, Via};
use overlap::Overlaps;
use paths::{PathSystems, starts};
use result::{Judged, assemble};

/// Distances that differ by less [m] are equal: of several equal encounters the earliest one counts, however the world
/// is turned.
const SAME_DISTANCE: f64 = 1e-8;

/// Where conflict areas are looked for.
#[derive(Debug, Clone, PartialEq)]
pub enum ConflictAreas {
    /// Between the connectors of the intersections that the map states.
    Stated(Vec<Connector>),
    /// Between all lanelets that cross or join.
    Crossing,
}

/// A request for an evaluation.
#[derive(Debug, Clone)]
pub struct Request {
    /// Participants to judge; each must be there at some time and not be static.
    pub ids: Vec<i64>,
    /// Available deceleration per id [m/s²]; empty: that of the settings.
    pub deceleration: Vec<f64>,
    /// Parameters and switches.
    pub settings: Settings,
    /// Where conflict areas are looked for.
    pub conflict_areas: ConflictAreas,
    /// Pairs of ids that touched between a time step and the one before, with that time step: their footprints may
    /// be apart again at it.
    pub contacts: Vec<(i64, i64, i64)>,
    /// Number of threads; results do not depend on it.
    pub threads: usize,
}

/// All measures for some participants.
///
/// # Errors
/// `InvalidInput` or `UnknownId` naming the participant or the setting that cannot be used.
pub fn evaluate(traffic: &Traffic, request: &Request) -> Result<Criticality> {
    request.settings.validate()?;
    check_threads(request.threads)?;
    let judged = judged(traffic, request)?;
    let contacts = contacts(traffic, &request.contacts)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(request.threads)
        .build()
        .map_err(|error| Error::invalid(format!("{} threads could not be started: {error}", request.threads)))?;
    Ok(pool.install(|| evaluated(traffic, request, &judged, &contacts)))
}

/// Pairs of different lanelets, as ascending indices, that share more than `overlap_min` [m²] once they are eroded by
/// `erosion` [m]: what "ways meet" means for oncoming traffic.
pub fn overlapping_lanelets(road: &RoadNetwork, erosion: f64, overlap_min: f64) -> Vec<(usize, usize)> {
    let overlaps = Overlaps::new(road, erosion, overlap_min);
    let n = road.lanelets().len();
    let others = |i: usize| (i + 1..n).map(move |j| (i, j));
    (0..n).flat_map(others).filter(|(i, j)| overlaps.of(*i, *j)).collect()
}

/// For every lanelet by index whether it crosses or joins others that do not come from the same one.
pub fn crossing_lanelets(road: &RoadNetwork, erosion: f64, overlap_min: f64) -> Vec<bool> {
    let mut found = vec![false; road.lanelets().len()];
    for connector in crossing_connectors(road, &Overlaps::new(road, erosion, overlap_min)) {
        found[connector.lanelet] = true;
    }
    found
}

/// Rows with their available deceleration, ascending.
fn judged(traffic: &Traffic, request: &Request) -> Result<Vec<(usize, f64)>> {
    let given = &request.deceleration;
    if !given.is_empty() && given.len() != request.ids.len() {
        let n = request.ids.len();
        return Err(Error::invalid(format!("{} available decelerations are given for {n} participants", given.len())));
    }
    let mut found = Vec::with_capacity(request.ids.len());
    for (i, &id) in request.ids.iter().enumerate() {
        let row = traffic.states.row(id).ok_or(Error::UnknownId { what: "participant", id })?;
        if traffic.is_static[row] {
            return Err(Error::invalid(format!("participant {id} is static: there is nothing to evaluate")));
        }
        if traffic.span(row).is_none() {
            return Err(Error::invalid(format!("participant {id} is never there: there is nothing to evaluate")));
        }
        let deceleration = given.get(i).copied().unwrap_or(request.settings.deceleration);
        if !(deceleration > 0.0 && deceleration.is_finite()) {
            return Err(Error::invalid(format!(
                "the available deceleration of participant {id} must be positive, not {deceleration}"
            )));
        }
        found.push((row, deceleration));
    }
    found.sort_by_key(|(row, _)| *row);
    if let Some(pair) = found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(Error::invalid(format!("participant {} is requested twice", traffic.states.ids[pair[0].0])));
    }
    Ok(found)
}

fn contacts(traffic: &Traffic, given: &[(i64, i64, i64)]) -> Result<Vec<(u32, u32, u32)>> {
    let row = |id: i64| traffic.states.row(id).ok_or(Error::UnknownId { what: "participant", id });
    let mut found = Vec::with_capacity(given.len());
    for &(a, b, time_step) in given {
        let (a, b) = (row(a)? as u32, row(b)? as u32);
        let column = usize::try_from(time_step.wrapping_sub(traffic.states.first_time_step))
            .ok()
            .filter(|column| *column < traffic.states.n_steps)
            .ok_or_else(|| Error::invalid(format!("a contact at time step {time_step} is outside the recording")))?;
        found.push((a.min(b), a.max(b), column as u32));
    }
    found.sort_unstable();
    Ok(found)
}

fn evaluated(
    traffic: &Traffic,
    request: &Request,
    judged: &[(usize, f64)],
    contacts: &[(u32, u32, u32)],
) -> Criticality {
    let settings = &request.settings;
    let tracks = traffic::tracks(traffic);
    let columns = traffic::columns(traffic);
    let needed: BTreeSet<paths::Start> = judged
        .iter()
        .flat_map(|(row, _)| (0..traffic.states.n_steps).map(|column| (*row, column)))
        .filter(|(row, column)| traffic.is_there(*row, *column))
        .flat_map(|(row, column)| starts(tracks[row].here(column)).map(|(start, _)| start))
        .collect();
    let paths = PathSystems::new(&traffic.road, needed, settings.radius);
    let wants_overlaps = settings.oncoming_filter
        || settings.lead_membership == LeadMembership::Footprint
        || request.conflict_areas == ConflictAreas::Crossing;
    let overlaps = wants_overlaps.then(|| Overlaps::new(&traffic.road, settings.erosion, settings.overlap_min));
    let connectors = match (&request.conflict_areas, &overlaps) {
        (ConflictAreas::Stated(connectors), _) => connectors.clone(),
        (ConflictAreas::Crossing, Some(overlaps)) => crossing_connectors(&traffic.road, overlaps),
        (ConflictAreas::Crossing, None) => Vec::new(),
    };
    let conflicts = Conflicts::new(traffic, &tracks, &connectors, settings.overlap_min);
    let context = Context {
        traffic,
        settings,
        tracks: &tracks,
        columns: &columns,
        paths: &paths,
        overlaps: overlaps.as_ref(),
        contacts,
    };
    let found: Vec<Judged> =
        judged.par_iter().map(|(row, deceleration)| judge(&context, &conflicts, *row, *deceleration)).collect();
    assemble(traffic, &paths, judged, &found)
}

fn judge(context: &Context<'_>, conflicts: &Conflicts<'_>, row: usize, deceleration: f64) -> Judged {
    let Context { traffic, settings, .. } = context;
    let (n, dt) = (traffic.states.n_steps, traffic.dt);
    let there: Vec<bool> = (0..n).map(|column| traffic.is_there(row, column)).collect();
    let mut series = vec![vec![Decisive::without_partner(f64::NAN); n]; Measure::ALL.len()];
    let mut in_the_way_only = vec![vec![Decisive::without_partner(f64::NAN); n]; Measure::FOLLOWING.len()];
    let mut write = |measure: Measure, column: usize, value: Decisive| series[measure as usize][column] = value;
    let encroachment = conflicts.of(row);
    let (mut closest, mut closest_column) = (Decisive::without_partner(f64::INFINITY), None);
    let (mut exposed_time, mut exposed_integral) = (0.0, 0.0);
    let alive = there.iter().filter(|there| **there).count() as f64 * dt;
    let (mut n_before, mut n_cannot_stop) = (0_u32, 0_u32);
    // Backwards: encounters and exposure look ahead.
    for column in (0..n).rev().filter(|column| there[*column]) {
        let moment = Moment::new(context, row, column);
        let Ahead { all, in_the_way } = moment.following();
        for (measure, value) in measured(&all, deceleration, settings) {
            write(measure, column, value);
        }
        for ((_, value), series) in measured(&in_the_way, deceleration, settings).into_iter().zip(&mut in_the_way_only)
        {
            series[column] = value;
        }
        let (time, integral) = formulas::exposure_of_sample(all.ttc.value, settings.ttc_threshold, dt);
        exposed_time += time;
        exposed_integral += integral;
        write(Measure::Tet, column, Decisive::without_partner(exposed_time / alive));
        write(Measure::Tit, column, Decisive::without_partner(exposed_integral));
        let (distance, partner) = moment.nearest();
        if distance <= closest.value + SAME_DISTANCE && partner != u32::MAX {
            let value = distance.min(closest.value);
            (closest, closest_column) = (Decisive { value, partner, via: Via::Nothing }, Some(column));
        }
        write(Measure::Dce, column, closest);
        let time = closest_column.map_or(f64::INFINITY, |at| (at - column) as f64 * dt);
        write(Measure::Ttce, column, Decisive { value: time, ..closest });
        let velocity = traffic.states.velocity[traffic.index(row, column)];
        let stopping = formulas::minimal_stopping_distance(velocity, deceleration);
        write(Measure::Msd, column, Decisive::without_partner(stopping));
        let remaining = encroachment.remaining[column];
        let proportion = formulas::proportion_of_stopping_distance(remaining.value, stopping);
        write(Measure::Psd, column, Decisive { value: proportion, ..remaining });
        if encroachment.is_before[column] {
            n_before += 1;
            n_cannot_stop += u32::from(proportion < 1.0);
        }
        write(Measure::Et, column, encroachment.et_series[column]);
        write(Measure::Pet, column, encroachment.pet_series[column]);
    }
    let exposure = Exposure {
        tet_seconds: exposed_time,
        tit_mean: exposed_integral / alive,
        psd_below_one: f64::from(n_cannot_stop) / f64::from(n_before),
        et_left_censored: encroachment.is_left_censored,
        pet_first: i64::from(encroachment.pet_first),
    };
    let extremes = extremes(&series, &there, encroachment.et, encroachment.pet);
    Judged { series, in_the_way: in_the_way_only, extremes, exposure }
}

/// The measures of `Measure::FOLLOWING`, in their order.
fn measured(found: &Following, deceleration: f64, settings: &Settings) -> [(Measure, Decisive); 7] {
    let Following { hw, thw, ttc, a_long_req, a_lat_req } = *found;
    let times = |value: Decisive, factor: f64| Decisive { value: value.value.abs() * factor, ..value };
    let (btn, stn) = (times(a_long_req, 1.0 / deceleration), times(a_lat_req, 1.0 / settings.lateral_acceleration));
    let values = [hw, thw, ttc, a_long_req, btn, a_lat_req, stn];
    std::array::from_fn(|i| (Measure::FOLLOWING[i], values[i]))
}

/// The most critical value of every measure with its column. Encroachment comes as it is, the running sums and the
/// closest encounter from the first state, the time to it from the moment of the smallest time to collision.
fn extremes(series: &[Vec<Decisive>], there: &[bool], et: Decisive, pet: Decisive) -> Vec<(Decisive, usize)> {
    let first = there.iter().position(|there| *there).expect("judged participants are there");
    let extreme = |measure: Measure| {
        let values = &series[measure as usize];
        let mut best: Option<usize> = None;
        for column in (first..values.len()).filter(|column| there[*column] && !values[*column].value.is_nan()) {
            let better = |than: usize| {
                if measure.grows() {
                    values[column].value > values[than].value
                } else {
                    values[column].value < values[than].value
                }
            };
            if best.is_none_or(better) {
                best = Some(column);
            }
        }
        let column = best.unwrap_or(first);
        (values[column], column)
    };
    // The column at which an encroachment value is said for the last time: when it is decided.
    let decided = |measure: Measure, value: Decisive| {
        let same = |one: &Decisive| {
            one.value.is_finite() && one.partner == value.partner && one.via == value.via && one.value == value.value
        };
        let column = series[measure as usize].iter().rposition(same).unwrap_or(first);
        (value, column)
    };
    Measure::ALL
        .iter()
        .map(|(measure, _)| match measure {
            Measure::Et => decided(Measure::Et, et),
            Measure::Pet => decided(Measure::Pet, pet),
            Measure::Tet | Measure::Tit => (series[*measure as usize][first], first),
            Measure::Dce => {
                // The distance is known long before: the moment is that of the encounter.
                let (dce, column) = extreme(Measure::Dce);
                let meets = |at: &usize| {
                    series[Measure::Dce as usize][*at].value == dce.value
                        && series[Measure::Ttce as usize][*at].value == 0.0
                };
                (dce, (column..there.len()).find(meets).unwrap_or(column))
            }
            Measure::Ttce => {
                let (ttc, column) = extreme(Measure::Ttc);
                let column = if ttc.value.is_finite() { column } else { first };
                (series[Measure::Ttce as usize][column], column)
            }
            _ => extreme(*measure),
        })
        .collect()
}
