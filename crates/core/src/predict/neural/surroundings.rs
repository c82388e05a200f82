//! The participants of a scene in a spatial grid.

use super::history::change_of_speed;
use crate::geometry::{Aabb, Point};
use crate::scene::Scene;
use crate::vehicle::ParticipantKind;

/// Size of a cell [m]; larger where the scene is.
const CELL: f64 = 25.0;
/// Most cells in a direction.
const CELLS_MAX: f64 = 256.0;

/// A participant that is present.
#[derive(Debug, Clone, Copy)]
pub struct PresentBody {
    /// Row of the participants.
    pub row: usize,
    /// Position [m], world frame.
    pub position: Point,
    /// Unit vector along the heading.
    pub axis: Point,
    /// Speed along the heading, as observed [m/s].
    pub velocity: f64,
    /// Change of this speed over the last half second [m/s]; 0: unknown.
    pub change: f64,
    /// Half the length of the footprint [m].
    pub half_length: f64,
    /// Half the width of the footprint [m].
    pub half_width: f64,
    /// Never moves.
    pub is_static: bool,
}

impl PresentBody {
    /// Half the extent of the footprint along a unit vector and across it [m].
    pub fn half_extent(&self, along: Point) -> (f64, f64) {
        let (cos, sin) = (self.axis.dot(along).abs(), self.axis.cross(along).abs());
        (self.half_length * cos + self.half_width * sin, self.half_length * sin + self.half_width * cos)
    }
}

/// All bodies of a scene; ascending rows in every cell. Walls and other structures are left out, and so are participants with
/// a state that is not a number.
#[derive(Debug, Clone)]
pub struct Surroundings {
    bodies: Vec<PresentBody>,
    min: Point,
    cell: f64,
    n_x: usize,
    n_y: usize,
    /// Bodies of cell `i` are `items[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Surroundings {
    /// Of a scene.
    pub fn of(scene: &Scene) -> Self {
        let participants = &scene.participants;
        let bodies: Vec<PresentBody> = scene
            .present
            .iter()
            .copied()
            .filter(|row| participants.kind[*row] != ParticipantKind::Structure && scene.state(*row).is_finite())
            .map(|row| {
                let (state, is_static) = (scene.state(row), participants.is_static[row]);
                let velocity = if is_static { 0.0 } else { scene.observed_velocity(row) };
                let (length, width) = participants.shape[row].extent();
                let change = if is_static { None } else { change_of_speed(scene, row, velocity) };
                PresentBody {
                    row,
                    position: state.pose().position,
                    axis: Point::from_angle(state.orientation),
                    velocity,
                    change: change.unwrap_or(0.0),
                    half_length: 0.5 * length,
                    half_width: 0.5 * width,
                    is_static,
                }
            })
            .collect();
        let around = Aabb::around(bodies.iter().map(|body| body.position));
        let size = if bodies.is_empty() { Point::default() } else { around.max - around.min };
        let cell = CELL.max(size.x.max(size.y) / CELLS_MAX);
        let (n_x, n_y) = ((size.x / cell) as usize + 1, (size.y / cell) as usize + 1);
        let mut surroundings =
            Self { bodies, min: around.min, cell, n_x, n_y, starts: vec![0; n_x * n_y + 1], items: Vec::new() };
        let cells: Vec<usize> = surroundings.bodies.iter().map(|body| surroundings.cell_of(body.position)).collect();
        for cell in &cells {
            surroundings.starts[cell + 1] += 1;
        }
        for i in 0..n_x * n_y {
            surroundings.starts[i + 1] += surroundings.starts[i];
        }
        let mut next = surroundings.starts.clone();
        surroundings.items = vec![0; cells.len()];
        for (i, cell) in cells.into_iter().enumerate() {
            surroundings.items[next[cell] as usize] = i as u32;
            next[cell] += 1;
        }
        surroundings
    }

    fn cell_of(&self, position: Point) -> usize {
        let index = |offset: f64, n: usize| ((offset / self.cell) as usize).min(n - 1);
        index(position.y - self.min.y, self.n_y) * self.n_x + index(position.x - self.min.x, self.n_x)
    }

    /// The body of a row.
    pub fn body(&self, row: usize) -> Option<&PresentBody> {
        self.bodies.binary_search_by_key(&row, |body| body.row).ok().map(|i| &self.bodies[i])
    }

    /// Visits all bodies in the cells that a square of half side `reach` [m] around a point touches.
    pub fn visit<'a>(&'a self, point: Point, reach: f64, mut visit: impl FnMut(&'a PresentBody)) {
        if self.bodies.is_empty() {
            return;
        }
        let range = |offset: f64, n: usize| {
            let index = |at: f64| ((at / self.cell).max(0.0) as usize).min(n - 1);
            index(offset - reach)..=index(offset + reach)
        };
        for j in range(point.y - self.min.y, self.n_y) {
            for i in range(point.x - self.min.x, self.n_x) {
                let cell = j * self.n_x + i;
                for item in &self.items[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
                    visit(&self.bodies[*item as usize]);
                }
            }
        }
    }
}
