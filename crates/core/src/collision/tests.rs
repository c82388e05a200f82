use super::*;
use crate::geometry::shape::Lcg;
use crate::road::testing::{arc, lane, open};
use crate::road::{LaneletInput, RoadJudge, RoadSettings};
use std::f64::consts::{FRAC_PI_2, PI};

fn car() -> Shape {
    Shape::rectangle(4.0, 2.0)
}

fn at(x: f64, y: f64, orientation: f64) -> Pose {
    Pose::new(x, y, orientation)
}

/// The fraction, wherever in the world and in whichever order the two bodies are given.
fn contact(a: &Shape, a0: Pose, a1: Pose, b: &Shape, b0: Pose, b1: Pose) -> Option<f64> {
    let found = first_contact(a, a0, a1, b, b0, b1);
    let frame = at(400.0, -9000.0, 1.3);
    let moved = |p: Pose| Pose {
        position: frame.world_from_body(p.position),
        orientation: wrap_angle(p.orientation + frame.orientation),
    };
    let elsewhere = first_contact(b, moved(b0), moved(b1), a, moved(a0), moved(a1));
    match (found, elsewhere) {
        (Some(here), Some(there)) => assert!((here - there).abs() < 2e-4, "{here} {there}"),
        _ => assert_eq!(found, elsewhere),
    }
    found
}

#[test]
fn the_fraction_of_straight_contacts_agrees_with_hand_computed_values() {
    let motorcycle = || Shape::rectangle(2.0, 0.8);
    let pole = || Shape::circle(0.1);
    let wall = || Shape::rectangle(30.0, 0.2);
    let table = [
        // Two motorcycles at 50 m/s for 0.1 s on crossing roads: fronts at -1.5 + 5 t, sides at -0.4.
        (
            motorcycle(),
            at(-2.5, 0.0, 0.0),
            at(2.5, 0.0, 0.0),
            motorcycle(),
            at(0.0, -2.5, FRAC_PI_2),
            at(0.0, 2.5, FRAC_PI_2),
            Some(0.22),
        ),
        // Two poles pass through each other at 2000 m/s: 100 - 200 t = 0.2.
        (pole(), at(-50.0, 0.0, 0.0), at(50.0, 0.0, 0.0), pole(), at(50.0, 0.0, 0.0), at(-50.0, 0.0, 0.0), Some(0.499)),
        // Through a thin wall: front at 2 + 100 t, wall from 9.9.
        (
            car(),
            at(0.0, 0.0, 0.0),
            at(100.0, 0.0, 0.0),
            wall(),
            at(10.0, 0.0, FRAC_PI_2),
            at(10.0, 0.0, FRAC_PI_2),
            Some(0.079),
        ),
        // Rear-end: gap 1 m, 4 m/s faster over 0.5 s.
        (car(), at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0), car(), at(5.0, 0.0, 0.0), at(13.0, 0.0, 0.0), Some(0.5)),
        // Opposite lanes, 5 mm between the sides.
        (car(), at(-20.0, 0.0, 0.0), at(20.0, 0.0, 0.0), car(), at(20.0, 2.005, PI), at(-20.0, 2.005, PI), None),
        // The same with 5 mm of overlap: fronts meet at 36 - 80 t = 0.
        (car(), at(-20.0, 0.0, 0.0), at(20.0, 0.0, 0.0), car(), at(20.0, 1.995, PI), at(-20.0, 1.995, PI), Some(0.45)),
        // One crosses just behind the other.
        (car(), at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0), pole(), at(-2.2, -5.0, 0.0), at(-2.2, 5.0, 0.0), None),
        // In contact from the start, and parting.
        (car(), at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0), car(), at(3.0, 0.0, 0.0), at(9.0, 0.0, 0.0), Some(0.0)),
        // Touching exactly at the end.
        (car(), at(0.0, 0.0, 0.0), at(3.0, 0.0, 0.0), car(), at(7.0, 0.0, 0.0), at(7.0, 0.0, 0.0), Some(1.0)),
        (car(), at(0.0, 0.0, 0.0), at(2.99, 0.0, 0.0), car(), at(7.0, 0.0, 0.0), at(7.0, 0.0, 0.0), None),
        // Neither moves.
        (car(), at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0), car(), at(0.0, 2.1, 0.0), at(0.0, 2.1, 0.0), None),
    ];
    for (case, (a, a0, a1, b, b0, b1, expected)) in table.into_iter().enumerate() {
        match (contact(&a, a0, a1, &b, b0, b1), expected) {
            (Some(found), Some(expected)) => {
                assert!((found - expected).abs() < 1e-4, "case {case}: {found}, not {expected}")
            }
            (found, expected) => assert_eq!(found, expected, "case {case}"),
        }
    }
}

#[test]
fn a_car_that_only_turns_hits_the_pole_beside_it() {
    // In the car's frame the pole is at 1.5 (sin, cos) of the turn; contact at 1.5 cos = 1 + 0.1.
    let pole = (Shape::circle(0.1), at(0.0, 1.5, 0.0));
    let expected = (1.1f64 / 1.5).acos() / FRAC_PI_2;
    let found = contact(&car(), at(0.0, 0.0, 0.0), at(0.0, 0.0, FRAC_PI_2), &pole.0, pole.1, pole.1);
    assert!((found.expect("the side sweeps over the pole") - expected).abs() < 1e-4);
}

#[test]
fn a_body_turns_the_shorter_way() {
    // From 170 to -170 degrees over 180 the ends of the car stay away from a pole at its side.
    let pole = (Shape::circle(0.1), at(0.0, 1.5, 0.0));
    let (from, to) = (at(0.0, 0.0, PI - 0.17), at(0.0, 0.0, -PI + 0.17));
    assert_eq!(contact(&car(), from, to, &pole.0, pole.1, pole.1), None);
}

#[test]
fn a_round_body_may_spin_beside_a_wall() {
    let wall = (Shape::rectangle(30.0, 2.0), at(0.0, 2.001, 0.0));
    assert_eq!(contact(&Shape::circle(1.0), at(0.0, 0.0, 0.0), at(5.0, 0.0, 3.0), &wall.0, wall.1, wall.1), None);
}

#[test]
fn every_part_of_a_group_counts_and_the_earliest_contact_is_reported() {
    let trailer = Shape::group(vec![Shape::rectangle_at(2.0, 2.0, Point::new(-10.0, 0.0), 0.0), car()]);
    let pole = Shape::circle(0.5);
    // The pole crosses the gap between the parts, or meets the front at 10 - 20 t = 2.5.
    assert_eq!(
        contact(&trailer, at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0), &pole, at(-5.5, -9.0, 0.0), at(-5.5, 9.0, 0.0)),
        None
    );
    let found = contact(&trailer, at(0.0, 0.0, 0.0), at(0.0, 0.0, 0.0), &pole, at(10.0, 0.0, 0.0), at(-10.0, 0.0, 0.0));
    assert!((found.expect("head-on") - 0.375).abs() < 1e-4);
}

fn shapes() -> [Shape; 5] {
    let points = |list: &[(f64, f64)]| list.iter().map(|(x, y)| Point::new(*x, *y)).collect::<Vec<_>>();
    [
        Shape::rectangle(4.5, 1.8),
        Shape::rectangle_at(8.0, 2.5, Point::new(1.5, 0.0), 0.2),
        Shape::circle_at(0.4, Point::new(0.3, 0.1)),
        Shape::polygon(&points(&[(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0)]))
            .expect("an L"),
        Shape::group(vec![Shape::circle_at(0.5, Point::new(-3.0, 0.0)), Shape::rectangle(3.0, 1.0)]),
    ]
}

fn random_mover<'a>(random: &mut Lcg, shapes: &'a [Shape], half_size: f64) -> Mover<'a> {
    let shape = &shapes[random.within(0.0, shapes.len() as f64 - 1e-9) as usize];
    let from = at(random.within(-half_size, half_size), random.within(-half_size, half_size), random.within(-PI, PI));
    let to = Pose {
        position: from.position + Point::new(random.within(-8.0, 8.0), random.within(-8.0, 8.0)),
        orientation: wrap_angle(from.orientation + random.within(-2.5, 2.5)),
    };
    Mover { shape, from, to }
}

#[test]
fn random_motions_agree_with_dense_sampling() {
    const SAMPLES: usize = 1000;
    let (shapes, mut random) = (shapes(), Lcg::new(5));
    let mut counts = [0, 0];
    for round in 0..1000 {
        let [a, b] = [random_mover(&mut random, &shapes, 6.0), random_mover(&mut random, &shapes, 6.0)];
        let (motion_a, motion_b) = (RigidMotion::new(a.from, a.to), RigidMotion::new(b.from, b.to));
        let distance = |t: f64| a.shape.distance(motion_a.pose_at(t), b.shape, motion_b.pose_at(t));
        let sampled = (0..=SAMPLES).map(|i| i as f64 / SAMPLES as f64).find(|t| distance(*t) == 0.0);
        let found = first_contact(a.shape, a.from, a.to, b.shape, b.from, b.to);
        if let Some(found) = found {
            assert!(distance(found) <= CONTACT_DISTANCE, "{round}: apart at the reported contact");
        }
        if let Some(sampled) = sampled {
            assert!(found.is_some_and(|found| found <= sampled), "{round}: {found:?} after {sampled}");
        }
        counts[usize::from(found.is_some())] += 1;
    }
    assert!(counts.iter().all(|n| *n > 200), "{counts:?}: the sample must hold both cases");
}

/// Contacts of those of which one is wanted, by trying all pairs.
fn contacts_by_trying(movers: &[Mover<'_>], is_wanted: impl Fn(usize) -> bool) -> Vec<(usize, usize, f64)> {
    let mut found = Vec::new();
    for (i, a) in movers.iter().enumerate() {
        for (j, b) in movers.iter().enumerate().skip(i + 1).filter(|(j, _)| is_wanted(i) || is_wanted(*j)) {
            let contact = first_contact(a.shape, a.from, a.to, b.shape, b.from, b.to);
            found.extend(contact.map(|fraction| (i, j, fraction)));
        }
    }
    found
}

#[test]
fn the_broad_phase_finds_what_trying_all_pairs_finds_in_ascending_order() {
    // A body without parts is nowhere.
    let shapes: Vec<_> = shapes().into_iter().chain([Shape::group(Vec::new())]).collect();
    let mut memory = ContactMemory::default();
    // Bodies, half the side of their square [m], and which one of so many is wanted: few are tried one by one in boxes
    // that hold them however they turn, many are sorted by narrow boxes; 20 and 25 of 100 are on both sides of that.
    for (seed, n, half_size, every) in [
        (1, 80, 10.0, 40),
        (2, 80, 40.0, 4),
        (3, 80, 120.0, 1),
        (4, 100, 30.0, 5),
        (5, 100, 30.0, 4),
        (6, 100, 60.0, 1),
    ] {
        let mut random = Lcg::new(seed);
        let mut movers: Vec<Mover> = (0..n).map(|_| random_mover(&mut random, &shapes, half_size)).collect();
        movers[3].to = movers[3].from;
        let is_wanted = |i: usize| i.is_multiple_of(every);
        let expected = contacts_by_trying(&movers, is_wanted);
        assert!(!expected.is_empty());
        find_contacts(n, |i| movers[i], is_wanted, &mut memory);
        assert_eq!(memory.found, expected, "{n} bodies, one of {every}");
        // What was found before is forgotten where nobody is wanted.
        find_contacts(n, |i| movers[i], |_| false, &mut memory);
        assert_eq!(memory.found, []);
    }
}

#[test]
fn both_boxes_hold_what_a_body_covers_and_narrow_ones_little_more() {
    let (shapes, mut random) = (shapes(), Lcg::new(9));
    let holds = |outer: &Aabb, inner: &Aabb| {
        outer.min.x <= inner.min.x + 1e-9
            && outer.min.y <= inner.min.y + 1e-9
            && outer.max.x >= inner.max.x - 1e-9
            && outer.max.y >= inner.max.y - 1e-9
    };
    for round in 0..500 {
        let mover = random_mover(&mut random, &shapes, 6.0);
        let (motion, narrow, wide) = (RigidMotion::new(mover.from, mover.to), narrow_box(&mover), wide_box(&mover));
        for look in 0..=20 {
            let covered = mover.shape.aabb(motion.pose_at(f64::from(look) / 20.0));
            assert!(holds(&narrow, &covered) && holds(&wide, &covered), "{round}: {covered:?}");
        }
        let least = mover.shape.aabb(mover.from).union(mover.shape.aabb(mover.to));
        let turn = wrap_angle(mover.to.orientation - mover.from.orientation);
        let arc = mover.shape.bounding_radius() * (1.0 - (0.5 * turn).cos());
        assert!(holds(&least.grown(arc + 2.0 * CONTACT_DISTANCE), &narrow), "{round}: wider than the arc");
    }
}

#[test]
fn without_others_there_is_no_contact() {
    assert_eq!(contacts(&[], |_| true), []);
}

#[test]
fn one_look_at_a_motion_finds_it_inside_the_lanelets_only_if_many_looks_do() {
    let (car, mut random) = (Shape::rectangle(4.5, 1.8), Lcg::new(7));
    let roads = [straight_road(), bent_road()];
    let mut counts = [0, 0];
    for round in 0..2000 {
        let road = &roads[round % 2];
        let mut pose = || Pose::new(random.within(4.0, 12.0), random.within(-1.2, 1.2), random.within(-0.4, 0.4));
        let (from, by) = (pose(), pose());
        let to = Pose {
            position: from.position.lerp(by.position, 0.1),
            orientation: from.orientation + 0.4 * by.orientation,
        };
        let found = stays_inside(road, &car, (from, to));
        counts[usize::from(found)] += 1;
        if found {
            let motion = RigidMotion::new(from, to);
            for pose in (0..=50).map(|look| motion.pose_at(f64::from(look) / 50.0)) {
                assert!(road.covers(&car, pose), "{round}: {pose:?}");
                assert_eq!(road.overhang(&car, pose, &mut Vec::new()), 0.0, "{round}: {pose:?}");
            }
        }
    }
    assert!(counts.iter().all(|n| *n > 100), "{counts:?}: the sample must hold both cases");
}

/// A lane 3.5 m wide around (0, 60), through the origin along x.
fn bent_road() -> RoadNetwork {
    open(vec![lane(1, &arc((0.0, 60.0), 60.0, -FRAC_PI_2, 0.0))])
}

/// One straight lane along x, 4 m wide, 200 m long.
fn straight_road() -> RoadNetwork {
    let border = |y: f64| (0..=20).map(|i| Point::new(f64::from(i) * 10.0, y)).collect::<Vec<_>>();
    let lanelet = LaneletInput::between(1, border(2.0), border(-2.0));
    let settings = RoadSettings { judge: RoadJudge::Body, ..RoadSettings::default() };
    RoadNetwork::new(vec![lanelet], settings).expect("one lanelet")
}

/// The judge looks at the footprint here, so its parameters do not matter.
const VEHICLE: Vehicle = Vehicle::BMW_320I;

#[test]
fn a_car_departs_when_its_footprint_crosses_the_border_even_if_it_comes_back() {
    let road = straight_road();
    let ahead = at(100.0, 0.0, 0.0);
    assert_eq!(departs_road(&road, &car(), &VEHICLE, ahead, at(110.0, 0.9, 0.0)), None);
    // Its side reaches the border of the lane, 1 m away, after a third of the way; the road may allow 0.1 m more.
    let found = departs_road(&road, &car(), &VEHICLE, ahead, at(103.0, 3.0, 0.0)).expect("3 m to the side");
    assert!((0.33..=0.46).contains(&found), "{found}");
    // Crosswise it sticks out in the middle of half a turn, and fits at both ends.
    assert!(departs_road(&road, &Shape::rectangle(4.6, 1.0), &VEHICLE, ahead, at(100.0, 0.0, PI)).is_some());
    assert_eq!(departs_road(&road, &car(), &VEHICLE, at(100.0, 3.0, 0.0), ahead), Some(0.0));
}

#[test]
fn a_gap_in_the_road_is_found_where_the_footprint_first_reaches_into_it() {
    // Lanes of 4 m from x = 0 to 50 and from 52 to 100; the front of the car is 2 m ahead of its centre.
    let border = |from: f64, to: f64, y: f64| vec![Point::new(from, y), Point::new(to, y)];
    let lanelet = |id, from, to| LaneletInput::between(id, border(from, to, 2.0), border(from, to, -2.0));
    let road = crate::road::testing::closed(vec![lanelet(1, 0.0, 50.0), lanelet(2, 52.0, 100.0)]);
    // Looked at every 0.25 m of 50 m; the map may be wrong by 0.1 m.
    let found =
        departs_road(&road, &car(), &VEHICLE, at(30.0, 0.0, 0.0), at(80.0, 0.0, 0.0)).expect("it drives over the gap");
    assert!((0.36..=0.3675).contains(&found), "{found}");
    assert_eq!(departs_road(&road, &car(), &VEHICLE, at(30.0, 0.0, 0.0), at(47.9, 0.0, 0.0)), None);
    let found =
        departs_road(&road, &car(), &VEHICLE, at(30.0, 0.0, 0.0), at(48.5, 0.0, 0.0)).expect("its front is in the gap");
    assert!(found > 0.97, "{found}");
}

#[test]
fn a_swept_box_per_interval_holds_the_footprint_at_both_ends() {
    let poses = [at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0), at(18.0, 3.0, 0.6)];
    let boxes = swept_boxes(&poses, 4.0, 2.0);
    assert_eq!(boxes.len(), 2);
    for (swept, pair) in boxes.iter().zip(poses.windows(2)) {
        for corner in pair.iter().flat_map(|pose| OrientedBox::new(*pose, 4.0, 2.0).corners()) {
            let away = corner - swept.center;
            assert!(away.dot(swept.axis).abs() <= swept.half_length + 1e-9, "{corner:?} in {swept:?}");
            assert!(away.dot(swept.axis.left()).abs() <= swept.half_width + 1e-9, "{corner:?} in {swept:?}");
        }
    }
    assert!((boxes[0].half_length - 7.0).abs() < 1e-9 && (boxes[0].half_width - 1.0).abs() < 1e-9, "{:?}", boxes[0]);
}

#[test]
fn a_long_body_that_turns_in_place_is_found_by_the_broad_phase() {
    // At both ends of half a turn it lies along x; in the middle it reaches the pole 9 m away.
    let (bar, pole) = (Shape::rectangle(20.0, 0.2), Shape::circle(0.1));
    let turning = Mover { shape: &bar, from: at(0.0, 0.0, 0.0), to: at(0.0, 0.0, 3.0) };
    let standing = |y: f64| Mover { shape: &pole, from: at(0.0, y, 0.0), to: at(0.0, y, 0.0) };
    // Half the width before the bar stands upright: (pi / 2 - asin(0.2 / 9)) / 3 of the turn.
    let found = contacts(&[standing(9.0), turning], |_| true);
    let [(0, 1, fraction)] = found[..] else { panic!("{found:?}") };
    assert!((fraction - (0.5 * PI - (0.2_f64 / 9.0).asin()) / 3.0).abs() < 1e-4, "{fraction}");
    assert_eq!(contacts(&[standing(10.2), turning], |_| true), []);
    // The same from almost upright to almost upright, through the pole on the x axis.
    let turning = Mover { shape: &bar, from: at(0.0, 0.0, -1.5), to: at(0.0, 0.0, 1.5) };
    let beside = Mover { shape: &pole, from: at(9.0, 0.0, 0.0), to: at(9.0, 0.0, 0.0) };
    let found = contacts(&[turning, beside], |_| true);
    let [(0, 1, fraction)] = found[..] else { panic!("{found:?}") };
    assert!((fraction - (1.5 - (0.2_f64 / 9.0).asin()) / 3.0).abs() < 1e-4, "{fraction}");
}

#[test]
fn a_body_off_its_origin_is_met_where_it_is_and_not_where_its_origin_is() {
    let remote = Shape::rectangle_at(2.0, 2.0, Point::new(0.0, 10.0), 0.0);
    let (pole, still) = (Shape::circle(0.5), at(0.0, 0.0, 0.0));
    // The pole passes the origin: nothing. It passes y = 10: contact at x = -1.5 of -10 to 10.
    assert_eq!(contact(&remote, still, still, &pole, at(-10.0, 0.0, 0.0), at(10.0, 0.0, 0.0)), None);
    let found = contact(&remote, still, still, &pole, at(-10.0, 10.0, 0.0), at(10.0, 10.0, 0.0));
    assert!((found.expect("it passes through") - 8.5 / 20.0).abs() < 1e-4);
    // Quarter of a turn swings it over (-10, 0).
    let swung = contact(&remote, still, at(0.0, 0.0, FRAC_PI_2), &pole, at(-10.0, 0.0, 0.0), at(-10.0, 0.0, 0.0));
    assert!((0.8..1.0).contains(&swung.expect("it swings over the pole")));
}
