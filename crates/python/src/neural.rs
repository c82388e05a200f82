//! What the neural predictor is told and asked, as arrays for training.

use std::collections::BTreeMap;
use std::sync::Arc;

use interdrive_core::geometry::Point;
use interdrive_core::predict::neural::{
    Feature, Inputs, KNOT_TIME, LEFT, MIRRORED_COLUMNS, MODE_OUTPUTS, N_AGENT, N_KNOTS, N_NEIGHBOUR, N_NEIGHBOURS,
    N_PATH, N_PATHS, Network, RIGHT, SLOTS, Tensor, VERSION, agent_features, neighbour_features, path_features,
};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Grid, Row};
use crate::errors::{InputError, exception};
use crate::getters::getters;
use crate::scene::PyScene;

/// Input of the neural predictor for the vehicles of a scene, one row each, ascending ids.
#[pyclass(frozen, name = "NeuralInputs", module = "interdrive._core")]
pub struct PyNeuralInputs {
    inputs: Inputs,
    ids: Vec<i64>,
}

impl PyNeuralInputs {
    fn n(&self) -> usize {
        self.ids.len()
    }

    /// One number per path, NaN where a slot is empty.
    fn per_path<'py>(&self, py: Python<'py>, value: impl Fn(usize, usize) -> Option<f64>) -> Grid<'py> {
        let flat = (0..self.n() * N_PATHS)
            .map(|k| value(k / N_PATHS, k % N_PATHS).unwrap_or(f64::NAN) as f32)
            .collect::<Vec<f32>>();
        arrays::grid(py, flat, [self.n(), N_PATHS])
    }
}

#[pymethods]
impl PyNeuralInputs {
    #[new]
    fn new(py: Python<'_>, scene: &PyScene) -> Self {
        let (scene, road) = (&*scene.scene, &*scene.road);
        let inputs = py.detach(|| Inputs::of(scene, road));
        let ids = inputs.rows.iter().map(|row| scene.participants.ids[*row]).collect();
        Self { inputs, ids }
    }

    fn targets<'py>(&self, py: Python<'py>, future: PyReadonlyArrayDyn<'_, f64>) -> Grid<'py> {
        let future = arrays::read_grid("future", &future, &[self.n(), N_KNOTS, 2])?;
        let inputs = &self.inputs;
        let flat: Vec<f32> = py.detach(|| {
            let per_row = future
                .chunks_exact(2 * N_KNOTS)
                .enumerate()
                .map(|(i, row)| inputs.targets(i, &std::array::from_fn(|k| Point::new(row[2 * k], row[2 * k + 1]))));
            per_row.flatten().flatten().flat_map(|(s, d)| [s as f32, d as f32]).collect()
        });
        arrays::grid(py, flat, [self.n(), N_PATHS, N_KNOTS, 2])
    }

    fn to_world<'py>(
        &self,
        py: Python<'py>,
        s: PyReadonlyArrayDyn<'_, f64>,
        d: PyReadonlyArrayDyn<'_, f64>,
    ) -> Grid<'py> {
        let shape = s.as_array().shape().to_vec();
        let [n, n_paths, n_points] = shape[..] else {
            return Err(InputError::new_err(format!("s has shape {shape:?}, (vehicles, paths, points) expected")));
        };
        if n != self.n() || n_paths != N_PATHS {
            return Err(InputError::new_err(format!(
                "s has shape {shape:?}, ({}, {N_PATHS}, points) expected",
                self.n()
            )));
        }
        let d = arrays::read_grid("d", &d, &shape)?;
        let mut flat = Vec::with_capacity(3 * d.len());
        for (k, (s, d)) in s.as_array().iter().zip(&d).enumerate() {
            let path = k / n_points;
            flat.extend(self.inputs.candidates[path / N_PATHS][path % N_PATHS].as_ref().map_or(
                [f64::NAN; 3],
                |path| {
                    let (position, heading) = path.world(*s, *d);
                    [position.x, position.y, heading]
                },
            ));
        }
        arrays::grid(py, flat, [n, N_PATHS, n_points, 3])
    }
}

getters! { PyNeuralInputs {
    ids: Row<'py, i64> = |this, py| arrays::row(py, this.ids.clone());
    agent: Grid<'py> = |this, py| arrays::grid(py, this.inputs.agent.clone(), [this.n(), N_AGENT]);
    neighbours: Grid<'py> = |this, py|
        arrays::grid(py, this.inputs.neighbours.clone(), [this.n(), N_NEIGHBOURS, N_NEIGHBOUR]);
    paths: Grid<'py> = |this, py| arrays::grid(py, this.inputs.paths.clone(), [this.n(), N_PATHS, N_PATH]);
    path_valid: Grid<'py> = |this, py| arrays::grid(py, this.inputs.path_valid(), [this.n(), N_PATHS]);
    standing: Row<'py, bool> = |this, py| arrays::row(py, this.inputs.standing.clone());
    velocity: Row<'py, f32> = |this, py| arrays::row(py, this.inputs.velocity.iter().map(|v| *v as f32).collect());
    offset: Grid<'py> = |this, py| this.per_path(py, |i, slot| Some(this.inputs.settling(i, slot)?.offset));
    slope: Grid<'py> = |this, py| this.per_path(py, |i, slot| Some(this.inputs.settling(i, slot)?.slope));
    settling: Grid<'py> = |this, py| this.per_path(py, |i, slot| Some(this.inputs.settling(i, slot)?.length));
} }

/// The network of the neural predictor.
#[pyclass(frozen, name = "NeuralNetwork", module = "interdrive._core")]
pub struct PyNeuralNetwork(pub Arc<Network>);

#[pymethods]
impl PyNeuralNetwork {
    #[new]
    fn new(tensors: BTreeMap<String, PyReadonlyArrayDyn<'_, f32>>) -> PyResult<Self> {
        let tensor = |(name, array): (String, PyReadonlyArrayDyn<'_, f32>)| {
            let array = array.as_array();
            Tensor { name, shape: array.shape().to_vec(), values: array.iter().copied().collect() }
        };
        let network = Network::new(tensors.into_iter().map(tensor).collect()).map_err(exception)?;
        Ok(Self(Arc::new(network)))
    }

    fn forward<'py>(
        &self,
        py: Python<'py>,
        agent: PyReadonlyArrayDyn<'_, f32>,
        neighbours: PyReadonlyArrayDyn<'_, f32>,
        paths: PyReadonlyArrayDyn<'_, f32>,
        path_valid: PyReadonlyArrayDyn<'_, bool>,
    ) -> Grid<'py> {
        let n = agent.as_array().shape().first().copied().unwrap_or(0);
        let agent = arrays::read_grid("agent", &agent, &[n, N_AGENT])?;
        let neighbours = arrays::read_grid("neighbours", &neighbours, &[n, N_NEIGHBOURS, N_NEIGHBOUR])?;
        let paths = arrays::read_grid("paths", &paths, &[n, N_PATHS, N_PATH])?;
        let path_valid = arrays::read_grid("path_valid", &path_valid, &[n, N_PATHS])?;
        let network = &self.0;
        let outputs = py.detach(|| network.forward(&agent, &neighbours, &paths, &path_valid));
        arrays::grid(py, outputs, [n, N_PATHS, network.n_modes, MODE_OUTPUTS])
    }
}

/// Meaning and order of everything in `NeuralInputs`.
fn description(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let described = |feature: &Feature| (feature.name.to_string(), feature.scale, feature.mirror);
    let permuted = |n: usize, (a, b): (usize, usize)| {
        let mut order: Vec<usize> = (0..n).collect();
        order.swap(a, b);
        order
    };
    let dict = PyDict::new(py);
    dict.set_item("version", VERSION)?;
    dict.set_item("knots", (1..=N_KNOTS).map(|k| k as f64 * KNOT_TIME).collect::<Vec<f64>>())?;
    let agent = agent_features().into_iter().map(|(name, feature)| (name, feature.scale, feature.mirror));
    dict.set_item("agent", agent.collect::<Vec<_>>())?;
    dict.set_item("neighbours", neighbour_features().iter().map(described).collect::<Vec<_>>())?;
    dict.set_item("paths", path_features().iter().map(described).collect::<Vec<_>>())?;
    dict.set_item("path_mirror_columns", permuted(N_PATH, MIRRORED_COLUMNS))?;
    dict.set_item("slots", SLOTS)?;
    dict.set_item("mirror_slots", permuted(N_PATHS, (LEFT, RIGHT)))?;
    Ok(dict)
}

/// Adds class and description to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("NEURAL", description(module.py())?)?;
    module.add_class::<PyNeuralInputs>()?;
    module.add_class::<PyNeuralNetwork>()
}
