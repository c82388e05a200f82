mod slabs;

use super::*;

/// Midpoint rule with a million cells over the part of the box within 7 standard deviations.
fn brute_force(variance_x: f64, covariance: f64, variance_y: f64, center: (f64, f64), half: (f64, f64)) -> f64 {
    let n = 1000;
    let determinant = variance_x * variance_y - covariance * covariance;
    let bounds =
        |c: f64, h: f64, variance: f64| ((c - h).max(-7.0 * variance.sqrt()), (c + h).min(7.0 * variance.sqrt()));
    let (x0, x1) = bounds(center.0, half.0, variance_x);
    let (y0, y1) = bounds(center.1, half.1, variance_y);
    if x0 >= x1 || y0 >= y1 {
        return 0.0;
    }
    let (hx, hy) = ((x1 - x0) / f64::from(n), (y1 - y0) / f64::from(n));
    let mut sum = 0.0;
    for i in 0..n {
        let x = x0 + (f64::from(i) + 0.5) * hx;
        for j in 0..n {
            let y = y0 + (f64::from(j) + 0.5) * hy;
            let q = (variance_y * x * x - 2.0 * covariance * x * y + variance_x * y * y) / determinant;
            sum += (-0.5 * q).exp();
        }
    }
    sum * hx * hy / (std::f64::consts::TAU * determinant.sqrt())
}

fn one_box(normal: &Normal2, center: (f64, f64), half: (f64, f64)) -> f64 {
    let found = normal.probabilities(&[center.0; LANES], &[center.1; LANES], half);
    assert!(found[..5].iter().all(|p| *p == found[0]), "{found:?}");
    f64::from(found[0])
}

#[test]
fn box_probabilities_agree_with_brute_force_integration() {
    let half = (2.254, 0.805);
    for rho in [0.0, 1e-7, 0.01, -0.14, 0.2, -0.45, 0.59, -0.7, 0.86, 0.9, -0.97] {
        for (sx, sy) in [(0.3, 0.2), (1.0, 0.4), (3.0, 1.5), (0.8, 4.0)] {
            for center in [(0.0, 0.0), (1.0, -0.5), (-2.6, 0.9), (2.0, 2.5), (-4.0, -1.6)] {
                let (xx, xy, yy) = (sx * sx, rho * sx * sy, sy * sy);
                let p = one_box(&Normal2::new(xx, xy, yy), center, half);
                let expected = brute_force(xx, xy, yy, center, half);
                assert!((p - expected).abs() < 3e-6, "rho {rho}, sigma {sx} {sy}, {center:?}: {p} for {expected}");
            }
        }
    }
}

#[test]
fn boxes_of_all_sizes_and_places_agree_with_the_slabs() {
    let mut worst = (0.0, String::new());
    for rho in [
        0.0, 0.01, -0.05, 0.1, 0.15, -0.151, 0.3, 0.4, -0.5, 0.58, 0.7, -0.77, 0.8, 0.88, 0.881, -0.9, 0.93, -0.95,
        0.98, -0.995, 0.9999,
    ] {
        for half in [(2.25, 0.8), (2.25, 20.0), (0.3, 0.2)] {
            for (sx, sy) in [(0.1, 0.1), (0.4, 0.25), (1.5, 0.5), (0.7, 3.0), (20.0, 15.0)] {
                for i in 0..23 {
                    let center = (0.4 * f64::from(i) - 2.7, 2.1 - 0.43 * f64::from(i * 5 % 11));
                    let normal = Normal2::new(sx * sx, rho * sx * sy, sy * sy);
                    let side = |c: f64, h: f64, s: f64| ((c - h) / s, (c + h) / s);
                    let expected = slabs::box_probability(side(center.0, half.0, sx), side(center.1, half.1, sy), rho);
                    let error = (one_box(&normal, center, half) - expected).abs();
                    if error > worst.0 {
                        worst = (error, format!("rho {rho}, half {half:?}, sigma {sx} {sy}, {center:?}: {expected}"));
                    }
                }
            }
        }
    }
    assert!(worst.0 < 6e-7, "{worst:?}");
}

#[test]
fn the_corners_of_a_footprint_are_those_of_boxes_around_them() {
    let normal = Normal2::new(0.8, 0.1, 0.5);
    let (center, left, right) = (Point::new(1.4, -0.6), Point::new(2.3, 1.3), Point::new(2.5, -1.1));
    let found = normal.centre_and_corners(&Footprint { center, front_left: left, front_right: right }, (2.2, 0.9));
    let place = |p: Point| one_box(&normal, (p.x, p.y), (2.2, 0.9));
    let corners = [center + left, center + right, center - left, center - right].map(place);
    assert!((f64::from(found) - (place(center) + 0.5 * corners.iter().sum::<f64>())).abs() < 1e-6, "{found}");
    assert!(corners.iter().all(|p| *p > 1e-3), "{corners:?}");
}

#[test]
fn far_boxes_have_no_probability_at_all() {
    let normal = Normal2::new(0.01, 0.001, 0.04);
    for center in [(2.81, 0.0), (0.0, -2.0), (-1e3, 1e3), (f64::INFINITY, 0.0)] {
        assert_eq!(one_box(&normal, center, (2.25, 0.8)), 0.0, "{center:?}");
    }
}

#[test]
fn a_covariance_that_no_distribution_has_gives_a_probability() {
    for (xx, xy, yy) in [(0.0, 0.0, 0.0), (1.0, 5.0, 1.0), (-1.0, 0.2, 0.5)] {
        let p = one_box(&Normal2::new(xx, xy, yy), (0.1, 0.1), (1.0, 1.0));
        assert!((0.0..=1.0).contains(&p), "{p}");
    }
}
