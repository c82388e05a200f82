use super::*;
use crate::geometry::shape::Lcg;

/// A car of 4 m by 2 m along x unless turned.
fn car() -> Shape {
    Shape::rectangle(4.0, 2.0)
}

/// Which bodies are seen from the origin; all are wanted, all hide others.
fn seen(bodies: &[(&Shape, Pose)]) -> Vec<bool> {
    let bodies: Vec<SightBody<'_>> =
        bodies.iter().map(|(shape, pose)| SightBody { shape, pose: *pose, hides: true, is_wanted: true }).collect();
    seen_from(Point::default(), &bodies)
}

#[test]
fn a_car_is_seen_unless_nearer_bodies_take_all_of_its_directions() {
    let (car, truck, wall) = (car(), Shape::rectangle(10.0, 2.5), Shape::rectangle(0.5, 8.0));
    let pole = Shape::circle(0.2);
    // The truck covers [10, 20] x [-1.25, 1.25]: its rear takes the slopes y/x up to 0.125.
    let truck_ahead = (&truck, Pose::new(15.0, 0.0, 0.0));
    for (name, bodies, expected) in [
        ("nothing in between", vec![(&car, Pose::new(30.0, 0.0, 0.0))], vec![true]),
        // The car covers [28, 32] x [-1, 1]: slopes up to 1/28 = 0.036.
        ("behind the truck", vec![truck_ahead, (&car, Pose::new(30.0, 0.0, 0.0))], vec![true, false]),
        // [28, 32] x [2.6, 4.6]: slopes from 2.6/32 = 0.081 to 4.6/28 = 0.164.
        ("half behind the truck", vec![truck_ahead, (&car, Pose::new(30.0, 3.6, 0.0))], vec![true, true]),
        // [28, 32] x [1.4, 3.4]: up to 3.4/28 = 0.1214.
        ("just hidden", vec![truck_ahead, (&car, Pose::new(30.0, 2.4, 0.0))], vec![true, false]),
        // [28, 32] x [1.51, 3.51]: up to 3.51/28 = 0.12536.
        ("a corner sticks out", vec![truck_ahead, (&car, Pose::new(30.0, 2.51, 0.0))], vec![true, true]),
        // The wall covers [9.75, 10.25] x [-4, 4]: slopes up to 4/10.25 at least.
        (
            "behind a wall",
            vec![(&wall, Pose::new(10.0, 0.0, 0.0)), (&car, Pose::new(20.0, 5.0, 0.0))],
            vec![true, false],
        ),
        (
            "between the eye and the wall",
            vec![(&wall, Pose::new(10.0, 0.0, 0.0)), (&car, Pose::new(5.0, 0.0, 0.0))],
            vec![true, true],
        ),
        (
            "a pole hides no car",
            vec![(&pole, Pose::new(10.0, 0.0, 0.0)), (&car, Pose::new(20.0, 0.0, 0.0))],
            vec![true, true],
        ),
        // The pole at 19.8 m takes slopes up to 0.0101; the one at 40 m up to 0.005.
        (
            "a pole hides a pole",
            vec![(&pole, Pose::new(19.8, 0.0, 0.0)), (&pole, Pose::new(40.0, 0.0, 0.0))],
            vec![true, false],
        ),
        (
            "a pole beside it",
            vec![(&pole, Pose::new(19.8, 0.0, 0.0)), (&pole, Pose::new(40.0, 0.7, 0.0))],
            vec![true, true],
        ),
        // Two cars across, [9, 11] x [-4, 0] and x [0, 4], door to bumper: no gap. The third lies within slopes 0.1.
        (
            "behind two cars side by side",
            vec![
                (&car, Pose::new(10.0, -2.0, std::f64::consts::FRAC_PI_2)),
                (&car, Pose::new(10.0, 2.0, std::f64::consts::FRAC_PI_2)),
                (&car, Pose::new(30.0, 0.0, 0.0)),
            ],
            vec![true, true, false],
        ),
        // The same with a gap of 2 cm between them.
        (
            "seen through a gap",
            vec![
                (&car, Pose::new(10.0, -2.01, std::f64::consts::FRAC_PI_2)),
                (&car, Pose::new(10.0, 2.01, std::f64::consts::FRAC_PI_2)),
                (&car, Pose::new(30.0, 0.0, 0.0)),
            ],
            vec![true, true, true],
        ),
        ("behind the eye", vec![truck_ahead, (&car, Pose::new(-30.0, 0.0, 0.0))], vec![true, true]),
    ] {
        for turn in [0.0, 1.0, 2.5, -1.57, std::f64::consts::PI] {
            let frame = Pose::new(0.0, 0.0, turn);
            let turned: Vec<(&Shape, Pose)> = bodies
                .iter()
                .map(|(shape, pose)| {
                    let position = frame.world_from_body(pose.position);
                    (*shape, Pose { position, orientation: pose.orientation + turn })
                })
                .collect();
            assert_eq!(seen(&turned), expected, "{name}, turned by {turn}");
            let reversed: Vec<_> = turned.into_iter().rev().collect();
            let backwards: Vec<bool> = expected.iter().copied().rev().collect();
            assert_eq!(seen(&reversed), backwards, "{name}, turned by {turn}, in the other order");
        }
    }
}

#[test]
fn what_does_not_hide_hides_nothing_and_what_is_not_wanted_is_not_seen() {
    let (car, truck) = (car(), Shape::rectangle(10.0, 2.5));
    let (ahead, behind) = (Pose::new(15.0, 0.0, 0.0), Pose::new(30.0, 0.0, 0.0));
    for (hides, is_wanted, expected) in [
        (false, true, [true, true]),
        (true, true, [true, false]),
        (true, false, [false, false]),
        (false, false, [false, true]),
    ] {
        let bodies = [
            SightBody { shape: &truck, pose: ahead, hides, is_wanted },
            SightBody { shape: &car, pose: behind, hides: true, is_wanted: true },
        ];
        assert_eq!(seen_from(Point::default(), &bodies), expected, "{hides} {is_wanted}");
    }
}

#[test]
fn a_body_around_the_eye_is_seen_and_hides_nothing() {
    let (hall, car) = (Shape::rectangle(20.0, 20.0), car());
    assert_eq!(seen(&[(&hall, Pose::default()), (&car, Pose::new(30.0, 0.0, 0.0))]), [true, true]);
}

#[test]
fn a_body_of_several_parts_is_seen_if_any_of_them_is_and_does_not_hide_itself() {
    // Two posts behind a car that takes slopes up to 1/6: the one at slope 0.2 is not hidden. From the end both are in line.
    let posts = Shape::group(vec![
        Shape::rectangle_at(0.4, 0.4, Point::new(0.0, 4.0), 0.0),
        Shape::rectangle_at(0.4, 0.4, Point::new(0.0, 0.0), 0.0),
    ]);
    let car = car();
    assert_eq!(seen(&[(&posts, Pose::new(20.0, 0.0, 0.0)), (&car, Pose::new(8.0, 0.0, 0.0))]), [true, true]);
    assert_eq!(seen(&[(&posts, Pose::new(20.0, 0.0, std::f64::consts::FRAC_PI_2))]), [true]);
    // An L: a car in its corner is seen across it, not through its arm.
    let corner =
        [(0.0, 0.0), (6.0, 0.0), (6.0, 1.0), (1.0, 1.0), (1.0, 6.0), (0.0, 6.0)].map(|(x, y)| Point::new(x, y));
    let building = Shape::polygon(&corner).expect("a simple polygon");
    let small = Shape::rectangle(1.0, 1.0);
    let at = Pose::new(10.0, -3.0, 0.0);
    assert_eq!(seen(&[(&building, at), (&small, Pose::new(13.0, 0.0, 0.0))]), [true, false]);
    let at = Pose::new(10.0, 3.0, std::f64::consts::PI);
    assert_eq!(seen(&[(&building, at), (&small, Pose::new(8.0, 0.0, 0.0))]), [true, true]);
}

/// The same by casting many rays: a body that some ray meets first is seen.
fn by_rays(bodies: &[SightBody<'_>], n: usize) -> Vec<bool> {
    let mut seen = vec![false; bodies.len()];
    for i in 0..n {
        let direction = Point::from_angle(std::f64::consts::TAU * i as f64 / n as f64);
        let mut nearest: Option<(f64, usize)> = None;
        for (index, body) in bodies.iter().enumerate() {
            let [length, width] = [body.shape.extent().0, body.shape.extent().1].map(|size| 0.5 * size);
            // Slabs of the rectangle in its own frame.
            let eye = body.pose.body_from_world(Point::default());
            let ray = body.pose.body_from_world(direction) - eye;
            let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
            for (from, along, half) in [(eye.x, ray.x, length), (eye.y, ray.y, width)] {
                let (a, b) = ((-half - from) / along, (half - from) / along);
                enter = enter.max(a.min(b));
                leave = leave.min(a.max(b));
            }
            if enter < leave && nearest.is_none_or(|(distance, _)| enter < distance) {
                nearest = Some((enter, index));
            }
        }
        if let Some((_, index)) = nearest {
            seen[index] = true;
        }
    }
    seen
}

#[test]
fn random_crowds_are_seen_as_by_rays() {
    let mut random = Lcg::new(3);
    let (mut hidden, mut narrow) = (0, 0);
    for _ in 0..200 {
        let shapes: Vec<Shape> =
            (0..14).map(|_| Shape::rectangle(random.within(2.0, 9.0), random.within(0.5, 3.0))).collect();
        let mut bodies: Vec<SightBody<'_>> = Vec::new();
        for shape in &shapes {
            let pose = Pose::new(random.within(-35.0, 35.0), random.within(-35.0, 35.0), random.within(-3.0, 3.0));
            let apart =
                pose.position.norm() > 8.0 && bodies.iter().all(|other| !shape.overlaps(pose, other.shape, other.pose));
            if apart {
                bodies.push(SightBody { shape, pose, hides: true, is_wanted: true });
            }
        }
        let (exact, sampled) = (seen_from(Point::default(), &bodies), by_rays(&bodies, 20_000));
        for (index, (exact, sampled)) in exact.iter().zip(&sampled).enumerate() {
            // Rays may miss a gap narrower than 0.3 mrad; they never see what is not there.
            assert!(*exact || !sampled, "body {index} of {bodies:?} is met by a ray");
            narrow += usize::from(*exact && !sampled);
            hidden += usize::from(!exact);
        }
    }
    assert!(hidden > 200, "{hidden}: some body must be hidden");
    assert!(narrow <= 4, "{narrow} bodies are seen that no ray meets");
}
