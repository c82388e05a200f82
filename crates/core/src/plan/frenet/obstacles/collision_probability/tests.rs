use super::*;
use crate::geometry::shape::Lcg;
use crate::geometry::{Aabb, Pose};
use crate::plan::frenet::tests::{Car, Drive};

/// Half length and width of the agent [m].
const HALF: (f64, f64) = (2.254, 0.805);
/// What costs less costs nothing: a probability of 2e-7 for a mode of 0.3, less than its error.
const LEAST: f64 = 6e-5;
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

/// A source that stands, with a covariance.
fn source(body: OrientedBox, covariance: [f64; 3]) -> PredictedMode {
    PredictedMode { covariance, probability: 0.3, ..PredictedMode::new(body, &FrenetSettings::default()) }
}

/// A place from which everything is in reach, for a plan of three points.
fn reach(origin: Point) -> Reach {
    let mut reach = Reach::default();
    reach.begin(Pose { position: origin, orientation: 2.0 }, 3);
    for point in 1..3 {
        reach.set(point, Aabb::around([Point::default()]).grown(2000.0));
    }
    reach
}

fn expectations(sources: &[PredictedMode], origin: Point) -> PredictedFootprints {
    let (reach, mut expectations, mut poses) = (reach(origin), PredictedFootprints::default(), Poses::default());
    expectations.begin(sources.len(), &reach);
    for source in sources {
        poses.stand(reach.stride(), &source.now, origin);
        expectations.push(*source, &poses, &reach, &Predictions::empty(0, vec![], 1, 0));
    }
    expectations
}

/// What one of some sources that stand expects.
fn expected(expectations: &PredictedFootprints, i: usize) -> PredictedFootprint {
    let source = &expectations.sources[i];
    PredictedFootprint::of(
        (source.now.center, source.covariance),
        source.probability,
        &expectations.cells[i / GROUP],
        i % GROUP,
    )
}

/// A source at the edge of where it counts, in some direction.
fn borderline(point: &Waypoint, random: &mut Lcg) -> PredictedMode {
    let (way, covariance) = (Point::from_angle(random.within(-4.0, 4.0)), covariance(random));
    let at_centre = body(point, Point::default(), random);
    let turned = point.axis * way.x + point.axis.left() * way.y;
    let at = |distance: f64| source(OrientedBox { center: point.center + turned * distance, ..at_centre }, covariance);
    let counts =
        |distance: f64| expected(&expectations(&[at(distance)], point.center), 0).cost(&View::of(point), HALF) > LEAST;
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if counts(middle) { low = middle } else { high = middle }
    }
    at(low)
}

#[test]
fn the_sieve_passes_every_expectation_that_costs_anything_and_no_filling() {
    let mut random = Lcg::new(5);
    let (mut n_counting, mut n_sieved) = (0, 0);
    for _ in 0..1500 {
        let point = waypoint(&mut random);
        let origin = point.center + Point::new(random.within(-300.0, 300.0), random.within(-300.0, 300.0));
        let sources: Vec<PredictedMode> = (0..random.within(1.0, 24.0) as usize)
            .map(|_| {
                if random.within(0.0, 1.0) < 0.4 {
                    return borderline(&point, &mut random);
                }
                let place = Point::new(random.within(-30.0, 30.0), random.within(-15.0, 15.0));
                source(body(&point, place, &mut random), covariance(&mut random))
            })
            .collect();
        let expectations = expectations(&sources, origin);
        let rough = RoughView::of(&View::of(&point), origin, HALF);
        assert_eq!(
            expectations.occupied[..expectations.n_groups].iter().map(|bits| bits.count_ones()).sum::<u32>() as usize,
            sources.len()
        );
        for (i, source) in sources.iter().enumerate() {
            let passes = rough.passing(&expectations.cells[i / GROUP]) >> (i % GROUP) & 1 == 1;
            let counts = expected(&expectations, i).cost(&View::of(&point), HALF) > LEAST;
            assert!(passes || !counts, "{source:?} from {point:?}, origin {origin:?}");
            n_counting += usize::from(counts);
            n_sieved += usize::from(!passes);
        }
    }
    assert!(n_counting > 5000 && n_sieved > 5000, "{n_counting} cost something, {n_sieved} do not pass");
}

/// The cost of a source without tables and broad phase.
fn all_in_double((index, source): (usize, &PredictedMode), point: usize, request: &PlanRequest, view: &View) -> f64 {
    let (predictions, place) = (request.predictions, source.steps.expect("it moves").first + point - 1);
    let position = Point::new(predictions.x[place], predictions.y[place]);
    let axis = Point::from_angle(predictions.orientation[place]);
    let body = request.others[index].shape.oriented_box_along(position, axis);
    let (ahead, left) = (axis * source.half.0, axis.left() * source.half.1);
    let [xx, xy, yy] = [&predictions.covariance_xx, &predictions.covariance_xy, &predictions.covariance_yy];
    let expectation = PredictedFootprint {
        mean: body.center,
        front_left: ahead + left,
        front_right: ahead - left,
        probability: source.probability,
        covariance: [xx[place], xy[place], yy[place]],
    };
    expectation.cost(view, HALF)
}

#[test]
fn the_cost_is_that_of_all_predicted_participants_with_and_without_avx2() {
    let mut random = Lcg::new(6);
    let (mut expectations, mut poses) = (PredictedFootprints::default(), Poses::default());
    let mut n_positive = 0;
    for _ in 0..60 {
        let cars = (0..random.within(0.0, 20.0) as usize)
            .map(|_| {
                let sigma = (random.within(0.1, 2.0), random.within(0.1, 1.0));
                let (x, y) = (random.within(0.0, 100.0), random.within(-6.0, 6.0));
                let mut car = Car::at(x, y, random.within(-0.4, 0.4), random.within(1.0, 12.0));
                car.sigma = sigma;
                car
            })
            .collect();
        Drive::on_three_lanes(20.0, 10.0).with_cars(cars).with_request(|request| {
            let (predictions, mut reach) = (request.predictions, Reach::default());
            reach.begin(request.state.pose(), 31);
            (1..31).for_each(|point| reach.set(point, Aabb::around([Point::default()]).grown(300.0)));
            expectations.begin(request.others.len(), &reach);
            for other in request.others {
                let now = other.shape.oriented_box(other.pose);
                let steps = PredictedSteps { first: predictions.offset(other.row, 0), n: 30 };
                poses.follow((reach.stride(), reach.origin), &now, steps, Point::default(), request);
                let source = PredictedMode::new(now, &FrenetSettings::default());
                let source = PredictedMode { steps: Some(steps), probability: 0.3, ..source };
                expectations.push(source, &poses, &reach, predictions);
            }
            for i in 1..31 {
                let center = Point::new(20.0 + i as f64, random.within(-1.0, 1.0));
                let point =
                    Waypoint { center, axis: Point::from_angle(random.within(-0.2, 0.2)), ..Waypoint::default() };
                let narrow = cost_at(&expectations, &point, i, HALF, request);
                let wide = summed_cost(&expectations, &point, i, HALF, request);
                let view = View::of(&point);
                let all: f64 = expectations
                    .sources
                    .iter()
                    .enumerate()
                    .map(|source| all_in_double(source, i, request, &view))
                    .sum();
                assert_eq!(wide.to_bits(), narrow.to_bits(), "{wide} {narrow}");
                assert!((wide - all).abs() < 1e-3, "a probability of 3e-6: {wide} {all}");
                n_positive += usize::from(wide > 0.0);
            }
        });
    }
    assert!(n_positive > 200, "{n_positive} cost anything");
}

#[test]
fn nothing_is_expected_out_of_reach_nor_where_it_is_spread_too_far() {
    let near = source(OrientedBox::new(Pose::new(9.0, 0.0, 0.0), 4.0, 2.0), [0.02, 0.0, 0.02]);
    let count = |source: &PredictedMode| {
        let (mut reach, mut expectations, mut poses) =
            (Reach::default(), PredictedFootprints::default(), Poses::default());
        reach.begin(Pose::default(), 3);
        reach.set(1, Aabb::around([Point::default()]).grown(1.0));
        reach.set(2, Aabb::around([Point::default()]).grown(2.0));
        expectations.begin(1, &reach);
        poses.stand(reach.stride(), &source.now, reach.origin);
        expectations.push(*source, &poses, &reach, &Predictions::empty(0, vec![], 1, 0));
        (expectations.occupied.iter().map(|bits| bits.count_ones()).sum::<u32>(), expectations.is_empty())
    };
    assert_eq!(count(&near), (1, false), "9 m away: within the reach of the second point");
    let further = OrientedBox { center: Point::new(9.1, 0.0), ..near.now };
    assert_eq!(count(&PredictedMode { now: further, ..near }), (0, true));
    assert_eq!(count(&PredictedMode { determinant_max: 3e-4, ..near }), (0, true));
}
