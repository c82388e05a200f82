//! A picture of what an observer sees, from above: four layers of 96 x 96 pixels of 0.75 m, forward up, the observer's centre
//! in the middle of the pixel in row 72 and column 48. A pixel is 255 if its centre is inside, 0 otherwise.

use super::{Frame, ObservedBody, Observer};
use crate::geometry::Point;

/// Pixels per side.
pub const SIDE: usize = 96;
/// Pixels of a picture: drivable area; own path and goal; participants now; participants 0.5 s ago.
pub const PIXELS: usize = LAYERS * LAYER;
/// Their number.
pub const LAYERS: usize = 4;
const LAYER: usize = SIDE * SIDE;
/// Side of a pixel [m].
const PIXEL_SIZE: f64 = 0.75;
/// The observer's row and column.
const OBSERVER_ROW: f64 = 72.0;
const OBSERVER_COLUMN: f64 = 48.0;
/// Extent of the drawn path behind and ahead of the observer [m], and its step [m].
const PATH_BEHIND: f64 = 40.0;
const PATH_AHEAD: f64 = 80.0;
const PATH_STEP: f64 = 2.0;
const N_STEPS: usize = ((PATH_BEHIND + PATH_AHEAD) / PATH_STEP) as usize + 1;
/// What is on the border of an area is inside, whatever rounding does to it [pixels].
const BORDER_TOLERANCE: f64 = 1e-9;

/// Draws what an observer sees into `PIXELS` bytes. `seen` are those of the bodies that it sees.
pub fn draw(observer: &Observer<'_>, bodies: &[ObservedBody], seen: &[usize], out: &mut [u8]) {
    let state = observer.state;
    let frame = Frame { origin: Point::new(state.x, state.y), axis: Point::from_angle(state.orientation) };
    out.fill(0);
    let (roads, rest) = out.split_at_mut(LAYER);
    let (ways, rest) = rest.split_at_mut(LAYER);
    let (now, before) = rest.split_at_mut(LAYER);
    road(observer, &frame, roads);
    path(observer, &frame, &mut Layer(ways));
    goal(observer, &frame, &mut Layer(ways));
    for body in seen.iter().map(|place| &bodies[*place]) {
        rectangle(body.position, body.axis, body.size, &frame, &mut Layer(now));
        if let Some((position, axis)) = body.before {
            rectangle(position, axis, body.size, &frame, &mut Layer(before));
        }
    }
}

/// Column and row of a point of the observer's frame.
fn pixel(place: Point) -> Point {
    Point::new(OBSERVER_COLUMN - place.y / PIXEL_SIZE, OBSERVER_ROW - place.x / PIXEL_SIZE)
}

fn road(observer: &Observer<'_>, frame: &Frame, out: &mut [u8]) {
    let left = frame.axis.left();
    for (row, out) in out.chunks_exact_mut(SIDE).enumerate() {
        let first = frame.origin
            + frame.axis * ((OBSERVER_ROW - row as f64) * PIXEL_SIZE)
            + left * (OBSERVER_COLUMN * PIXEL_SIZE);
        observer.road.draw_drivable(first, left * -PIXEL_SIZE, out);
    }
}

/// The path, as wide as the observer.
fn path(observer: &Observer<'_>, frame: &Frame, out: &mut Layer<'_>) {
    let path = &observer.route.path;
    let q = observer.s + observer.vehicle.rear_axle_to_center;
    let arc_lengths: [f64; N_STEPS] =
        std::array::from_fn(|i| (q - PATH_BEHIND + i as f64 * PATH_STEP).clamp(0.0, path.length()));
    let mut fields = [[0.0; N_STEPS]; 7];
    path.write_at(&arc_lengths, fields.each_mut().map(|field| &mut field[..]));
    let [x, y, _, cos, sin, ..] = &fields;
    let side = |i: usize, offset: f64| {
        let normal = Point::new(cos[i], sin[i]).left();
        pixel(frame.place(Point::new(x[i], y[i]) + normal * offset))
    };
    let half = 0.5 * observer.vehicle.width;
    for i in 1..N_STEPS {
        if arc_lengths[i] > arc_lengths[i - 1] {
            out.fill(&[side(i - 1, -half), side(i, -half), side(i, half), side(i - 1, half)]);
        }
    }
}

fn goal(observer: &Observer<'_>, frame: &Frame, out: &mut Layer<'_>) {
    let Some(state) = observer.goal.states.get(observer.table.alternative) else { return };
    for area in state.areas.iter() {
        for part in area.shape.parts() {
            let corner = |vertex: &Point| pixel(frame.place(area.pose.world_from_body(*vertex)));
            if let [center] = part.vertices.as_slice() {
                out.fill_circle(corner(center), part.radius / PIXEL_SIZE);
            } else {
                out.fill_corners(|| part.vertices.iter().map(corner));
            }
        }
    }
}

fn rectangle(center: Point, axis: Point, (length, width): (f64, f64), frame: &Frame, out: &mut Layer<'_>) {
    let (along, beside) = (axis * (0.5 * length), axis.left() * (0.5 * width));
    let corners = [center + along + beside, center - along + beside, center - along - beside, center + along - beside];
    out.fill(&corners.map(|corner| pixel(frame.place(corner))));
}

/// One layer of a picture; x is the column, y the row.
struct Layer<'a>(&'a mut [u8]);

impl Layer<'_> {
    /// Sets the pixels of a row from one column to another, both included.
    fn set(&mut self, row: usize, from: f64, to: f64) {
        let from = (from - BORDER_TOLERANCE).ceil().max(0.0);
        let to = (to + BORDER_TOLERANCE).floor().min(SIDE as f64 - 1.0);
        if from <= to {
            self.0[row * SIDE + from as usize..=row * SIDE + to as usize].fill(255);
        }
    }

    /// Rows of pixels from one height to another, both included.
    fn rows(from: f64, to: f64) -> std::ops::Range<usize> {
        let from = (from - BORDER_TOLERANCE).ceil().max(0.0);
        let to = (to + BORDER_TOLERANCE).floor().min(SIDE as f64 - 1.0);
        if from <= to { from as usize..to as usize + 1 } else { 0..0 }
    }

    fn fill(&mut self, corners: &[Point]) {
        self.fill_corners(|| corners.iter().copied());
    }

    /// Sets the pixels inside of a convex polygon.
    fn fill_corners<I: Iterator<Item = Point>>(&mut self, corners: impl Fn() -> I) {
        let (low, high) = corners()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| (low.min(corner.y), high.max(corner.y)));
        for row in Self::rows(low, high) {
            let y = row as f64;
            let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
            for (a, b) in corners().zip(corners().skip(1).chain(corners().take(1))) {
                let (below, above) = (a.y.min(b.y), a.y.max(b.y));
                if y < below - BORDER_TOLERANCE || y > above + BORDER_TOLERANCE {
                    continue;
                }
                let height = b.y - a.y;
                let ends = if height.abs() < BORDER_TOLERANCE {
                    [a.x, b.x]
                } else {
                    [a.x + (b.x - a.x) * ((y - a.y) / height).clamp(0.0, 1.0); 2]
                };
                from = from.min(ends[0]).min(ends[1]);
                to = to.max(ends[0]).max(ends[1]);
            }
            self.set(row, from, to);
        }
    }

    fn fill_circle(&mut self, center: Point, radius: f64) {
        for row in Self::rows(center.y - radius, center.y + radius) {
            let height = row as f64 - center.y;
            let half = (radius * radius - height * height).max(0.0).sqrt();
            self.set(row, center.x - half, center.x + half);
        }
    }
}
