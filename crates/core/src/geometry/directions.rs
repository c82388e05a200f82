//! Unit vectors of many angles at once.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use super::Point;
use crate::simd::multiversion;

/// Writes the unit vector of every angle [rad], its x and its y (cosine and sine, error below 3e-16); (0, 0) for what is not
/// `valid`. All slices are of one length.
pub(crate) fn write_directions(angles: &[f64], valid: &[bool], x: &mut [f64], y: &mut [f64]) {
    directions(angles, x, y);
    for (i, (angle, valid)) in angles.iter().zip(valid).enumerate() {
        if !valid {
            (x[i], y[i]) = (0.0, 0.0);
        } else if angle.is_nan() || angle.abs() > ANGLE_MAX {
            let direction = Point::from_angle(*angle);
            (x[i], y[i]) = (direction.x, direction.y);
        }
    }
}

/// Up to here a quarter turn and its multiples have no rounding error that matters [rad].
const ANGLE_MAX: f64 = 1e5;
/// Adding and subtracting it rounds to an integer; its low bits hold that integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// A quarter turn in three parts; multiples of the first and of the second are exact.
const QUARTER: [f64; 3] = {
    let first = f64::from_bits(FRAC_PI_2.to_bits() >> 20 << 20);
    [first, FRAC_PI_2 - first, 6.123_233_995_736_766e-17]
};
/// 1 / 3!, 1 / 5!, ..., with signs.
const SIN: [f64; 8] = series(3);
/// 1 / 2!, 1 / 4!, ..., with signs.
const COS: [f64; 8] = series(2);

/// Coefficients of the Taylor series from a power on, every other one, with signs.
const fn series(first: usize) -> [f64; 8] {
    let (mut out, mut factorial, mut n, mut i) = ([0.0; 8], 1.0, 1, 0);
    while i < 8 {
        while n < first + 2 * i {
            n += 1;
            factorial *= n as f64;
        }
        out[i] = if i % 2 == 0 { -1.0 / factorial } else { 1.0 / factorial };
        i += 1;
    }
    out
}

multiversion! {
    fn directions = directions_at, (angles: &[f64], x: &mut [f64], y: &mut [f64])
}

#[inline(always)]
fn directions_at(angles: &[f64], x: &mut [f64], y: &mut [f64]) {
    let n = angles.len();
    let (x, y) = (&mut x[..n], &mut y[..n]);
    for i in 0..n {
        let shifted = angles[i] * FRAC_2_PI + ROUNDER;
        let quarters = shifted - ROUNDER;
        let angle = angles[i] - quarters * QUARTER[0] - quarters * QUARTER[1] - quarters * QUARTER[2];
        let square = angle * angle;
        let (mut sin, mut cos) = (SIN[7], COS[7]);
        for k in (0..7).rev() {
            sin = SIN[k] + square * sin;
            cos = COS[k] + square * cos;
        }
        let (sin, cos) = (angle + angle * square * sin, 1.0 + square * cos);
        let quadrant = shifted.to_bits();
        let (a, b) = if quadrant & 1 == 0 { (cos, sin) } else { (sin, cos) };
        x[i] = if (quadrant + 1) & 2 == 0 { a } else { -a };
        y[i] = if quadrant & 2 == 0 { b } else { -b };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    #[test]
    fn directions_are_cosine_and_sine_on_wide_machines_and_others() {
        let mut random = Lcg::new(3);
        for reach in [0.5, 4.0, 100.0, 9e4] {
            let mut angles: Vec<f64> = (0..1003).map(|_| random.within(-reach, reach)).collect();
            angles.extend((-8..=8).map(|k| f64::from(k) * FRAC_PI_2));
            let n = angles.len();
            let (mut x, mut y) = (vec![0.0; n], vec![0.0; n]);
            let (mut narrow_x, mut narrow_y) = (x.clone(), y.clone());
            write_directions(&angles, &vec![true; n], &mut x, &mut y);
            directions_at(&angles, &mut narrow_x, &mut narrow_y);
            assert_eq!((&x, &y), (&narrow_x, &narrow_y));
            for i in 0..n {
                let (sin, cos) = angles[i].sin_cos();
                assert!((x[i] - cos).abs() < 3e-16 && (y[i] - sin).abs() < 3e-16, "{}: {} {}", angles[i], x[i], y[i]);
            }
        }
    }

    #[test]
    fn huge_angles_are_looked_up_one_by_one_and_invalid_rows_have_none() {
        let angles = [1e9, f64::NAN, 1.0, f64::NAN];
        let (mut x, mut y) = ([1.0; 4], [1.0; 4]);
        write_directions(&angles, &[true, true, false, false], &mut x, &mut y);
        assert_eq!((x[0], y[0]), (1e9_f64.cos(), 1e9_f64.sin()));
        assert!(x[1].is_nan() && y[1].is_nan());
        assert_eq!((x[2], y[2], x[3], y[3]), (0.0, 0.0, 0.0, 0.0));
    }
}
