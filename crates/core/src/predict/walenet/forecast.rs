//! From the network's output to the table of predictions.

use super::STEP;
use super::network::{N_OUTPUT, Output};
use crate::geometry::{Point, Pose, wrap_angle};
use crate::predict::{STATIONARY_SPEED, write};
use crate::trajectory::Predictions;

/// Smallest and largest standard deviation [m] and largest correlation: numbers that a covariance can have.
const SIGMA: (f64, f64) = (1e-3, 1e3);
const CORRELATION_MAX: f64 = 0.999;
/// Beyond the output, the mean velocity of so many last steps is kept.
const LAST_STEPS: usize = 5;

/// Means and covariances in the vehicle's frame (x right, y forward).
struct Forecast {
    means: [Point; N_OUTPUT],
    /// (xx, xy, yy) [m²].
    covariances: [[f64; 3]; N_OUTPUT],
}

impl Forecast {
    fn of(output: &Output) -> Self {
        let covariance = |[_, _, inverse_x, inverse_y, correlation]: [f32; 5]| {
            let sigma = |inverse: f32| (1.0 / (f64::from(inverse) + f64::EPSILON)).clamp(SIGMA.0, SIGMA.1);
            let (x, y) = (sigma(inverse_x), sigma(inverse_y));
            let correlation = f64::from(correlation).clamp(-CORRELATION_MAX, CORRELATION_MAX);
            [x * x, correlation * x * y, y * y]
        };
        Self {
            means: output.map(|[x, y, ..]| Point::new(f64::from(x), f64::from(y))),
            covariances: output.map(covariance),
        }
    }

    /// Mean and covariance at a time [s]: between steps on straight lines, behind the last one with constant velocity
    /// and a spread in proportion to time.
    fn at(&self, time: f64) -> (Point, [f64; 3]) {
        let last = N_OUTPUT - 1;
        let index = time / STEP - 1.0;
        if index >= last as f64 {
            let velocity = (self.means[last] - self.means[last - LAST_STEPS]) * (LAST_STEPS as f64 * STEP).recip();
            let growth = ((index + 1.0) / N_OUTPUT as f64).powi(2);
            let mean = self.means[last] + velocity * ((index - last as f64) * STEP);
            return (mean, self.covariances[last].map(|value| value * growth));
        }
        if index < 0.0 {
            // Before the first step: from the vehicle's own place.
            return (self.means[0] * (index + 1.0), self.covariances[0]);
        }
        let (i, fraction) = (index as usize, index.fract());
        let (a, b) = (self.covariances[i], self.covariances[i + 1]);
        let covariance = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * fraction);
        (self.means[i].lerp(self.means[i + 1], fraction), covariance)
    }
}

/// Writes the row of a vehicle whose pose was `anchor`.
pub(super) fn write_forecast(out: &mut Predictions, row: usize, output: &Output, anchor: Pose, dt: f64) {
    let forecast = Forecast::of(output);
    let forward = Point::from_angle(anchor.orientation);
    let right = -forward.left();
    let steps: Vec<(Point, [f64; 3])> = (0..out.n_steps).map(|k| forecast.at((k + 1) as f64 * dt)).collect();
    let positions: Vec<Point> =
        steps.iter().map(|(mean, _)| anchor.position + right * mean.x + forward * mean.y).collect();
    let last = positions.len() - 1;
    out.probability[row * out.n_modes] = 1.0;
    let start = out.offset(row, 0);
    for (k, (_, [xx, xy, yy])) in steps.iter().enumerate() {
        // Central differences; one-sided at the ends, where there is another step.
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        let velocity = if from == to {
            (positions[0] - anchor.position) * dt.recip()
        } else {
            (positions[to] - positions[from]) * ((to - from) as f64 * dt).recip()
        };
        let speed = velocity.norm();
        let turned = if speed < STATIONARY_SPEED { 0.0 } else { wrap_angle(velocity.angle() - anchor.orientation) };
        let pose = Pose { position: positions[k], orientation: anchor.orientation + turned };
        // Axes of the vehicle's frame are `right` and `forward`.
        let turn = |a: Point, b: Point| -> f64 { xx * a.x * b.x + xy * (a.x * b.y + a.y * b.x) + yy * a.y * b.y };
        let (x, y) = (Point::new(right.x, forward.x), Point::new(right.y, forward.y));
        write(out, start + k, pose, speed, (turn(x, x), turn(x, y), turn(y, y)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 m/s forward, half a metre to the right, with 0.5 m across and 2 m along.
    fn output() -> Output {
        std::array::from_fn(|j| [0.5, (j + 1) as f32, 2.0, 0.5, 0.25])
    }

    fn forecast(n_steps: usize, dt: f64, orientation: f64) -> Predictions {
        let mut out = Predictions::empty(0, vec![1], 1, n_steps);
        write_forecast(&mut out, 0, &output(), Pose::new(100.0, 5.0, orientation), dt);
        out.validate().expect("numbers and definite covariances");
        out
    }

    #[test]
    fn the_frame_of_the_network_is_turned_into_the_world() {
        let east = forecast(30, 0.1, 0.0);
        assert!((east.x[9] - 110.0).abs() < 1e-6 && (east.y[9] - 4.5).abs() < 1e-6);
        let north = forecast(30, 0.1, std::f64::consts::FRAC_PI_2);
        assert!((north.x[9] - 100.5).abs() < 1e-6 && (north.y[9] - 15.0).abs() < 1e-6);
        // Driving east, "right" is -y: the correlation changes its sign.
        let covariance = |p: &Predictions| [p.covariance_xx[9], p.covariance_xy[9], p.covariance_yy[9]];
        for (found, expected) in covariance(&east).into_iter().zip([4.0, -0.25, 0.25]) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
        for (found, expected) in covariance(&north).into_iter().zip([0.25, 0.25, 4.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
        assert!(east.velocity.iter().all(|v| (v - 10.0).abs() < 1e-6));
        assert!(north.orientation.iter().all(|o| (o - std::f64::consts::FRAC_PI_2).abs() < 1e-6));
    }

    #[test]
    fn other_time_steps_read_the_same_course() {
        let (usual, fine) = (forecast(30, 0.1, 0.3), forecast(75, 0.04, 0.3));
        // 1 s and 3 s from now.
        for (i, j) in [(9, 24), (29, 74)] {
            assert!((usual.x[i] - fine.x[j]).abs() < 1e-9 && (usual.y[i] - fine.y[j]).abs() < 1e-9);
            assert!((usual.covariance_xx[i] - fine.covariance_xx[j]).abs() < 1e-9);
        }
        assert!((fine.velocity[40] - 10.0).abs() < 1e-5);
    }

    #[test]
    fn beyond_the_output_the_velocity_is_kept_and_the_spread_grows() {
        let long = forecast(80, 0.1, 0.0);
        assert!((long.x[79] - 180.0).abs() < 1e-4, "{} m after 8 s", long.x[79]);
        assert!((long.covariance_xx[79] - 16.0).abs() < 1e-6, "twice the deviation at twice the time");
        assert!(long.covariance_xx[39..].is_sorted());
    }

    #[test]
    fn who_hardly_moves_keeps_its_heading() {
        let mut out = Predictions::empty(0, vec![1], 1, 30);
        let wobbling: Output = std::array::from_fn(|j| [if j % 2 == 0 { 0.005 } else { -0.005 }, 0.0, 2.0, 2.0, 0.0]);
        write_forecast(&mut out, 0, &wobbling, Pose::new(0.0, 0.0, 2.0), 0.1);
        assert!(out.orientation.iter().all(|orientation| *orientation == 2.0));
    }

    #[test]
    fn extreme_outputs_stay_covariances() {
        let mut out = Predictions::empty(0, vec![1], 1, 30);
        let extreme: Output = std::array::from_fn(|j| [0.0, j as f32, [0.0, 1e38][j % 2], f32::INFINITY, 1.0]);
        write_forecast(&mut out, 0, &extreme, Pose::new(0.0, 0.0, 2.0), 0.1);
        out.validate().expect("numbers and definite covariances");
    }
}
