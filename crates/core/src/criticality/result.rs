//! What an evaluation finds: series, extremes and exposure, with partners and ways.

use super::evaluation_step::{Decisive, Via};
use super::measure::Measure;
use super::paths::PathSystems;
use super::traffic::Traffic;
use crate::road::RoadNetwork;

/// One measure of all judged participants; arrays of shape (judged, time steps), row-major.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Infinite: no conflict. NaN: absent, or cannot be computed.
    pub value: Vec<f64>,
    /// Id of the decisive participant; -1: none.
    pub partner: Vec<i64>,
    /// Index into [`Criticality::ways`]; -1: none.
    pub way: Vec<i64>,
}

/// The most critical value of a measure for one participant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// Value; NaN if it could not be computed at any time step.
    pub value: f64,
    /// First time step with that value; of the distance of the closest encounter the encounter itself, of the time to
    /// it the moment of the smallest time to collision (without any, the first state), of an encroachment time when it
    /// is entered, of a post-encroachment time when the first one has left.
    pub time_step: i64,
    /// Id; -1: none.
    pub partner: i64,
    /// Index into [`Criticality::ways`]; -1: none.
    pub way: i64,
}

/// A path (lanelets in driving order) or a conflict area (the own lanelet, the other one's), as lanelet ids.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LaneletPath {
    /// Lanelet ids.
    pub lanelets: Vec<i64>,
    /// The two lanelets cross.
    pub is_conflict_area: bool,
}

/// Results about one participant beyond the measures at each time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Time with a time to collision of at most the threshold [s].
    pub tet_seconds: f64,
    /// Integrated time to collision per time [s].
    pub tit_mean: f64,
    /// Share of the time steps before a conflict area at which it could not have stopped before it; NaN without any.
    pub psd_below_one: f64,
    /// The conflict area of the encroachment time was occupied from the first state on.
    pub et_left_censored: bool,
    /// Id of the participant that was first in the conflict area of the post-encroachment time; -1: none.
    pub pet_first: i64,
}

/// All measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Criticality {
    /// Ids of the judged participants, ascending.
    pub ids: Vec<i64>,
    /// Time step of the first column.
    pub first_time_step: i64,
    /// Number of columns.
    pub n_steps: usize,
    /// One per [`Measure`].
    pub series: Vec<Series>,
    /// One per entry of [`Measure::FOLLOWING`]: only participants in the way of the judged one count. Pairs are
    /// ranked by these.
    pub in_the_way: Vec<Series>,
    /// Per measure and judged participant.
    pub extremes: Vec<Vec<Extreme>>,
    /// Per judged participant.
    pub exposure: Vec<Exposure>,
    /// Paths and conflict areas that values refer to.
    pub ways: Vec<LaneletPath>,
}

/// One participant's part of the result.
pub(super) struct Judged {
    /// Per measure and column.
    pub(super) series: Vec<Vec<Decisive>>,
    /// Per entry of `Measure::FOLLOWING` and column.
    pub(super) in_the_way: Vec<Vec<Decisive>>,
    pub(super) extremes: Vec<(Decisive, usize)>,
    pub(super) exposure: Exposure,
}

/// The result from the parts of all evaluated participants: (row, deceleration) and their findings.
pub(super) fn assemble(
    traffic: &Traffic,
    paths: &PathSystems,
    judged: &[(usize, f64)],
    found: &[Judged],
) -> Criticality {
    let (n, n_measures) = (traffic.states.n_steps, Measure::ALL.len());
    let mut vias: Vec<Via> = found
        .iter()
        .flat_map(|one| {
            one.series.iter().chain(&one.in_the_way).flatten().chain(one.extremes.iter().map(|(value, _)| value))
        })
        .map(|value| value.via)
        .filter(|via| *via != Via::Nothing)
        .collect();
    vias.sort_unstable();
    vias.dedup();
    let ids = &traffic.states.ids;
    let id_of = |row: u32| ids.get(row as usize).copied().unwrap_or(-1);
    let way_of = |via: Via| vias.binary_search(&via).map_or(-1, |index| index as i64);
    let joined = |all: &mut dyn Iterator<Item = &Decisive>| {
        let mut series = Series::default();
        for one in all {
            series.value.push(one.value);
            series.partner.push(id_of(one.partner));
            series.way.push(way_of(one.via));
        }
        series
    };
    let series =
        (0..n_measures).map(|measure| joined(&mut found.iter().flat_map(|one| &one.series[measure]))).collect();
    let in_the_way = (0..Measure::FOLLOWING.len())
        .map(|measure| joined(&mut found.iter().flat_map(|one| &one.in_the_way[measure])))
        .collect();
    let extremes = (0..n_measures)
        .map(|measure| {
            let at = |one: &Judged| {
                let (value, column) = one.extremes[measure];
                Extreme {
                    value: value.value,
                    time_step: traffic.states.first_time_step + column as i64,
                    partner: id_of(value.partner),
                    way: way_of(value.via),
                }
            };
            found.iter().map(at).collect()
        })
        .collect();
    let exposure = found
        .iter()
        .map(|one| Exposure { pet_first: u32::try_from(one.exposure.pet_first).map_or(-1, id_of), ..one.exposure })
        .collect();
    Criticality {
        ids: judged.iter().map(|(row, _)| ids[*row]).collect(),
        first_time_step: traffic.states.first_time_step,
        n_steps: n,
        series,
        in_the_way,
        extremes,
        exposure,
        ways: vias.iter().map(|via| way(&traffic.road, paths, *via)).collect(),
    }
}

fn way(road: &RoadNetwork, paths: &PathSystems, via: Via) -> LaneletPath {
    let id = |lanelet: &u32| road.lanelets()[*lanelet as usize].id;
    match via {
        Via::Path(code) => {
            LaneletPath { lanelets: paths.lanelets(code).iter().map(id).collect(), is_conflict_area: false }
        }
        Via::ConflictArea(own, other) => LaneletPath { lanelets: vec![id(&own), id(&other)], is_conflict_area: true },
        Via::Nothing => LaneletPath { lanelets: Vec::new(), is_conflict_area: false },
    }
}
