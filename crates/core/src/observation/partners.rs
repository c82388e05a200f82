//! The nearest participants that an observer sees, and their predictions.

use super::{Frame, ObservedBody, Observer, Writer};
use crate::geometry::Point;

/// Numbers of a participant, and of its prediction.
const COLUMNS: usize = super::layout::PARTNER.len();
const EXPECTED: usize = super::layout::PREDICTION.len();
/// Times ahead at which expected positions are observed [s].
const SECONDS: [f64; 3] = [1.0, 2.0, 3.0];

/// Squared distance [m²], id and place among those seen: the nearest first.
pub(super) type Nearest = Vec<(f64, i64, usize)>;

/// Finds the `n` nearest, the smaller id first among equals.
pub(super) fn nearest<'a>(
    frame: &Frame,
    seen: impl Iterator<Item = &'a ObservedBody>,
    n: usize,
    nearest: &mut Nearest,
) {
    nearest.clear();
    if n == 0 {
        return;
    }
    for (place, body) in seen.enumerate() {
        let key = ((body.position - frame.origin).norm_squared(), body.id, place);
        let is_nearer = |a: &(f64, i64, usize)| (a.0, a.1) > (key.0, key.1);
        if nearest.len() == n {
            if !is_nearer(&nearest[n - 1]) {
                continue;
            }
            nearest.pop();
        }
        let mut at = nearest.len();
        while at > 0 && is_nearer(&nearest[at - 1]) {
            at -= 1;
        }
        nearest.insert(at, key);
    }
}

/// Calls `write` for all that are among the nearest, at the beginning of their rows.
fn for_each<'a>(
    seen: impl Iterator<Item = &'a ObservedBody>,
    nearest: &Nearest,
    (n, columns): (usize, usize),
    out: &mut Writer<'_>,
    mut write: impl FnMut(&ObservedBody, &mut Writer<'_>),
) {
    let start = out.next;
    out.zeros(n * columns);
    for (place, body) in seen.enumerate() {
        let Some(rank) = nearest.iter().position(|key| key.2 == place) else { continue };
        out.next = start + rank * columns;
        write(body, out);
    }
    out.next = start + n * columns;
}

/// Writes the block of participants.
pub(super) fn write<'a>(
    observer: &Observer<'_>,
    frame: &Frame,
    seen: impl Iterator<Item = &'a ObservedBody>,
    n: usize,
    nearest: &Nearest,
    out: &mut Writer<'_>,
) {
    let own = frame.axis * observer.state.velocity;
    for_each(seen, nearest, (n, COLUMNS), out, |body, out| {
        let center = frame.place(body.position);
        let velocity = frame.turn(body.axis * body.velocity - own);
        out.flag(true);
        out.put(center.x, 80.0);
        out.put(center.y, 80.0);
        out.turn(frame.axis, body.axis);
        out.put(body.velocity, 40.0);
        out.put(velocity.x, 40.0);
        out.put(velocity.y, 40.0);
        out.put(body.size.0, 20.0);
        out.put(body.size.1, 4.0);
        for class in 0..4 {
            out.flag(class == body.class);
        }
    });
}

/// Writes the block of predictions; zero where there is none.
pub(super) fn write_predictions<'a>(
    observer: &Observer<'_>,
    frame: &Frame,
    seen: impl Iterator<Item = &'a ObservedBody>,
    n: usize,
    nearest: &Nearest,
    out: &mut Writer<'_>,
) {
    let Some(predictions) = observer.predictions else { return out.zeros(n * EXPECTED) };
    if n == 0 {
        return;
    }
    for_each(seen, nearest, (n, EXPECTED), out, |body, out| {
        let Some(row) = body.predicted else { return };
        let probability = &predictions.probability[row * predictions.n_modes..(row + 1) * predictions.n_modes];
        // The first one of equals.
        let mode = (0..probability.len()).fold(0, |best, i| if probability[i] > probability[best] { i } else { best });
        out.put(probability[mode], 1.0);
        for seconds in SECONDS {
            let step = (seconds / observer.dt).round() as usize;
            let at = predictions.offset(row, mode) + step.saturating_sub(1);
            if step == 0 || step > predictions.n_steps || !predictions.valid[at] {
                out.zeros(3);
                continue;
            }
            let place = frame.place(Point::new(predictions.x[at], predictions.y[at]));
            let variance = 0.5 * (predictions.covariance_xx[at] + predictions.covariance_yy[at]);
            out.put(place.x, 80.0);
            out.put(place.y, 80.0);
            out.put(variance.sqrt(), 10.0);
        }
    });
}
