use super::*;
use crate::geometry::polyline::Polyline;
use crate::geometry::shape::Lcg;
use std::f64::consts::{PI, TAU};

/// Vertices of a figure of eight: it crosses itself in the middle and turns by 2 pi each way.
fn figure_of_eight() -> Vec<Point> {
    let loop_around = |center: f64, from: f64, sign: f64| {
        (0..=40)
            .map(move |i| Point::new(center, 0.0) + Point::from_angle(from + sign * TAU * f64::from(i) / 40.0) * 20.0)
    };
    loop_around(-20.0, 0.0, 1.0).chain(loop_around(20.0, PI, -1.0)).collect()
}

/// Straight, right angle with 2 m rounding vertices, noise of 5 cm, irregular spacing.
fn rough_corner() -> Vec<Point> {
    let mut points: Vec<Point> = (0..25).map(|i| Point::new(f64::from(i) * 2.0, 0.05 * f64::from(i % 3 - 1))).collect();
    points.extend((0..30).map(|i| Point::new(51.0 + 0.05 * f64::from(i % 2), 2.0 + f64::from(i) * 1.7)));
    points
}

fn samples(path: &ReferencePath) -> impl Iterator<Item = f64> {
    let n = 2000;
    let step = (path.length() - 0.02) / f64::from(n);
    (0..=n).map(move |i| 0.01 + f64::from(i) * step)
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |a: f64, b| a.max(b.abs()))
}

#[test]
fn position_heading_curvature_and_its_rate_are_derivatives_of_each_other_everywhere() {
    const STEP: f64 = 1e-4;
    for points in [figure_of_eight(), rough_corner()] {
        let path = ReferencePath::through(&points).expect("valid");
        for s in samples(&path) {
            let (a, b, m) = (path.at(s - STEP), path.at(s + STEP), path.at(s));
            let velocity = (b.position - a.position) * (0.5 / STEP);
            assert!(velocity.distance(m.tangent()) < 1e-3, "tangent at {s}: {}", velocity.distance(m.tangent()));
            assert!((m.tangent().distance(Point::from_angle(m.theta))) < 1e-12, "sine and cosine at {s}");
            assert!(((b.theta - a.theta) / (2.0 * STEP) - m.curvature).abs() < 1e-4, "curvature at {s}");
            // At a knot the rate jumps, so it is compared only where both neighbours are in the same interval.
            if a.curvature_rate == b.curvature_rate {
                assert!(((b.curvature - a.curvature) / (2.0 * STEP) - m.curvature_rate).abs() < 1e-6, "rate at {s}");
            }
            assert!((b.curvature - a.curvature).abs() < 1e-4, "curvature jumps at {s}");
        }
    }
}

#[test]
fn headings_are_not_wrapped() {
    let path = ReferencePath::through(&figure_of_eight()).expect("valid");
    let (first, last) = (path.theta()[0], path.theta()[path.theta().len() / 2]);
    assert!((last - first - TAU).abs() < 0.15, "{first} {last}");
}

#[test]
fn the_path_stays_near_its_points() {
    for (points, limit) in [(figure_of_eight(), 0.15), (rough_corner(), 0.9)] {
        let line = Polyline::new(&points).expect("valid");
        let path = ReferencePath::through(&points).expect("valid");
        let deviation = largest(path.points().into_iter().map(|p| line.project(p).distance));
        assert!(deviation < limit, "{deviation}");
    }
}

#[test]
fn a_right_angle_becomes_a_bend_that_a_car_can_drive() {
    let points = [Point::new(0.0, 0.0), Point::new(40.0, 0.0), Point::new(40.0, 40.0)];
    let path = ReferencePath::through(&points).expect("valid");
    let sharpest = largest(path.curvature().iter().copied());
    assert!(sharpest < 0.45, "{sharpest}");
}

#[test]
fn noise_of_five_centimetres_does_not_become_curvature() {
    let points: Vec<Point> =
        (0..100).map(|i| Point::new(f64::from(i) * 2.0, 0.05 * f64::from(i * 7 % 5 - 2) / 2.0)).collect();
    let path = ReferencePath::through(&points).expect("valid");
    let sharpest = largest(path.curvature().iter().copied());
    assert!(sharpest < 0.01, "{sharpest}");
}

#[test]
fn projecting_an_offset_point_gives_arc_length_and_offset_back() {
    for points in [figure_of_eight(), rough_corner()] {
        let path = ReferencePath::through(&points).expect("valid");
        for s in samples(&path).step_by(7) {
            for d in [-2.5, 0.0, 1.0] {
                let at = path.at(s);
                if at.curvature * d > 0.8 {
                    continue;
                }
                let (s_found, d_found) = path.project_near(at.offset(d), s + 1.0, 5.0).expect("has a foot");
                assert!((s_found - s).abs() < 1e-8 && (d_found - d).abs() < 1e-8, "{s} {d}: {s_found} {d_found}");
            }
        }
    }
}

#[test]
fn the_hint_chooses_the_branch_where_the_path_crosses_itself() {
    let path = ReferencePath::through(&figure_of_eight()).expect("valid");
    for s in [3.0, path.length() / 2.0 + 3.0] {
        let found = path.project_near(path.at(s).offset(0.2), s, 10.0).expect("has a foot");
        assert!((found.0 - s).abs() < 1e-8);
    }
}

#[test]
fn points_beyond_the_ends_or_far_away_have_no_projection() {
    let path = ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(50.0, 0.0)]).expect("valid");
    for (x, y) in [(-1.0, 0.0), (51.0, 1.0), (20.0, 21.0), (f64::NAN, 0.0)] {
        assert_eq!(path.project(Point::new(x, y)), None, "({x}, {y})");
    }
    assert!(path.project(Point::new(0.0, 3.0)).is_some());
    assert!(path.project_near(Point::new(20.0, 1.0), 40.0, 10.0).is_none());
}

#[test]
fn coordinates_of_five_million_metres_cost_no_precision() {
    let shift = Point::new(691_234.5, 5_334_567.25);
    let near = ReferencePath::through(&rough_corner()).expect("valid");
    let far = ReferencePath::through(&rough_corner().iter().map(|p| *p + shift).collect::<Vec<_>>()).expect("valid");
    let difference = largest(near.curvature().iter().zip(far.curvature()).map(|(a, b)| a - b));
    assert!(difference < 1e-6, "{difference}");
}

#[test]
fn two_points_a_few_centimetres_apart_are_a_path() {
    let path = ReferencePath::through(&[Point::new(1.0, 1.0), Point::new(1.0, 1.05)]).expect("valid");
    assert!((path.length() - 0.05).abs() < 1e-6);
    assert!((path.at(1.0).theta - PI / 2.0).abs() < 1e-9);
}

/// Two straight lines 9 m apart that a half circle joins.
fn hairpin() -> Vec<Point> {
    let there = (0..20).map(|i| Point::new(3.0 * f64::from(i), 0.0));
    let bend = (0..=10).map(|i| Point::new(60.0, 4.5) + Point::from_angle(PI * (f64::from(i) / 10.0 - 0.5)) * 4.5);
    let back = (0..20).map(|i| Point::new(57.0 - 3.0 * f64::from(i), 9.0));
    there.chain(bend).chain(back).collect()
}

#[test]
fn where_a_path_cannot_pass_a_point_it_does_not() {
    let mut random = Lcg::new(3);
    let (mut n_far, mut n_near) = (0, 0);
    for points in [figure_of_eight(), rough_corner(), hairpin()] {
        let path = ReferencePath::through(&points).expect("valid");
        for _ in 0..400 {
            let beside = path.at(random.within(0.0, path.length())).offset(random.within(-30.0, 30.0));
            let (a, b) = (random.within(-5.0, path.length() + 5.0), random.within(-5.0, path.length() + 5.0));
            let (from, to, distance) = (a.min(b), a.max(b), random.within(0.0, 15.0));
            let n = ((to - from) / 0.05) as usize + 1;
            let along = (0..=n).map(|i| from + (to - from) * i as f64 / n as f64);
            let nearest = along.map(|s| path.at(s).position.distance(beside)).fold(f64::INFINITY, f64::min);
            let may_pass = path.may_pass(beside, distance, from, to);
            // A foot is at most as far from a sample as those are from each other.
            assert!(may_pass || nearest > distance, "{beside:?} within {distance}, {from} to {to}: {nearest}");
            // ... and it is not just always possible.
            assert!(!may_pass || nearest <= distance + 3.0 * path.spacing(), "{beside:?}, {distance}: {nearest}");
            n_far += usize::from(!may_pass);
            n_near += usize::from(may_pass);
        }
        assert!(path.may_pass(Point::new(f64::NAN, 0.0), 1.0, 0.0, 10.0), "not a number is not far");
    }
    assert!(n_far > 200 && n_near > 200, "{n_far} {n_near}");
}

#[test]
fn a_foot_found_from_the_last_one_is_the_nearest_one_along_a_drive() {
    const WINDOW: f64 = 10.0;
    let mut random = Lcg::new(4);
    for points in [figure_of_eight(), rough_corner(), hairpin()] {
        let path = ReferencePath::through(&points).expect("valid");
        for _ in 0..20 {
            let (phase, width) = (random.within(0.0, TAU), random.within(0.0, 1.5));
            let (mut s, mut hint, mut n) = (0.5, 0.5, 0);
            while s < path.length() - 0.5 {
                let (at, d) = (path.at(s), width * (0.1 * s + phase).sin());
                let point = at.offset(d);
                let (found_s, found_d, found_at) = path.project_from(point, hint, WINDOW).expect("has a foot");
                assert_eq!(path.project_near(point, hint, WINDOW), Some((found_s, found_d)), "{point:?} from {hint}");
                assert!((found_s - s).abs() < 1e-8 && (found_d - d).abs() < 1e-8, "{s} {d}: {found_s} {found_d}");
                assert_eq!(found_at, path.at(found_s));
                // The other branches of the figure of eight are as near where they cross.
                if let Some((global, offset)) = path.project(point)
                    && (global - found_s).abs() > 1e-8
                {
                    assert!(
                        (global - found_s).abs() > 20.0 && offset.abs() <= found_d.abs() + 1e-8,
                        "{global} {found_s}"
                    );
                }
                (hint, n) = (found_s, n + 1);
                s += random.within(0.0, 3.0);
            }
            assert!(n > 40, "{n} points");
        }
        assert_eq!(path.project_from(path.at(5.0).offset(25.0), 5.0, WINDOW), None, "farther than 20 m");
        assert_eq!(path.project_from(Point::new(f64::NAN, 0.0), 5.0, WINDOW), None);
        assert_eq!(path.project_from(path.at(5.0).position, 5.0, -1.0), None, "a window with nothing in it");
    }
}

#[test]
fn many_arc_lengths_at_once_are_each_of_them_on_wide_machines_and_others() {
    let mut random = Lcg::new(11);
    let vertices: Vec<Point> =
        (0..40).map(|i| Point::new(5e5 + 4.0 * f64::from(i), 10.0 * (0.3 * f64::from(i)).sin())).collect();
    let path = ReferencePath::through(&vertices).expect("a path");
    for n in [0, 3, 8, 32, 37] {
        let s: Vec<f64> = (0..n).map(|_| random.within(-5.0, path.length() + 5.0)).collect();
        let all = |write: &dyn Fn([&mut [f64]; 7])| {
            let mut columns = vec![vec![f64::NAN; n]; 7];
            let mut rest = columns.iter_mut();
            write(std::array::from_fn(|_| rest.next().expect("seven").as_mut_slice()));
            columns
        };
        let (wide, narrow) = (all(&|out| path.write_at(&s, out)), all(&|out| points_at(&path, &s, out)));
        for i in 0..n {
            let at = path.at(s[i]);
            let one = [at.position.x, at.position.y, at.theta, at.cos, at.sin, at.curvature, at.curvature_rate];
            for (k, number) in one.into_iter().enumerate() {
                assert_eq!((wide[k][i].to_bits(), narrow[k][i].to_bits()), (number.to_bits(), number.to_bits()));
            }
            assert!((path.curvature_at(s[i]) - at.curvature).abs() < 1e-12);
        }
    }
}

#[test]
fn the_nearest_knot_is_that_of_all_knots_wherever_the_search_begins() {
    for points in [figure_of_eight(), hairpin(), rough_corner()] {
        let path = ReferencePath::through(&points).expect("valid");
        let last = path.knots.len() - 1;
        assert_eq!(path.project_near(path.at(5.0).position, 5.0, -1.0), None, "a window with nothing in it");
        for (from, to) in [(0, last), (last / 3, last), (last / 4, last / 2)] {
            for hint in [from, usize::midpoint(from, to), to] {
                for step in 0..400_u32 {
                    let around = path.points()[(7 * step) as usize % (last + 1)];
                    let p = around + Point::from_angle(f64::from(step)) * (0.11 * f64::from(step)) - path.origin;
                    let squared = |i: &usize| (p - path.knots[*i].position).norm_squared();
                    let expected = (from..=to).min_by(|a, b| squared(a).total_cmp(&squared(b))).expect("a knot");
                    assert_eq!(path.nearest_knot(p, hint, (from, to)), expected, "{p:?} from {from} to {to}");
                }
            }
        }
    }
}
