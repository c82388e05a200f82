//! The picture of the road around a vehicle: lanelet borders drawn into 256 x 256 pixels.

use crate::geometry::{Aabb, Point, Pose};
use crate::road::RoadNetwork;

/// Pixels along a side.
pub(super) const SIDE: usize = 256;
/// Half the side of the window [m].
const REACH: f64 = 64.0;
/// Pixels per metre.
const RESOLUTION: f64 = 2.0;
/// Distance of the drawn points along a border [m].
const SPACING: f64 = 0.4;

/// What a pixel can show; 0 is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    Marking = 1,
    Edge = 2,
}

/// Grey values of codes 0, 1 and 2.
pub(super) const GREY: [f32; 3] = [0.0, 127.0, 255.0];

/// 256 x 256 codes, row-major; rows grow forward, columns to the right.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    codes: Vec<u8>,
    lit: Vec<u32>,
}

impl Default for Picture {
    fn default() -> Self {
        Self { codes: vec![0; SIDE * SIDE], lit: Vec::new() }
    }
}

impl Picture {
    pub(super) fn clear(&mut self) {
        for pixel in self.lit.drain(..) {
            self.codes[pixel as usize] = 0;
        }
    }

    /// From grey values 0, 127 and 255; `None` if there are others or not 256 x 256.
    pub(super) fn from_grey(grey: &[u8]) -> Option<Self> {
        let mut picture = Self::default();
        if grey.len() != SIDE * SIDE {
            return None;
        }
        for (pixel, value) in grey.iter().enumerate() {
            match value {
                0 => {}
                127 => picture.set(pixel / SIDE, pixel % SIDE, Ink::Marking),
                255 => picture.set(pixel / SIDE, pixel % SIDE, Ink::Edge),
                _ => return None,
            }
        }
        Some(picture)
    }

    pub(super) fn set(&mut self, row: usize, column: usize, ink: Ink) {
        let pixel = row * SIDE + column;
        if self.codes[pixel] == 0 {
            self.lit.push(pixel as u32);
        }
        self.codes[pixel] = ink as u8;
    }

    /// Codes of all pixels.
    pub(super) fn codes(&self) -> &[u8] {
        &self.codes
    }

    /// (row, column, code) of every pixel that is not empty, in the order in which they were first drawn.
    pub(super) fn lit(&self) -> impl Iterator<Item = (usize, usize, u8)> + '_ {
        self.lit.iter().map(|pixel| (*pixel as usize / SIDE, *pixel as usize % SIDE, self.codes[*pixel as usize]))
    }
}

/// A lanelet border.
#[derive(Debug, Clone)]
struct Border {
    vertices: Vec<Point>,
    ink: Ink,
    around: Aabb,
}

/// All lanelet borders of a map in drawing order: by lanelet, left then right.
#[derive(Debug, Clone)]
pub(super) struct Borders(Vec<Border>);

impl Borders {
    pub(super) fn of(road: &RoadNetwork) -> Self {
        let mut borders = Vec::with_capacity(2 * road.lanelets().len());
        for lanelet in road.lanelets() {
            for (vertices, neighbour) in
                [(&lanelet.left, lanelet.adjacent_left), (&lanelet.right, lanelet.adjacent_right)]
            {
                borders.push(Border {
                    around: Aabb::around(vertices.iter().copied()),
                    vertices: vertices.clone(),
                    ink: if neighbour.is_some() { Ink::Marking } else { Ink::Edge },
                });
            }
        }
        Self(borders)
    }

    /// Draws what lies in the window around a pose; later borders cover earlier ones. `scratch` may hold anything.
    pub(super) fn draw(&self, pose: Pose, picture: &mut Picture, scratch: &mut Tracing) {
        let here = Aabb { min: pose.position, max: pose.position }.grown(REACH * std::f64::consts::SQRT_2);
        let (sin, cos) = pose.orientation.sin_cos();
        let Tracing { local, is_inside, kept } = scratch;
        for border in self.0.iter().filter(|border| border.around.overlaps(&here)) {
            local.clear();
            local.extend(border.vertices.iter().map(|vertex| {
                let offset = *vertex - pose.position;
                Point::new(offset.x * sin - offset.y * cos, offset.x * cos + offset.y * sin)
            }));
            is_inside.clear();
            is_inside.extend(local.iter().map(|point| point.x.abs() <= REACH && point.y.abs() <= REACH));
            // A vertex outside counts if one beside it is inside.
            kept.clear();
            kept.extend((0..local.len()).filter_map(|i| {
                is_inside[i.saturating_sub(1)..(i + 2).min(local.len())].contains(&true).then_some(local[i])
            }));
            trace(kept, border.ink, picture);
        }
    }
}

/// Memory that drawing uses again and again.
#[derive(Debug, Clone, Default)]
pub(super) struct Tracing {
    local: Vec<Point>,
    is_inside: Vec<bool>,
    kept: Vec<Point>,
}

/// Draws points every 0.4 m along a line, from its first vertex on.
fn trace(line: &[Point], ink: Ink, picture: &mut Picture) {
    let (mut start, mut count) = (0.0, 0.0);
    let total: f64 = line.windows(2).fold(0.0, |sum, pair| sum + pair[0].distance(pair[1]));
    for pair in line.windows(2) {
        let length = pair[0].distance(pair[1]);
        let end = start + length;
        while count * SPACING < end.min(total) {
            let at = pair[0].lerp(pair[1], (count * SPACING - start) / length) * RESOLUTION;
            let (row, column) = (at.y + (SIDE / 2) as f64, at.x + (SIDE / 2) as f64);
            let inside = 0.0..SIDE as f64;
            if inside.contains(&row) && inside.contains(&column) {
                picture.set(row as usize, column as usize, ink);
            }
            count += 1.0;
        }
        start = end;
    }
}
