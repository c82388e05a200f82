use super::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

const ORIGIN: Pose = Pose::new(0.0, 0.0, 0.0);

fn points(coordinates: &[(f64, f64)]) -> Vec<Point> {
    coordinates.iter().map(|(x, y)| Point::new(*x, *y)).collect()
}

fn polygon(coordinates: &[(f64, f64)]) -> Shape {
    Shape::polygon(&points(coordinates)).expect("a simple polygon")
}

/// An L: the square [0, 4] x [0, 4] without (1, 4] x (1, 4].
fn l_shape() -> Shape {
    polygon(&[(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0)])
}

#[test]
fn distances_agree_with_hand_computed_values() {
    let car = || Shape::rectangle(4.0, 2.0);
    let triangle = || polygon(&[(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)]);
    // (first at the origin, second, its pose, distance)
    let table = [
        (car(), car(), Pose::new(7.0, 0.0, 0.0), 3.0),       // side to side
        (car(), car(), Pose::new(7.0, 6.0, 0.0), 5.0),       // corner to corner: 3, 4
        (car(), car(), Pose::new(5.0, 0.0, FRAC_PI_2), 2.0), // 5 - 2 - 1
        (car(), car(), Pose::new(6.0, 0.0, FRAC_PI_4), 4.0 - 1.5 * 2f64.sqrt()), // side to corner
        (car(), car(), Pose::new(4.0, 2.0, 0.0), 0.0),       // corners touch
        (car(), car(), Pose::new(1.0, 0.5, 0.3), 0.0),       // overlap
        (car(), Shape::circle(1.0), Pose::new(0.0, 5.0, 1.0), 3.0), // side to circle
        (car(), Shape::circle(1.0), Pose::new(5.0, 5.0, 1.0), 4.0), // corner to circle: 3, 4, less 1
        (car(), Shape::circle(0.5), ORIGIN, 0.0),            // circle inside
        (Shape::circle(1.0), Shape::circle(2.0), Pose::new(3.0, 4.0, 0.0), 2.0),
        (Shape::circle(1.0), Shape::circle(2.0), ORIGIN, 0.0),
        (triangle(), Shape::circle(1.0), Pose::new(3.0, 4.0, 0.0), 1.4), // (12 + 12 - 12) / 5 - 1
        (triangle(), car(), Pose::new(-5.0, 0.0, 0.0), 3.0),
        (l_shape(), Shape::circle(0.5), Pose::new(3.0, 3.0, 0.0), 1.5), // in the bay of the L
        (l_shape(), Shape::circle(2.5), Pose::new(3.0, 3.0, 0.0), 0.0),
        (Shape::rectangle_at(4.0, 2.0, Point::new(10.0, 0.0), FRAC_PI_2), Shape::circle(1.0), ORIGIN, 8.0),
        (
            Shape::group(vec![
                Shape::circle_at(1.0, Point::new(-4.0, 0.0)),
                Shape::circle_at(1.0, Point::new(4.0, 0.0)),
            ]),
            Shape::circle(1.0),
            Pose::new(1.0, 0.0, 0.0),
            1.0,
        ),
        (Shape::rectangle(4.0, 0.0), Shape::rectangle(4.0, 0.0), Pose::new(7.0, 0.0, 0.0), 3.0), // two lines in a row
    ];
    for (first, second, pose, expected) in table {
        // The same pair anywhere in the world, either way round.
        for frame in [ORIGIN, Pose::new(-300.0, 5000.0, 2.2), Pose::new(7.0, 3.0, -1.0)] {
            let at = |p: Pose| Pose {
                position: frame.world_from_body(p.position),
                orientation: p.orientation + frame.orientation,
            };
            let found = [first.distance(at(ORIGIN), &second, at(pose)), second.distance(at(pose), &first, at(ORIGIN))];
            for distance in found {
                // Lines are 1e-6 m thick.
                assert!((distance - expected).abs() < 2e-6, "{second:?} at {pose:?}: {distance}, not {expected}");
            }
            assert_eq!(first.overlaps(at(ORIGIN), &second, at(pose)), expected == 0.0, "{second:?} at {pose:?}");
        }
    }
}

#[test]
fn a_shape_contains_its_inside_and_its_edge() {
    let cases = [
        (
            l_shape(),
            vec![(0.5, 3.9), (3.9, 0.5), (0.5, 0.5), (4.0, 0.5), (1.0, 1.0)],
            vec![(1.1, 1.1), (-0.1, 0.0), (4.1, 0.5)],
        ),
        (
            Shape::circle_at(1.0, Point::new(2.0, 0.0)),
            vec![(3.0, 0.0), (2.0, -1.0), (2.5, 0.5)],
            vec![(3.01, 0.0), (2.8, 0.8)],
        ),
        (
            Shape::rectangle_at(4.0, 2.0, Point::new(1.0, 0.0), FRAC_PI_2),
            vec![(0.0, 2.0), (2.0, -2.0)],
            vec![(2.5, 0.0)],
        ),
    ];
    for (shape, inside, outside) in cases {
        let pose = Pose::new(20.0, -7.0, 2.0);
        let placed = PlacedShape { shape, pose };
        for (points, expected) in [(points(&inside), true), (points(&outside), false)] {
            for point in points {
                assert_eq!(placed.contains(pose.world_from_body(point)), expected, "{point:?}");
            }
        }
    }
}

#[test]
fn bounds_of_an_offset_rectangle() {
    let shape = Shape::rectangle_at(4.0, 2.0, Point::new(3.0, 1.0), FRAC_PI_2);
    let (length, width) = shape.extent();
    assert!((length - 2.0).abs() < 1e-12 && (width - 4.0).abs() < 1e-12);
    assert!((shape.bounding_radius() - 5.0).abs() < 1e-12); // corner (4, 3)
    let pose = Pose::new(10.0, 0.0, FRAC_PI_2);
    let aabb = shape.aabb(pose);
    assert!(aabb.min.distance(Point::new(7.0, 2.0)) < 1e-12 && aabb.max.distance(Point::new(11.0, 4.0)) < 1e-12);
    assert!(PlacedShape { shape: shape.clone(), pose }.center().distance(Point::new(9.0, 3.0)) < 1e-12);
    let around = shape.oriented_box(pose);
    assert!(around.center.distance(Point::new(9.0, 3.0)) < 1e-12);
    assert!((around.half_length - 1.0).abs() < 1e-12 && (around.half_width - 2.0).abs() < 1e-12);
}

#[test]
fn the_centre_of_an_l_and_of_a_ring_given_far_away_is_its_centre_of_area() {
    // Areas 4 and 3 with centres (2, 0.5) and (0.5, 2.5).
    let expected = Point::new((4.0 * 2.0 + 3.0 * 0.5) / 7.0, (4.0 * 0.5 + 3.0 * 2.5) / 7.0);
    assert!(PlacedShape { shape: l_shape(), pose: ORIGIN }.center().distance(expected) < 1e-12);
    assert!(Shape::circle_at(2.0, Point::new(1.0, 5.0)).centroid().distance(Point::new(1.0, 5.0)) < 1e-12);
    // A disc of 9 pi m² at the origin and a rectangle of 9 m² at (pi + 1, 0).
    let ahead = Shape::rectangle_at(4.5, 2.0, Point::new(PI + 1.0, 0.0), 0.0);
    let both = Shape::group(vec![Shape::circle(3.0), ahead]).centroid();
    assert!(both.distance(Point::new(1.0, 0.0)) < 1e-12, "{both:?}");
}

#[test]
fn outlines_for_pictures_keep_the_polygon_and_approximate_circles() {
    let group = Shape::group(vec![l_shape(), Shape::circle(2.0)]);
    let outline = group.outline();
    assert_eq!(outline.iter().map(Vec::len).collect::<Vec<_>>(), [6, 32]);
    assert!(outline[1].iter().all(|p| (p.norm() - 2.0).abs() < 1e-12));
    let circle = &Shape::circle_at(2.0, Point::new(1.0, 5.0)).outline()[0];
    for (corner, x, y) in [(0, 3.0, 5.0), (8, 1.0, 7.0), (16, -1.0, 5.0), (24, 1.0, 3.0)] {
        assert!(circle[corner].distance(Point::new(x, y)) < 1e-12, "corner {corner}: {:?}", circle[corner]);
    }
}

#[test]
fn impossible_sizes_are_found_by_the_check() {
    assert!(Shape::rectangle(4.0, 0.0).check().is_ok() && Shape::circle(1.0).check().is_ok());
    for shape in [
        Shape::rectangle(f64::NAN, 2.0),
        Shape::rectangle(-4.0, 2.0),
        Shape::rectangle(f64::INFINITY, 2.0),
        Shape::circle(-1.0),
        Shape::circle(f64::NAN),
        Shape::group(Vec::new()),
    ] {
        assert!(shape.check().is_err(), "{shape:?}");
    }
    assert!(!Shape::group(Vec::new()).overlaps(ORIGIN, &Shape::circle(1.0), ORIGIN));
}

#[test]
fn a_thousand_kilometres_from_the_origin_contact_is_still_exact_to_a_micrometre() {
    let far = Point::new(1e6, -1e6);
    let square = points(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]).into_iter().map(|p| p + far);
    let area = Shape::polygon(&square.collect::<Vec<_>>()).expect("a square");
    let car = Shape::rectangle(4.0, 2.0);
    let beside = |gap: f64| Pose { position: far + Point::new(12.0 + gap, 5.0), orientation: 0.0 };
    assert!(car.overlaps(beside(-1e-6), &area, ORIGIN));
    assert!(!car.overlaps(beside(1e-6), &area, ORIGIN));
    assert!((car.distance(beside(0.5), &area, ORIGIN) - 0.5).abs() < 1e-6);
}

/// Overlap and distance against a dense sample of points of one body: distances of samples are upper bounds, and no
/// point of the body is farther than the sample spacing from a sample.
#[test]
fn random_pairs_agree_with_sampling() {
    let mut random = Lcg::new(11);
    let shapes = [
        Shape::rectangle(4.5, 1.8),
        Shape::circle_at(1.2, Point::new(0.5, 0.0)),
        l_shape(),
        polygon(&[(0.0, 0.0), (5.0, 1.0), (1.0, 1.5), (2.0, 5.0), (-2.0, 1.0)]),
        polygon(&[(2.0, 0.0), (1.0, 1.7), (-1.0, 1.7), (-2.0, 0.0), (-1.0, -1.7), (1.0, -1.7)]),
    ];
    const SPACING: f64 = 0.05;
    let mut counts = [0, 0];
    for round in 0..400 {
        let (a, b) = (&shapes[round % 5], &shapes[(round / 5) % 5]);
        let mut pose = || Pose::new(random.within(-4.0, 4.0), random.within(-4.0, 4.0), random.within(-PI, PI));
        let (pose_a, pose_b) = (pose(), pose());
        let inside: Vec<Point> = grid(a, SPACING).into_iter().map(|p| pose_a.world_from_body(p)).collect();
        let hit = inside.iter().any(|p| b.contains(pose_b, *p));
        let dot = Shape::circle(0.0);
        let sampled = inside
            .iter()
            .map(|p| b.distance(pose_b, &dot, Pose { position: *p, orientation: 0.0 }))
            .fold(f64::INFINITY, f64::min);
        let (overlaps, distance) = (a.overlaps(pose_a, b, pose_b), a.distance(pose_a, b, pose_b));
        assert_eq!(overlaps, distance == 0.0);
        assert!(!hit || overlaps, "a sampled point is in both: {round}");
        // Thin tips of the polygons hold no sample, so the sampled distance may be off by several spacings.
        assert!(distance <= sampled + 1e-9 && sampled <= distance + 8.0 * SPACING, "{round}: {distance} {sampled}");
        counts[usize::from(overlaps)] += 1;
    }
    assert!(counts.iter().all(|n| *n > 60), "{counts:?}: the sample must hold both cases");
}

fn grid(shape: &Shape, spacing: f64) -> Vec<Point> {
    let aabb = shape.bounding_box();
    let (length, width) = shape.extent();
    let (columns, rows) = ((length / spacing) as usize, (width / spacing) as usize);
    let at = |i: usize, j: usize| aabb.min + Point::new(i as f64 * spacing, j as f64 * spacing);
    let all = (0..=columns).flat_map(|i| (0..=rows).map(move |j| at(i, j)));
    all.filter(|p| shape.contains(ORIGIN, *p)).collect()
}
