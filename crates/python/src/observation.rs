//! The layout of observations.

use interdrive_core::observation::layout;
use pyo3::prelude::*;

use crate::settings::read;

/// Block, row, name, unit and scale of a number.
type Entry = (String, usize, String, String, String);

/// Every number of an observation in its order: block, row within it, name, unit and scale. `planner` names those of the
/// block that planners with weights add.
#[pyfunction]
#[pyo3(signature = (settings, planner=vec![]))]
pub fn observation_layout(settings: &Bound<'_, PyAny>, planner: Vec<String>) -> PyResult<Vec<Entry>> {
    let entries = layout::layout(&read(settings)?, &planner).into_iter();
    Ok(entries.map(|e| (e.block.into(), e.row, e.name, e.unit.into(), e.scale.to_string())).collect())
}

/// Name, rows (0: one vector) and columns of the blocks of an observation in their order.
#[pyfunction]
#[pyo3(signature = (settings, planner=vec![]))]
pub fn observation_blocks(settings: &Bound<'_, PyAny>, planner: Vec<String>) -> PyResult<Vec<(String, usize, usize)>> {
    let blocks = layout::blocks(&read(settings)?, &planner).into_iter();
    Ok(blocks.map(|block| (block.name.into(), block.rows.unwrap_or(0), block.columns)).collect())
}
