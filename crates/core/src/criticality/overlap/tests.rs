use super::*;
use crate::road::testing::{crossing, fork, lane, merge, open, parallel_lanes, straight, straight_road};

fn square(x: f64, y: f64, size: f64) -> Vec<Point> {
    [(x, y), (x + size, y), (x + size, y + size), (x, y + size)].map(|(x, y)| Point::new(x, y)).to_vec()
}

#[test]
fn convex_polygons_share_the_area_they_should() {
    for (other, expected) in [(square(1.0, 1.0, 2.0), 1.0), (square(0.5, 0.5, 1.0), 1.0), (square(2.0, 0.0, 2.0), 0.0)]
    {
        let common = intersection(&square(0.0, 0.0, 2.0), &other);
        assert!((area(&common) - expected).abs() < 1e-12, "{expected}");
    }
}

#[test]
fn an_eroded_lane_is_narrower_and_shorter() {
    let road = straight_road(1);
    let lanelet = &road.lanelets()[0];
    assert!((Area::of_lanelet(lanelet).size() - 200.0 * 3.5).abs() < 1e-6);
    assert!((Area::eroded(lanelet, 0.3).size() - 199.4 * 2.9).abs() < 1e-6);
    assert!(Area::eroded(lanelet, 1.8).size() < 1e-6);
}

#[test]
fn neighbours_and_successors_do_not_overlap_but_crossings_forks_and_merges_do() {
    let table = |road: &RoadNetwork| Overlaps::new(road, 0.3, 0.1);
    let lanes = table(&straight_road(2));
    assert!(lanes.of(0, 0) && !lanes.of(0, 1));
    assert!(table(&crossing()).of(0, 1));
    let fork = table(&fork());
    assert!(!fork.of(0, 1) && !fork.of(0, 2) && fork.of(1, 2));
    let merge = table(&merge());
    assert!(merge.of(0, 1) && !merge.of(0, 2));
}

#[test]
fn a_footprint_is_on_the_lanelets_that_it_reaches_into() {
    let road = straight_road(2);
    let table = Overlaps::new(&road, 0.3, 0.1);
    let car = Shape::rectangle(5.0, 2.0);
    for (y, expected) in [(0.0, vec![0]), (0.9, vec![0]), (1.2, vec![0, 1]), (3.5, vec![1]), (-20.0, vec![])] {
        assert_eq!(table.under(&road, &car, Pose::new(50.0, y, 0.0)), expected, "{y}");
    }
}

fn polygon(corners: &[(f64, f64)]) -> Vec<Point> {
    corners.iter().map(|(x, y)| Point::new(*x, *y)).collect()
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
}

#[track_caller]
fn same_points(found: &[Point], expected: &[(f64, f64)]) {
    let is_same = |(a, b): (&Point, &(f64, f64))| a.distance(Point::new(b.0, b.1)) < 1e-9;
    assert!(found.len() == expected.len() && found.iter().zip(expected).all(is_same), "{found:?}, not {expected:?}");
}

#[test]
fn an_area_is_positive_counter_clockwise_wherever_it_lies() {
    for (x, y) in [(0.0, 0.0), (100.0, -700.0)] {
        let mut triangle = polygon(&[(x, y), (x + 4.0, y), (x + 1.0, y + 3.0)]);
        near(area(&triangle), 6.0);
        triangle.reverse();
        near(area(&triangle), -6.0);
        near(area(&polygon(&[(x, y), (x + 5.0, y), (x + 4.0, y + 2.0), (x + 1.0, y + 2.0)])), 8.0);
    }
}

#[test]
fn a_line_cuts_off_what_is_behind_it_and_keeps_what_is_on_it() {
    let quad = polygon(&[(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]);
    for (x, expected) in [
        (0.0, vec![(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]),
        (-1.0, vec![(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]),
        (1.0, vec![(1.0, 0.0), (4.0, 0.0), (4.0, 2.0), (1.0, 2.0)]),
        (4.0, vec![(4.0, 0.0), (4.0, 2.0)]),
        (5.0, vec![]),
    ] {
        same_points(&clip(&quad, Point::new(x, 7.0), Point::new(1.0, 0.0)), &expected);
    }
    // The other side, with a normal of another length: from x = 0 to 3.
    let rest = clip(&quad, Point::new(3.0, 0.0), Point::new(-2.0, 0.0));
    same_points(&rest, &[(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)]);
    // Obliquely through (1, 0) and (3, 2).
    let half = clip(&quad, Point::new(1.0, 0.0), Point::new(1.0, -1.0));
    same_points(&half, &[(1.0, 0.0), (4.0, 0.0), (4.0, 2.0), (3.0, 2.0)]);
}

#[test]
fn an_inset_line_is_moved_to_its_left() {
    let quad = square(0.0, 0.0, 4.0);
    // From (1, 4) down to (1, 0) its left is x > 1.
    let rest = clipped(&quad, Point::new(1.0, 4.0), Point::new(1.0, 0.0), 0.5);
    same_points(&rest, &[(1.5, 0.0), (4.0, 0.0), (4.0, 4.0), (1.5, 4.0)]);
    assert_eq!(clipped(&quad, Point::new(1.0, 1.0), Point::new(1.0, 1.0), 0.5), quad, "a line without direction");
}

#[test]
fn common_areas_of_oblique_polygons() {
    let quad = square(0.0, 0.0, 4.0);
    for (other, expected) in [
        // Its right half reaches in: from (0, 1) to (2, 2) to (0, 3).
        (polygon(&[(-2.0, 2.0), (0.0, 1.0), (2.0, 2.0), (0.0, 3.0)]), 2.0),
        // The corner x + y < 2.
        (polygon(&[(-2.0, -2.0), (4.0, -2.0), (-2.0, 4.0)]), 2.0),
        // All of it.
        (polygon(&[(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)]), 16.0),
        (polygon(&[(5.0, 5.0), (6.0, 5.0), (6.0, 6.0)]), 0.0),
    ] {
        near(area(&intersection(&quad, &other)), expected);
        near(area(&intersection(&other, &quad)), expected);
    }
    assert!(intersection(&quad, &square(9.0, 0.0, 1.0)).is_empty());
}

#[test]
fn a_bound_keeps_its_distance_when_it_is_moved() {
    let straight = polygon(&[(0.0, 0.0), (1.0, 0.0), (5.0, 0.0)]);
    same_points(&shifted(&straight, 2.0), &[(0.0, 2.0), (1.0, 2.0), (5.0, 2.0)]);
    same_points(&shifted(&straight, -2.0), &[(0.0, -2.0), (1.0, -2.0), (5.0, -2.0)]);
    let corner = polygon(&[(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)]);
    same_points(&shifted(&corner, 1.0), &[(0.0, 1.0), (3.0, 1.0), (3.0, 3.0)]);
    same_points(&shifted(&corner, -1.0), &[(0.0, -1.0), (5.0, -1.0), (5.0, 3.0)]);
}

#[test]
fn a_sharp_bend_moves_its_vertex_at_most_twice_as_far() {
    // Turns by 150 degrees: the exact place would be 1 / cos 75 degrees = 3.9 times as far away.
    let turn = 150.0_f64.to_radians();
    let tip = Point::new(4.0, 0.0);
    let found = shifted(&[Point::default(), tip, tip + Point::from_angle(turn) * 4.0], 0.5)[1];
    let bisector = Point::from_angle(0.5 * turn).left();
    assert!(found.distance(tip + bisector) < 1e-9, "{found:?}");
    // Back on itself there is no bisector: the side behind counts.
    let back = shifted(&polygon(&[(0.0, 0.0), (4.0, 0.0), (1.0, 0.0)]), 0.5);
    same_points(&back, &[(0.0, 0.5), (4.0, -0.5), (1.0, -0.5)]);
}

#[test]
fn vertices_on_each_other_move_with_their_neighbours() {
    let doubled = polygon(&[(0.0, 0.0), (0.0, 0.0), (4.0, 0.0), (4.0, 0.0), (4.0, 3.0), (4.0, 3.0)]);
    let expected = [(0.0, 1.0), (0.0, 1.0), (3.0, 1.0), (3.0, 1.0), (3.0, 3.0), (3.0, 3.0)];
    same_points(&shifted(&doubled, 1.0), &expected);
    let point = polygon(&[(2.0, 1.0), (2.0, 1.0)]);
    assert_eq!(shifted(&point, 1.0), point);
}

#[test]
fn the_strip_between_bounds_is_convex_pieces_without_what_is_inside_out() {
    let size = |pieces: &[Vec<Point>]| pieces.iter().map(|piece| area(piece)).sum::<f64>();
    let is_convex = |piece: &Vec<Point>| {
        let n = piece.len();
        (0..n).all(|i| {
            let [a, b, c] = [0, 1, 2].map(|k| piece[(i + k) % n]);
            (b - a).cross(c - b) >= 0.0
        })
    };
    for (left, right, n, expected) in [
        // Two quads.
        ([(0.0, 2.0), (3.0, 2.0), (5.0, 3.0)], [(0.0, 0.0), (3.0, 0.0), (5.0, 0.0)], 2, 6.0 + 5.0),
        // The right bound has a dent at (1, 1): the first quad is cut there, whichever corner it is.
        ([(0.0, 4.0), (1.0, 2.0), (9.0, 2.0)], [(0.0, 0.0), (4.0, 0.0), (9.0, 0.0)], 3, 6.0 + 13.0),
        ([(0.0, 4.0), (4.0, 4.0), (9.0, 4.0)], [(0.0, 0.0), (1.0, 2.0), (9.0, 2.0)], 3, 6.0 + 13.0),
        // Both bounds on each other at the end.
        ([(0.0, 2.0), (3.0, 2.0), (5.0, 0.0)], [(0.0, 0.0), (3.0, 0.0), (5.0, 0.0)], 2, 6.0 + 2.0),
        // The wrong way round there is nothing.
        ([(0.0, 0.0), (3.0, 0.0), (5.0, 0.0)], [(0.0, 2.0), (3.0, 2.0), (5.0, 2.0)], 0, 0.0),
    ] {
        let pieces = strip(&polygon(&left), &polygon(&right));
        assert!(pieces.iter().all(is_convex), "{pieces:?}");
        near(size(&pieces), expected);
        assert_eq!(pieces.len(), n, "{left:?}");
    }
}

#[test]
fn bounds_that_cross_leave_the_part_in_front_of_the_crossing() {
    // From 2 m wide to 1 m inside out over 3 m.
    let pieces = strip(&polygon(&[(0.0, 2.0), (3.0, 0.0)]), &polygon(&[(0.0, 0.0), (3.0, 1.0)]));
    assert_eq!(pieces.len(), 1);
    assert!(pieces.iter().all(|piece| area(piece) > 0.0));
}

#[test]
fn an_oblique_end_is_eroded_at_right_angles_to_itself() {
    // Both ends lean by 45 degrees: the bounds are 4 m apart, from x = 4 to 34 and from 0 to 30.
    let bound = |from: f64, y: f64| (0..=30).map(|i| Point::new(from + f64::from(i), y)).collect::<Vec<_>>();
    let mut inputs = vec![lane(1, &straight((0.0, 2.0), (34.0, 2.0)))];
    (inputs[0].left, inputs[0].right) = (bound(4.0, 4.0), bound(0.0, 0.0));
    let road = open(inputs);
    let eroded = Area::eroded(&road.lanelets()[0], 0.5);
    // 3 m wide; along x each end loses 0.5 / cos 45 degrees.
    near(eroded.size(), 3.0 * (30.0 - 2.0 * 0.5 * 2f64.sqrt()));
    near(Area::of_lanelet(&road.lanelets()[0]).size(), 120.0);
}

#[test]
fn footprints_are_areas_at_their_pose() {
    let pose = Pose::new(10.0, 20.0, std::f64::consts::FRAC_PI_2);
    let car = Area::of_footprint(&Shape::rectangle_at(4.0, 2.0, Point::new(1.0, 0.0), 0.0), pose);
    near(car.size(), 8.0);
    // The body reaches from -1 to 3 m ahead, which is y = 19 to 23.
    let around = car.around.expect("a footprint");
    same_points(&[around.min, around.max], &[(9.0, 19.0), (11.0, 23.0)]);
    // A circle is a polygon of 32 corners.
    let disc = Area::of_footprint(&Shape::circle_at(2.0, Point::new(3.0, 0.0)), pose);
    near(disc.size(), 0.5 * 32.0 * 4.0 * (std::f64::consts::TAU / 32.0).sin());
    let around = disc.around.expect("a footprint");
    same_points(&[around.min, around.max], &[(8.0, 21.0), (12.0, 25.0)]);
    let group = Shape::group(vec![Shape::rectangle(4.0, 2.0), Shape::rectangle(2.0, 2.0)]);
    near(Area::of_footprint(&group, pose).size(), 12.0);
}

#[test]
fn what_two_areas_share_is_an_area_and_a_shape() {
    let of = |corners: &[(f64, f64, f64)]| Area::from_pieces(corners.iter().map(|(x, y, size)| square(*x, *y, *size)));
    // Two squares each: they share 1 x 1 and 2 x 2.
    let (a, b) = (of(&[(0.0, 0.0, 2.0), (10.0, 0.0, 2.0)]), of(&[(1.0, 1.0, 4.0), (9.0, -1.0, 6.0)]));
    near(a.intersection(&b).size(), 5.0);
    for (least, expected) in [(0.5, true), (4.5, true), (5.0, false), (6.0, false)] {
        assert_eq!((a.shares(&b, least), b.shares(&a, least)), (expected, expected), "{least}");
    }
    let (shape, origin) = a.intersection(&b).shape().expect("two pieces");
    // Around (1, 0) to (12, 2).
    same_points(&[origin], &[(6.5, 1.0)]);
    let place = Pose { position: origin, orientation: 0.0 };
    for (x, y, expected) in [(1.5, 1.5, true), (11.9, 0.1, true), (0.5, 0.5, false), (6.5, 1.0, false)] {
        assert_eq!(shape.contains(place, Point::new(x, y)), expected, "{x} {y}");
    }
    let nothing = of(&[(0.0, 0.0, 1.0)]).intersection(&of(&[(5.0, 5.0, 1.0)]));
    assert!(nothing.size() == 0.0 && nothing.shape().is_none());
    assert!(!nothing.shares(&a, 0.0) && !a.shares(&nothing, 0.0));
    assert_eq!(of(&[(0.0, 0.0, 1e-5)]).size(), 0.0, "rounding is no area");
}

#[test]
fn the_table_of_overlaps_holds_for_many_lanelets() {
    let mut inputs = parallel_lanes(11, 100.0);
    inputs.push(lane(20, &straight((50.0, -30.0), (50.0, 70.0))));
    let table = Overlaps::new(&open(inputs), 0.3, 0.1);
    for a in 0..12 {
        for b in 0..12 {
            assert_eq!(table.of(a, b), a == b || a == 11 || b == 11, "{a} {b}");
        }
    }
}
