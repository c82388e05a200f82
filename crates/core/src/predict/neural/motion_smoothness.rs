//! How even the past of a vehicle was: exact motion is simulated, or driven steadily; what cameras
//! measure is rough.

use super::history::N_INSTANTS;

/// Number of instants of the windows over which roughness is told: 0.8, 1.2 and 2 s.
const ROUGH_WINDOWS: [usize; 3] = [4, 6, 10];
/// Number of instants of the windows over which unsteadiness is told: 1 and 2 s.
const STEADY_WINDOWS: [usize; 2] = [5, 10];
/// Number of values.
pub const N_SMOOTHNESS: usize = 2 * ROUGH_WINDOWS.len() + STEADY_WINDOWS.len();
/// A roughness [m] whose logarithm is nearly 0.
const ROUGHNESS: f64 = 0.01;
/// An unsteadiness [m/s] whose logarithm is nearly 0.
const UNSTEADINESS: f64 = 0.1;
/// Share of these that is added, so that nothing has a logarithm, too.
const LEAST: f64 = 0.1;

/// Roughness along the heading over 0.8, 1.2 and 2 s, the same across it, and unsteadiness over 1 and 2 s; 0 where the past
/// is too short.
///
/// Roughness is the root of the mean square of the third differences of the positions 0.2 s apart, to which constant
/// acceleration contributes nothing and a jerk of 1 m/s³ 8 mm; unsteadiness the largest difference of the speed from that
/// now. Both as logarithms: ln(value / unit + 0.1), units 1 cm and 0.1 m/s.
///
/// `past` has along, across [m] and difference of speed [m/s] at each instant, less any motion at constant velocity; the
/// first `n_exact` are those of time steps. Positions between time steps would have the roughness of the interpolation.
pub fn motion_smoothness(past: &[Option<[f64; 3]>; N_INSTANTS], n_exact: usize) -> [f64; N_SMOOTHNESS] {
    let n_known = past.iter().take_while(|instant| instant.is_some()).count();
    let at = |k: usize, axis: usize| if k == 0 { 0.0 } else { past[k - 1].map_or(0.0, |instant| instant[axis]) };
    let rough = |window: usize, axis: usize| {
        let n = window.min(n_exact);
        if n < 3 {
            return 0.0;
        }
        let third = |k: usize| at(k, axis) - 3.0 * at(k + 1, axis) + 3.0 * at(k + 2, axis) - at(k + 3, axis);
        let mean = (0..=n - 3).map(|k| third(k).powi(2)).sum::<f64>() / (n - 2) as f64;
        (mean.sqrt() / ROUGHNESS + LEAST).ln()
    };
    let unsteady = |window: usize| {
        let n = window.min(n_known);
        if n == 0 {
            return 0.0;
        }
        let largest = (1..=n).fold(0.0_f64, |largest, k| largest.max(at(k, 2).abs()));
        (largest / UNSTEADINESS + LEAST).ln()
    };
    let mut values = [0.0; N_SMOOTHNESS];
    for (k, window) in ROUGH_WINDOWS.into_iter().enumerate() {
        values[k] = rough(window, 0);
        values[ROUGH_WINDOWS.len() + k] = rough(window, 1);
    }
    for (k, window) in STEADY_WINDOWS.into_iter().enumerate() {
        values[2 * ROUGH_WINDOWS.len() + k] = unsteady(window);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion_smoothness(past: &[Option<[f64; 3]>; N_INSTANTS]) -> [f64; N_SMOOTHNESS] {
        super::motion_smoothness(past, past.iter().flatten().count())
    }

    fn past(known: usize, of: impl Fn(f64) -> [f64; 3]) -> [Option<[f64; 3]>; N_INSTANTS] {
        std::array::from_fn(|k| (k < known).then(|| of(-0.2 * (k + 1) as f64)))
    }

    #[test]
    fn even_acceleration_is_not_rough_and_jerk_is() {
        let found = motion_smoothness(&past(10, |t| [0.5 * t * t, 0.0, t]));
        assert!(found[..6].iter().all(|value| (value - LEAST.ln()).abs() < 1e-9), "{found:?}");
        assert!((found[6] - (1.0_f64 / 0.1 + 0.1).ln()).abs() < 1e-9 && found[7] > found[6], "{found:?}");
        let found = motion_smoothness(&past(10, |t| [0.0, t.powi(3) / 6.0, 0.0]));
        assert!(found[3..6].iter().all(|value| (value - (0.8_f64 + 0.1).ln()).abs() < 1e-9), "8 mm: {found:?}");
        assert!((found[0] - LEAST.ln()).abs() < 1e-9, "not along");
    }

    #[test]
    fn a_short_past_tells_what_it_can() {
        assert_eq!(motion_smoothness(&past(0, |_| [1.0; 3])), [0.0; N_SMOOTHNESS]);
        let found = motion_smoothness(&past(2, |_| [0.3, 0.0, 0.4]));
        assert!(found[..6].iter().all(|value| *value == 0.0) && found[6] > 1.0, "{found:?}");
        let found = motion_smoothness(&past(3, |t| [t.powi(3) / 6.0, 0.0, 0.0]));
        assert!(found[..3].iter().all(|value| (value - 0.9_f64.ln()).abs() < 1e-9), "one difference: {found:?}");
        let found = super::motion_smoothness(&past(10, |t| [t.powi(3) / 6.0, 0.0, t]), 2);
        assert!(found[..6].iter().all(|value| *value == 0.0) && found[6] > 1.0, "interpolated: {found:?}");
    }
}
