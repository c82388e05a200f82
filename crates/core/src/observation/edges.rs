//! The road edges around an observer.

use super::layout::{EDGE, factors};
use super::{Frame, Observer, Writer};
use crate::geometry::Aabb;

/// Scales of the numbers of a piece.
const FACTORS: [f64; 6] = factors(EDGE);
/// Pieces further away are not told [m].
const EDGE_REACH: f64 = 50.0;

/// Writes the block of road edges: the `n` nearest pieces, the one with the smaller number first among equals.
pub(super) fn write(
    observer: &Observer<'_>,
    frame: &Frame,
    n: usize,
    nearest: &mut Vec<(f64, usize)>,
    out: &mut Writer<'_>,
) {
    if n == 0 {
        return;
    }
    let eye = frame.origin;
    let pieces = observer.road.edge_pieces();
    nearest.clear();
    let mut most = EDGE_REACH * EDGE_REACH;
    pieces.visit_near(&Aabb { min: eye, max: eye }.grown(EDGE_REACH), |i, piece| {
        let key = ((piece.nearest(eye) - eye).norm_squared(), i);
        if key.0 > most || nearest.contains(&key) {
            return;
        }
        if nearest.len() == n {
            if nearest[n - 1] < key {
                return;
            }
            nearest.pop();
        }
        let at = nearest.partition_point(|other| *other < key);
        nearest.insert(at, key);
        if nearest.len() == n {
            most = nearest[n - 1].0;
        }
    });
    for (_, i) in &*nearest {
        let piece = &pieces.all()[*i];
        let along = piece.b - piece.a;
        let length = along.norm();
        let place = frame.place(piece.nearest(eye));
        let along = along * length.recip();
        let (sin, cos) = (frame.axis.cross(along), frame.axis.dot(along));
        out.row([1.0, place.x, place.y, sin, cos, 0.5 * length], &FACTORS);
    }
    out.zeros((n - nearest.len()) * FACTORS.len());
}
