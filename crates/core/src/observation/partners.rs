//! The nearest participants that an observer sees, and their predictions.

use super::layout::{PARTNER, PREDICTION, factors};
use super::{Frame, ObservedBody, Observer, Writer, flag};
use crate::geometry::Point;

/// Scales of the numbers of a participant, and of its prediction.
const FACTORS: [f64; 14] = factors(PARTNER);
const EXPECTED: [f64; 10] = factors(PREDICTION);
/// Times ahead at which expected positions are observed [s].
const SECONDS: [f64; 3] = [1.0, 2.0, 3.0];

/// Squared distance [m²], id and place among the bodies: the nearest first.
pub(super) type Nearest = Vec<(f64, i64, usize)>;

/// Finds the `n` nearest of those seen, the smaller id first among equals.
#[inline(always)]
pub(super) fn nearest(frame: &Frame, bodies: &[ObservedBody], seen: &[usize], n: usize, nearest: &mut Nearest) {
    nearest.clear();
    if n == 0 {
        return;
    }
    for &place in seen {
        let body = &bodies[place];
        let key = ((body.position - frame.origin).norm_squared(), body.id, place);
        let is_nearer = |a: &(f64, i64, usize)| (a.0, a.1) > (key.0, key.1);
        if nearest.len() == n {
            if !is_nearer(&nearest[n - 1]) {
                continue;
            }
            nearest.pop();
        }
        let mut at = nearest.len();
        nearest.push(key);
        while at > 0 && is_nearer(&nearest[at - 1]) {
            nearest[at] = nearest[at - 1];
            at -= 1;
        }
        nearest[at] = key;
    }
}

/// Writes the block of participants.
#[inline(always)]
pub(super) fn write(
    observer: &Observer<'_>,
    frame: &Frame,
    bodies: &[ObservedBody],
    n: usize,
    nearest: &Nearest,
    out: &mut Writer<'_>,
) {
    let own = frame.axis * observer.state.velocity;
    for &(.., place) in nearest {
        let body = &bodies[place];
        let center = frame.place(body.position);
        let velocity = frame.turn(body.axis * body.velocity - own);
        let (sin, cos) = (frame.axis.cross(body.axis), frame.axis.dot(body.axis));
        let (length, width) = body.size;
        let [vehicle, two_wheeler, pedestrian, other] = std::array::from_fn(|class| flag(class == body.class));
        let values = [
            1.0,
            center.x,
            center.y,
            sin,
            cos,
            body.velocity,
            velocity.x,
            velocity.y,
            length,
            width,
            vehicle,
            two_wheeler,
            pedestrian,
            other,
        ];
        out.row(values, &FACTORS);
    }
    out.zeros((n - nearest.len()) * FACTORS.len());
}

/// Writes the block of predictions; zero where there is none.
pub(super) fn write_predictions(
    observer: &Observer<'_>,
    frame: &Frame,
    bodies: &[ObservedBody],
    n: usize,
    nearest: &Nearest,
    out: &mut Writer<'_>,
) {
    let (Some(predictions), false) = (observer.predictions, n == 0) else { return out.zeros(n * EXPECTED.len()) };
    for &(.., place) in nearest {
        let Some(row) = bodies[place].predicted else {
            out.zeros(EXPECTED.len());
            continue;
        };
        let probability = &predictions.probability[row * predictions.n_modes..(row + 1) * predictions.n_modes];
        // The first one of equals.
        let mode = (0..probability.len()).fold(0, |best, i| if probability[i] > probability[best] { i } else { best });
        let mut values = [0.0; EXPECTED.len()];
        values[0] = probability[mode];
        for (seconds, values) in SECONDS.iter().zip(values[1..].chunks_exact_mut(3)) {
            let step = (seconds / observer.dt).round() as usize;
            let at = predictions.offset(row, mode) + step.saturating_sub(1);
            if step == 0 || step > predictions.n_steps || !predictions.valid[at] {
                continue;
            }
            let place = frame.place(Point::new(predictions.x[at], predictions.y[at]));
            let variance = 0.5 * (predictions.covariance_xx[at] + predictions.covariance_yy[at]);
            values.copy_from_slice(&[place.x, place.y, variance.sqrt()]);
        }
        out.row(values, &EXPECTED);
    }
    out.zeros((n - nearest.len()) * EXPECTED.len());
}
