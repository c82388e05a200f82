//! What scores are made of: times to contact, blame, positions along paths.

use std::sync::Arc;

use interdrive_core::collision::leaves_road as core_leaves_road;
use interdrive_core::criticality::approach::approach;
use interdrive_core::criticality::blame::{BlameRequest, Reaction, blame};
use interdrive_core::criticality::preventability::{Conflict, Preventability, Replacement, preventability};
use interdrive_core::criticality::starting::{
    Start, StartConflict, StartLimits, start_conflict as core_start_conflict,
};
use interdrive_core::criticality::straight::{StraightRequest, straight_times};
use interdrive_core::criticality::{Traffic, crossing_lanelets as core_crossing_lanelets};
use interdrive_core::error::Error;
use interdrive_core::geometry::polyline::{Polyline, Projection};
use interdrive_core::geometry::{Point, Pose};
use interdrive_core::reference_drivers::Driver;
use interdrive_core::road::RoadNetwork;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Row};
use crate::errors::{InputError, detached, exception};
use crate::scenario::{PyParticipants, PyRoadNetwork, PyShape};
use crate::vehicle::PyVehicle;

/// A path is followed from one position to the next within this distance [m].
const WINDOW: f64 = 20.0;
/// Farther away from the path than this [m], all of it is searched.
const LOST: f64 = 5.0;
/// Feet whose distances differ by less are those of the same place, to which the path comes again [m].
const AGAIN: f64 = 1.0;

#[pyclass(frozen, name = "Traffic", module = "interdrive._core")]
pub struct PyTraffic {
    traffic: Traffic,
    road: Arc<RoadNetwork>,
    crossing: Vec<bool>,
}

#[pymethods]
impl PyTraffic {
    /// Recorded or simulated participants on their road; `crossing` are the lanelets that cross others.
    #[new]
    fn new(
        py: Python<'_>,
        dt: f64,
        road: &PyRoadNetwork,
        participants: &PyParticipants,
        crossing: Vec<i64>,
    ) -> PyResult<Self> {
        let PyParticipants { states, shapes, is_static } = participants;
        let network = Arc::clone(&road.0);
        let mut crosses = vec![false; network.lanelets().len()];
        for id in crossing {
            let lanelet = network.index_of(id).ok_or(Error::UnknownId { what: "lanelet", id }).map_err(exception)?;
            crosses[lanelet] = true;
        }
        let traffic = detached(py, || Traffic::new(dt, network, states.clone(), shapes.clone(), is_static.clone()))?;
        Ok(Self { traffic, road: Arc::clone(&road.0), crossing: crosses })
    }

    /// Time until each judged participant touches another one if both keep speed and heading [s], and that one's id:
    /// arrays of shape (judged, time steps); inf and -1 without a contact within the horizon, nan where absent.
    fn straight_times<'py>(
        &self,
        py: Python<'py>,
        judged: Vec<i64>,
        rear_axle_to_center: Vec<f64>,
        horizon: f64,
        threads: usize,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        if judged.len() != rear_axle_to_center.len() {
            return Err(InputError::new_err(format!(
                "{} distances of rear axles for {} participants",
                rear_axle_to_center.len(),
                judged.len()
            )));
        }
        let row = |id: i64| self.traffic.row(id).ok_or(Error::UnknownId { what: "participant", id });
        let rows: Vec<usize> = judged.iter().map(|id| row(*id)).collect::<Result<_, _>>().map_err(exception)?;
        let n = rows.len();
        let judged = rows.into_iter().zip(rear_axle_to_center).collect();
        let request = StraightRequest { judged, crossing: self.crossing.clone(), horizon, threads };
        let found = py.detach(|| straight_times(&self.traffic, &request));
        let shape = [n, found.len() / n.max(1)];
        Ok((
            arrays::grid(py, found.iter().map(|one| one.time).collect(), shape)?,
            arrays::grid(py, found.iter().map(|one| one.partner).collect(), shape)?,
        ))
    }

    /// How near a participant comes to others: smallest distance of centres less half of both lengths [m] (inf: nobody is
    /// there at the same time), and fewest time steps, up to a number, between it and another one within half of both
    /// widths of the same place (None: more). Lengths and widths are those of all participants [m].
    fn approach(
        &self,
        id: i64,
        lengths: PyReadonlyArray1<'_, f64>,
        widths: PyReadonlyArray1<'_, f64>,
        steps_most: usize,
    ) -> PyResult<(f64, Option<usize>)> {
        let row = self.traffic.row(id).ok_or(Error::UnknownId { what: "participant", id }).map_err(exception)?;
        let n = self.traffic.len();
        let lengths = arrays::read_row("lengths", &lengths, n)?;
        let sizes: Vec<_> = lengths.into_iter().zip(arrays::read_row("widths", &widths, n)?).collect();
        let found = approach(&self.traffic, row, &sizes, steps_most);
        Ok((found.distance, found.steps_between))
    }

    /// Verdicts on contacts (agent, partner, time step of the first states after it, whether the partner drives on
    /// lanes), as a dict of arrays in their order. A reaction is a delay [s] and a deceleration [m/s²].
    fn blame<'py>(
        &self,
        py: Python<'py>,
        contacts: Vec<(i64, i64, i64, bool)>,
        agent: (f64, f64),
        others: (f64, f64),
    ) -> PyResult<Bound<'py, PyDict>> {
        let reaction = |(delay, deceleration)| Reaction { delay, deceleration };
        let request = BlameRequest {
            contacts,
            agent: reaction(agent),
            others: reaction(others),
            crossing: self.crossing.clone(),
        };
        let found = detached(py, || blame(&self.traffic, &request))?;
        let dict = PyDict::new(py);
        dict.set_item("kind", found.iter().map(|v| v.kind.name()).collect::<Vec<_>>())?;
        dict.set_item("gap", arrays::row(py, found.iter().map(|v| v.gap).collect()))?;
        dict.set_item("needed", arrays::row(py, found.iter().map(|v| v.needed).collect()))?;
        dict.set_item("decided_at", arrays::row(py, found.iter().map(|v| v.decided_at).collect()))?;
        dict.set_item("instant", arrays::row(py, found.iter().map(|v| v.instant).collect()))?;
        dict.set_item("angle", arrays::row(py, found.iter().map(|v| v.angle).collect()))?;
        let sides = ["front", "left", "right", "rear"];
        dict.set_item("side", found.iter().map(|v| sides[v.side]).collect::<Vec<_>>())?;
        dict.set_item("collision_type", found.iter().map(|v| v.collision_type.name()).collect::<Vec<_>>())?;
        dict.set_item("fault_nuplan", arrays::row(py, found.iter().map(|v| v.fault_nuplan).collect()))?;
        dict.set_item("is_crossing", arrays::row(py, found.iter().map(|v| v.is_crossing).collect()))?;
        Ok(dict)
    }

    /// What reference drivers would have avoided: for conflicts (agent, partner, time step of the first states after the
    /// contact or of the near miss, whether it is a contact, whether the partner is a pedestrian) a dict of arrays in their
    /// order; those of drivers have shape (conflicts, drivers).
    fn preventability<'py>(
        &self,
        py: Python<'py>,
        conflicts: Vec<(i64, i64, i64, bool, bool)>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let conflict = |(agent, partner, time_step, is_contact, is_pedestrian)| Conflict {
            agent,
            partner,
            time_step,
            is_contact,
            is_pedestrian,
        };
        let conflicts: Vec<Conflict> = conflicts.into_iter().map(conflict).collect();
        let found = detached(py, || preventability(&self.traffic, &conflicts))?;
        let dict = PyDict::new(py);
        dict.set_item("undefined", found.iter().map(|one| one.undefined.name()).collect::<Vec<_>>())?;
        dict.set_item("entry", found.iter().map(|one| one.entry.name()).collect::<Vec<_>>())?;
        dict.set_item("from_time_step", arrays::row(py, found.iter().map(|one| one.from).collect()))?;
        dict.set_item("velocity", arrays::row(py, found.iter().map(|one| one.velocity).collect()))?;
        dict.set_item("time", arrays::row(py, found.iter().map(|one| one.time).collect()))?;
        let shape = [found.len(), Driver::ALL.len()];
        let grid = |value: fn(&Replacement) -> f64| {
            let of = |one: &Preventability, driver: usize| one.replacements.get(driver).map_or(f64::NAN, value);
            let values = found.iter().flat_map(|one| (0..Driver::ALL.len()).map(move |driver| of(one, driver)));
            arrays::grid(py, values.collect(), shape)
        };
        dict.set_item("preventable", grid(|one| f64::from(u8::from(one.avoids)))?)?;
        dict.set_item("impact_speed", grid(|one| one.impact_speed)?)?;
        dict.set_item("distance", grid(|one| one.distance)?)?;
        let witnesses = PyDict::new(py);
        for (place, driver) in Driver::ALL.into_iter().enumerate() {
            let made: Vec<Bound<'py, PyDict>> =
                found.iter().map(|one| witness(py, one.step, one.replacements.get(place))).collect::<PyResult<_>>()?;
            witnesses.set_item(driver.name(), made)?;
        }
        dict.set_item("witness", witnesses)?;
        Ok(dict)
    }

    /// Whether points are on a lanelet that crosses others.
    fn is_on_crossing<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'_, f64>,
        y: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Row<'py, bool>> {
        let n = x.as_array().len();
        let (x, y) = (arrays::read_row("x", &x, n)?, arrays::read_row("y", &y, n)?);
        let crosses =
            |i: usize| self.road.lanelets_at(Point::new(x[i], y[i])).iter().any(|lanelet| self.crossing[*lanelet]);
        Ok(arrays::row(py, (0..n).map(crosses).collect()))
    }
}

/// The drive of a reference driver as a dict of arrays, empty without one.
fn witness<'py>(py: Python<'py>, step: f64, drive: Option<&Replacement>) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let poses = drive.map_or(&[][..], |one| &one.poses);
    dict.set_item("step", step)?;
    dict.set_item("x", arrays::row(py, poses.iter().map(|pose| pose.position.x).collect()))?;
    dict.set_item("y", arrays::row(py, poses.iter().map(|pose| pose.position.y).collect()))?;
    dict.set_item("orientation", arrays::row(py, poses.iter().map(|pose| pose.orientation).collect()))?;
    dict.set_item("velocity", arrays::row(py, drive.map_or(Vec::new(), |one| one.velocity.clone())))?;
    Ok(dict)
}

/// Ids of the lanelets that cross or join others that do not come from the same one.
#[pyfunction]
pub fn crossing_lanelets(py: Python<'_>, road: &PyRoadNetwork, erosion: f64, overlap_min: f64) -> Vec<i64> {
    let road = Arc::clone(&road.0);
    let found = py.detach(|| core_crossing_lanelets(&road, erosion, overlap_min));
    road.lanelets().iter().zip(found).filter_map(|(lanelet, crosses)| crosses.then_some(lanelet.id)).collect()
}

/// The foot of a point on a path that may lead by it more than once: the first of those that are about as near as any.
fn first_foot(path: &Polyline, point: Point) -> Projection {
    let nearest = path.project(point);
    let mut from = 0.0;
    while from < nearest.s {
        let found = path.project_between(point, from, from + WINDOW);
        if found.distance <= nearest.distance + AGAIN {
            return path.project_between(point, found.s - WINDOW, found.s + WINDOW);
        }
        from += WINDOW;
    }
    nearest
}

/// Arc length [m] and signed lateral distance [m] of consecutive positions on a path of shape (points, 2).
#[pyfunction]
pub fn follow_path<'py>(
    py: Python<'py>,
    path: PyReadonlyArray2<'_, f64>,
    x: PyReadonlyArray1<'_, f64>,
    y: PyReadonlyArray1<'_, f64>,
) -> PyResult<(Row<'py, f64>, Row<'py, f64>)> {
    let path = Polyline::new(&arrays::read_points("path", &path)?).map_err(exception)?;
    let n = x.as_array().len();
    let (x, y) = (arrays::read_row("x", &x, n)?, arrays::read_row("y", &y, n)?);
    let mut last: Option<f64> = None;
    let mut foot = |i: usize| {
        let point = Point::new(x[i], y[i]);
        let found = match last.map(|s| path.project_between(point, s - WINDOW, s + WINDOW)) {
            None => first_foot(&path, point),
            Some(near) if near.distance <= LOST => near,
            Some(_) => path.project(point),
        };
        last = Some(found.s);
        (found.s, found.d)
    };
    let (s, d) = (0..n).map(&mut foot).unzip();
    Ok((arrays::row(py, s), arrays::row(py, d)))
}

/// Whether a vehicle that follows poses leaves the road after having been on it.
#[pyfunction]
pub fn leaves_road(
    road: &PyRoadNetwork,
    shape: &PyShape,
    vehicle: &PyVehicle,
    x: PyReadonlyArray1<'_, f64>,
    y: PyReadonlyArray1<'_, f64>,
    orientation: PyReadonlyArray1<'_, f64>,
) -> PyResult<bool> {
    let n = x.as_array().len();
    let (x, y) = (arrays::read_row("x", &x, n)?, arrays::read_row("y", &y, n)?);
    let theta = arrays::read_row("orientation", &orientation, n)?;
    let poses: Vec<Pose> = (0..n).map(|i| Pose::new(x[i], y[i], theta[i])).collect();
    Ok(core_leaves_road(&road.0, &shape.0, &vehicle.0, &poses))
}

/// The first conflict of vehicles at their starts that is not in the recording: both rows, "overlap", "braking" or
/// "inevitable", and how hard the follower has to brake [m/s²]; None without one. Starts and recorded ones have a row
/// (x, y, orientation, velocity) for each vehicle, sizes its length and width [m].
#[pyfunction]
pub fn start_conflict(
    recorded: PyReadonlyArray2<'_, f64>,
    starts: PyReadonlyArray2<'_, f64>,
    sizes: PyReadonlyArray2<'_, f64>,
    rows: Vec<usize>,
    limits: (f64, f64, f64, Vec<f64>),
) -> PyResult<Option<(usize, usize, &'static str, f64)>> {
    let sizes = arrays::read_points("sizes", &sizes)?;
    let read = |name: &str, table: &PyReadonlyArray2<'_, f64>| {
        let values = table.as_array();
        if values.shape() != [sizes.len(), 4] {
            let message = format!("{name}: shape {:?} given, ({}, 4) expected", values.shape(), sizes.len());
            return Err(InputError::new_err(message));
        }
        let start = |(at, size): (numpy::ndarray::ArrayView1<'_, f64>, &Point)| Start {
            position: Point::new(at[0], at[1]),
            orientation: at[2],
            velocity: at[3],
            size: (size.x, size.y),
        };
        Ok(values.outer_iter().zip(&sizes).map(start).collect::<Vec<_>>())
    };
    let (recorded, starts) = (read("recorded", &recorded)?, read("starts", &starts)?);
    if let Some(row) = rows.iter().find(|row| **row >= starts.len()) {
        return Err(InputError::new_err(format!("rows: there is no row {row}")));
    }
    let (reach, lane, braking, times) = limits;
    let found = core_start_conflict(&recorded, &starts, &rows, &StartLimits { reach, lane, braking, times });
    Ok(found.map(|(row, other, why)| match why {
        StartConflict::Overlap => (row, other, "overlap", 0.0),
        StartConflict::Braking(needed) => (row, other, "braking", needed),
        StartConflict::Inevitable => (row, other, "inevitable", 0.0),
    }))
}

/// Adds the contents of this file to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyTraffic>()?;
    module.add_function(wrap_pyfunction!(crossing_lanelets, module)?)?;
    module.add_function(wrap_pyfunction!(start_conflict, module)?)?;
    module.add_function(wrap_pyfunction!(follow_path, module)?)?;
    module.add_function(wrap_pyfunction!(leaves_road, module)?)
}
