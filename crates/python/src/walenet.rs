//! The network WALENET: its weights as arrays, and its answers to inputs as its authors define them.

use std::sync::Arc;

use interdrive_core::error::Error;
use interdrive_core::geometry::Pose;
use interdrive_core::predict::Predictor;
use interdrive_core::predict::walenet::{
    Anchor, History, N_CELLS, N_HISTORY, N_OUTPUT, Network, Tensor, Walenet, WalenetSettings,
};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::errors::{InputError, detached};
use crate::predictor::PyPredictor;
use crate::scenario::{PyRoadNetwork, PyScenario};

/// Side of a picture.
const SIDE: usize = 256;

#[pyclass(frozen, name = "Walenet", module = "interdrive._core")]
pub struct PyWalenet(Arc<Network>);

#[pymethods]
impl PyWalenet {
    /// From float32 arrays by the names of the published checkpoint.
    #[new]
    fn new(py: Python<'_>, tensors: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut read = Vec::with_capacity(tensors.len());
        for (name, array) in tensors {
            let name: String = name.extract()?;
            let array: PyReadonlyArrayDyn<'_, f32> = array
                .extract()
                .map_err(|_| InputError::new_err(format!("weights of walenet: tensor {name} is no float32 array")))?;
            let array = array.as_array();
            read.push(Tensor { name, shape: array.shape().to_vec(), values: array.iter().copied().collect() });
        }
        detached(py, || Network::new(&read)).map(|network| Self(Arc::new(network)))
    }

    /// Answers, shape (n, 40, 5): mean right and forward [m], inverse standard deviations [1/m], correlation.
    ///
    /// `history` (n, 30, 2), `neighbours` (n, 39, 30, 2) [m], all zero where a cell is empty; `pictures` (n, 256, 256).
    fn answer<'py>(
        &self,
        py: Python<'py>,
        history: PyReadonlyArrayDyn<'_, f32>,
        neighbours: PyReadonlyArrayDyn<'_, f32>,
        pictures: PyReadonlyArrayDyn<'_, u8>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let n = pictures.as_array().shape().first().copied().unwrap_or_default();
        let histories = points(&arrays::read_grid("history", &history, &[n, N_HISTORY, 2])?);
        let neighbours = points(&arrays::read_grid("neighbours", &neighbours, &[n, N_CELLS, N_HISTORY, 2])?);
        let pictures = arrays::read_grid("pictures", &pictures, &[n, SIDE, SIDE])?;
        let answers = detached(py, || {
            let mut answers = Vec::with_capacity(n * N_OUTPUT * 5);
            for i in 0..n {
                let cells: Vec<(usize, History)> = (0..N_CELLS)
                    .map(|cell| (cell, neighbours[i * N_CELLS + cell]))
                    .filter(|(_, history)| history.iter().flatten().any(|value| *value != 0.0))
                    .collect();
                let picture = &pictures[i * SIDE * SIDE..(i + 1) * SIDE * SIDE];
                answers.extend(self.0.answer(&histories[i], &cells, picture)?.into_iter().flatten());
            }
            Ok::<_, Error>(answers)
        })?;
        arrays::grid(py, answers, [n, N_OUTPUT, 5])
    }

    /// The picture that it sees of a road from a pose, uint8, shape (256, 256): rows grow forward, columns to the right.
    #[staticmethod]
    fn picture<'py>(
        py: Python<'py>,
        road: &PyRoadNetwork,
        x: f64,
        y: f64,
        orientation: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        arrays::grid(py, Walenet::picture(&road.0, Pose::new(x, y, orientation)), [SIDE, SIDE])
    }

    /// The predictor for a scenario.
    fn predictor(
        &self,
        scenario: &PyScenario,
        anchor_is_next: bool,
        standing_guard: bool,
        backfill: bool,
    ) -> PyPredictor {
        let anchor = if anchor_is_next { Anchor::Next } else { Anchor::Now };
        let settings = WalenetSettings { anchor, standing_guard, backfill };
        let walenet = Walenet::new(Arc::clone(&self.0), settings, Arc::clone(&scenario.0.road));
        PyPredictor(Predictor::Walenet(Arc::new(walenet)))
    }
}

/// Histories from their numbers.
fn points(values: &[f32]) -> Vec<History> {
    values
        .chunks_exact(2 * N_HISTORY)
        .map(|history| std::array::from_fn(|step| [history[2 * step], history[2 * step + 1]]))
        .collect()
}
