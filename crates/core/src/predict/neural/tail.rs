//! The wide mode: errors of a prediction have heavier tails than the modes of the network say.

use super::network::Tail;
use crate::trajectory::Predictions;

/// Adds the wide mode behind the others, of which there are `n_modes`: the drive of the first one, with the second moments
/// of all of them around it, times the square of a factor. It is never more probable than the first one.
pub(super) fn add(tail: Tail, n_modes: usize, out: &mut Predictions, row: usize) {
    let n_steps = out.n_steps;
    let (first, wide) = (out.offset(row, 0), out.offset(row, n_modes));
    for step in 0..n_steps {
        (out.x[wide + step], out.y[wide + step]) = (out.x[first + step], out.y[first + step]);
        (out.orientation[wide + step], out.velocity[wide + step]) =
            (out.orientation[first + step], out.velocity[first + step]);
        out.valid[wide + step] = true;
        (out.covariance_xx[wide + step], out.covariance_xy[wide + step], out.covariance_yy[wide + step]) =
            (0.0, 0.0, 0.0);
    }
    for mode in 0..n_modes {
        let from = out.offset(row, mode);
        let weight = out.probability[row * out.n_modes + mode] * tail.factor * tail.factor;
        for step in 0..n_steps {
            let (x, y) = (out.x[from + step] - out.x[first + step], out.y[from + step] - out.y[first + step]);
            out.covariance_xx[wide + step] += weight * (out.covariance_xx[from + step] + x * x);
            out.covariance_xy[wide + step] += weight * (out.covariance_xy[from + step] + x * y);
            out.covariance_yy[wide + step] += weight * (out.covariance_yy[from + step] + y * y);
        }
    }
    let probability = &mut out.probability[row * out.n_modes..][..n_modes + 1];
    // With p / (1 + p) both are as probable.
    let share = tail.probability.min(probability[0] / (1.0 + probability[0]));
    probability.iter_mut().for_each(|p| *p *= 1.0 - share);
    probability[n_modes] = share.min(probability[0]);
}
