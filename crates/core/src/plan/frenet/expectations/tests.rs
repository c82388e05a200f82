use super::*;
use crate::geometry::Pose;
use crate::geometry::shape::Lcg;

/// Half length and width of the agent [m].
const HALF: (f64, f64) = (2.254, 0.805);
/// Where maps in UTM coordinates are [m].
const FAR: Point = Point { x: 5e5, y: 5.3e6 };

fn waypoint(random: &mut Lcg) -> Waypoint {
    let center = FAR + Point::new(random.within(-300.0, 300.0), random.within(-300.0, 300.0));
    Waypoint { center, axis: Point::from_angle(random.within(-4.0, 4.0)), ..Waypoint::default() }
}

/// Body from a pedestrian to a long trailer, at a place in the frame of the agent.
fn body(point: &Waypoint, place: Point, random: &mut Lcg) -> OrientedBox {
    let position = point.center + point.axis * place.x + point.axis.left() * place.y;
    let (length, width) = [(0.5, 0.5), (4.5, 1.8), (18.0, 2.6)][random.within(0.0, 3.0) as usize];
    OrientedBox::new(Pose { position, orientation: random.within(-4.0, 4.0) }, length, width)
}

/// Variances from hardly any to wide ones, with any correlation.
fn covariance(random: &mut Lcg) -> [f64; 3] {
    let sigma = |random: &mut Lcg| 10f64.powf(random.within(-3.5, 1.3));
    let (x, y) = (sigma(random), sigma(random));
    [x * x, random.within(-1.0, 1.0) * x * y, y * y]
}

/// Expectations of one point, and whether each passes the sieve.
fn passing(expectations: &mut Expectations, point: &Waypoint) -> Vec<bool> {
    expectations.sort(2);
    let rough = RoughView::of(&View::of(point), expectations.origin, HALF);
    let by_point = &expectations.by_point;
    let mut passes = vec![false; expectations.list.len()];
    let (mut group, end) = by_point.groups(1);
    while group < end {
        let mut bits = by_point.passing(group, |numbers, k| rough.may_count(numbers, k));
        assert!(bits >> (by_point.of(1).len() - (group - by_point.groups(1).0)).min(GROUP) == 0, "filling passes");
        while bits != 0 {
            passes[by_point.number(group, bits)] = true;
            bits &= bits - 1;
        }
        group += GROUP;
    }
    passes
}

/// Pushes an expectation and finds the places along a direction between which `counts` changes.
fn borderline(point: &Waypoint, random: &mut Lcg) -> (OrientedBox, [f64; 3]) {
    let (way, covariance) = (Point::from_angle(random.within(-4.0, 4.0)), covariance(random));
    let at_centre = body(point, Point::default(), random);
    let turned = point.axis * way.x + point.axis.left() * way.y;
    let at = |distance: f64| OrientedBox { center: point.center + turned * distance, ..at_centre };
    let counts = |distance: f64| {
        let mut one = Expectations::default();
        one.push(1, &at(distance), covariance, 1.0, &FrenetSettings::default());
        View::of(point).counts(&one.list[0], HALF)
    };
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if counts(middle) { low = middle } else { high = middle }
    }
    (at(low), covariance)
}

#[test]
fn the_sieve_passes_every_expectation_that_counts_and_no_filling() {
    let mut random = Lcg::new(5);
    let (mut expectations, mut n_counting, mut n_sieved) = (Expectations::default(), 0, 0);
    for _ in 0..1500 {
        let point = waypoint(&mut random);
        let origin = point.center + Point::new(random.within(-300.0, 300.0), random.within(-300.0, 300.0));
        expectations.clear(origin);
        for _ in 0..random.within(1.0, 24.0) as usize {
            let (body, covariance) = if random.within(0.0, 1.0) < 0.4 {
                borderline(&point, &mut random)
            } else {
                let place = Point::new(random.within(-30.0, 30.0), random.within(-15.0, 15.0));
                (body(&point, place, &mut random), covariance(&mut random))
            };
            expectations.push(1, &body, covariance, 0.3, &FrenetSettings::default());
        }
        let passes = passing(&mut expectations, &point);
        for (expectation, passes) in expectations.list.iter().zip(passes) {
            let counts = View::of(&point).counts(expectation, HALF);
            assert!(passes || !counts, "{expectation:?} from {point:?}, origin {origin:?}");
            n_counting += usize::from(counts);
            n_sieved += usize::from(!passes);
        }
    }
    assert!(n_counting > 5000 && n_sieved > 5000, "{n_counting} count, {n_sieved} do not pass");
}

#[test]
fn wide_machines_find_the_same_cost() {
    let mut random = Lcg::new(6);
    let mut expectations = Expectations::default();
    let mut n_positive = 0;
    for _ in 0..300 {
        let point = waypoint(&mut random);
        expectations.clear(point.center + Point::new(random.within(-50.0, 50.0), 3.0));
        for _ in 0..random.within(0.0, 24.0) as usize {
            let place = Point::new(random.within(-12.0, 12.0), random.within(-6.0, 6.0));
            let body = body(&point, place, &mut random);
            expectations.push(1, &body, covariance(&mut random), 0.3, &FrenetSettings::default());
        }
        expectations.sort(2);
        let (narrow, wide) = (cost_at(&expectations, &point, 1, HALF), summed_cost(&expectations, &point, 1, HALF));
        assert_eq!(wide.to_bits(), narrow.to_bits(), "{wide} {narrow}");
        n_positive += usize::from(wide > 0.0);
    }
    assert!(n_positive > 200, "{n_positive} cost anything");
}
