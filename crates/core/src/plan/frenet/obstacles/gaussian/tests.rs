use super::boxes::gauss_legendre;
use super::*;

const RULE_8: [(f64, f64); 8] = gauss_legendre();
/// Beyond so many standard deviations nothing is left: less than 1e-15.
const END: f64 = 8.0;

fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt()
}

/// Probability that a standard normal variable is at most `z`: 1/2 + density(z) (z + z³/3 + z⁵/(3 5) + ...).
fn normal_cdf(z: f64) -> f64 {
    let z = z.clamp(-END, END);
    let (mut term, mut sum, mut odd) = (z, 0.0, 1.0);
    while term.abs() > 1e-17 * f64::abs(sum) {
        sum += term;
        odd += 2.0;
        term *= z * z / odd;
    }
    0.5 + density(z) * sum
}

/// Probability of a box between two ends of each side [standard deviations]: the conditional probability of y, integrated over
/// slabs of x.
fn box_probability(x: (f64, f64), y: (f64, f64), rho: f64) -> f64 {
    let remainder = (1.0 - rho * rho).sqrt();
    let (from, to) = (x.0.max(-END), x.1.min(END));
    let n = ((to - from) / (2.5 * remainder)).ceil().max(0.0) as usize;
    let half = 0.5 * (to - from) / n as f64;
    let slab = |i: usize| {
        let at = |(node, weight): &(f64, f64)| {
            let z = from + half * ((2 * i + 1) as f64 + node);
            let inner = normal_cdf((y.1 - rho * z) / remainder) - normal_cdf((y.0 - rho * z) / remainder);
            weight * density(z) * inner
        };
        half * RULE_8.iter().map(at).sum::<f64>()
    };
    (0..n).map(slab).sum()
}

fn one_box(normal: &Normal2, center: (f64, f64), half: (f64, f64)) -> f64 {
    let found = normal.probabilities(&[center.0; LANES], &[center.1; LANES], half);
    assert!(found[..5].iter().all(|p| *p == found[0]), "{found:?}");
    f64::from(found[0])
}

#[test]
fn the_slabs_agree_with_tables_and_do_not_depend_on_which_side_they_cut() {
    // Abramowitz and Stegun, table 26.1.
    for (z, p) in
        [(0.0, 0.5), (1.0, 0.841_344_746_068_543), (-2.0, 0.022_750_131_948_179), (4.0, 0.999_968_328_758_167)]
    {
        assert!((normal_cdf(z) - p).abs() < 1e-13, "{z}");
    }
    for rho in [0.6, -0.9, 0.97, -0.999] {
        for (x, y) in [((-1.0, 2.0), (-0.5, 0.7)), ((-6.0, 0.3), (1.0, 4.0)), ((-0.2, 0.2), (-6.0, 6.0))] {
            let (one, other) = (box_probability(x, y, rho), box_probability(y, x, rho));
            assert!((one - other).abs() < 1e-8, "{rho} {x:?} {y:?}: {one} {other}");
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
                    let expected = box_probability(side(center.0, half.0, sx), side(center.1, half.1, sy), rho);
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
