//! Predictions of vehicles that show their turn: none of the modes takes another way at the fork.

use crate::geometry::Point;
use crate::geometry::polyline::ReferencePath;
use crate::road::RoadNetwork;
use crate::rules::Turning;
use crate::trajectory::Predictions;

/// A mode takes another way once it is this near to the middle of that way, and this much farther from the shown way
/// [m].
const WAY_RADIUS: f64 = 2.0;
const WAY_EXCESS: f64 = 1.5;
/// Modes are looked at so often [s].
const LOOK_INTERVAL: f64 = 0.3;
/// Distance around the expected place within which the shown way is searched [m].
const WAY_WINDOW: f64 = 20.0;

/// The way that a vehicle shows.
#[derive(Debug, Clone, Copy)]
pub struct ShownWay<'a> {
    /// Its turn at the fork.
    pub turning: &'a Turning,
    /// Its path.
    pub path: &'a ReferencePath,
    /// Where it is, and the arc length there [m].
    pub from: (Point, f64),
}

/// Probabilities of the modes of a row, with a step of `dt` [s], without the modes that take another way than the one
/// the vehicle shows; `None` if there is no such mode, or no other.
pub fn turn(table: &Predictions, row: usize, way: &ShownWay, road: &RoadNetwork, dt: f64) -> Option<Vec<f64>> {
    let n = table.n_modes;
    let stated = &table.probability[row * n..(row + 1) * n];
    if stated.iter().filter(|one| **one > 0.0).count() < 2 {
        return None;
    }
    let stride = ((LOOK_INTERVAL / dt).round() as usize).max(1);
    let elsewhere = |mode: usize| {
        let start = table.offset(row, mode);
        let steps = (start..start + table.n_steps).skip(stride - 1).step_by(stride).take_while(|i| table.valid[*i]);
        steps.into_iter().any(|i| takes_another_way(Point::new(table.x[i], table.y[i]), way, road))
    };
    let kept: Vec<f64> =
        (0..n).map(|mode| if stated[mode] > 0.0 && elsewhere(mode) { 0.0 } else { stated[mode] }).collect();
    let total: f64 = kept.iter().sum();
    (total > 0.0 && kept != stated).then(|| kept.iter().map(|one| one / total).collect())
}

fn takes_another_way(place: Point, way: &ShownWay, road: &RoadNetwork) -> bool {
    let lanelets = road.lanelets();
    let is_near = |other: &usize| {
        let foot = lanelets[*other].center.project(place);
        (foot.s > 0.0 && foot.s < lanelets[*other].length && foot.distance < WAY_RADIUS).then_some(foot.distance)
    };
    let nearest = way.turning.others.iter().filter_map(is_near).fold(f64::INFINITY, f64::min);
    let (position, s) = way.from;
    let aside =
        || way.path.project_near(place, s + place.distance(position), WAY_WINDOW).map_or(f64::INFINITY, |foot| foot.1);
    nearest.is_finite() && aside().abs() > nearest + WAY_EXCESS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Control;
    use crate::geometry::Pose;
    use crate::road::testing::fork;
    use crate::route::PathPiece;

    /// The middles of the ways behind the fork at (50, 0): straight on, and to the left with a radius of 20 m.
    fn straight_on(way: f64) -> Point {
        Point::new(40.0 + way, 0.0)
    }

    fn left(way: f64) -> Point {
        let angle = ((way - 10.0) / 20.0).max(0.0);
        Point::new(40.0 + way.min(10.0) + 20.0 * angle.sin(), 20.0 - 20.0 * angle.cos())
    }

    /// A vehicle 10 m before the fork, 10 m/s fast, with a mode for 3 s on each way.
    fn expected(ways: &[fn(f64) -> Point], probability: &[f64]) -> Predictions {
        let mut table = Predictions::empty(0, vec![7], ways.len(), 30);
        table.probability.copy_from_slice(probability);
        for (mode, way) in ways.iter().enumerate() {
            for k in 0..30 {
                let pose = Pose { position: way((k + 1) as f64), orientation: 0.0 };
                crate::predict::write(&mut table, mode * 30 + k, pose, 10.0, (0.1, 0.0, 0.1));
            }
        }
        table
    }

    /// The remaining modes if it shows the way onto the lanelet straight on (1) or to the left (2).
    fn kept(table: &Predictions, lanelet: usize) -> Option<Vec<f64>> {
        let road = fork();
        let way = [straight_on, left][lanelet - 1];
        let points: Vec<Point> = std::iter::once(Point::new(0.0, 0.0)).chain((0..40).map(|i| way(i as f64))).collect();
        let path = ReferencePath::through(&points).expect("a path");
        let turning =
            Turning::along(&PathPiece::chain(&path, &[0, lanelet], &road), &Control::default(), &road).remove(0);
        let here = Point::new(40.0, 0.0);
        let s = path.project(here).expect("a foot").0;
        turn(table, 0, &ShownWay { turning: &turning, path: &path, from: (here, s) }, &road, 0.1)
    }

    #[test]
    fn what_is_not_shown_is_not_expected_and_the_rest_is_more_probable() {
        let table = expected(&[straight_on, left, straight_on], &[0.5, 0.2, 0.3]);
        let found = kept(&table, 1).expect("a mode turns");
        assert!((found[0] - 0.625).abs() < 1e-12 && found[1] == 0.0, "{found:?}");
        let found = kept(&table, 2).expect("two modes go straight on");
        assert_eq!(found, [0.0, 1.0, 0.0]);
    }

    #[test]
    fn who_is_not_expected_on_the_way_that_it_shows_is_expected_as_before() {
        let table = expected(&[straight_on, straight_on], &[0.5, 0.5]);
        assert_eq!(kept(&table, 2), None);
        assert_eq!(kept(&table, 1), None);
    }

    #[test]
    fn one_that_stands_before_the_fork_may_stay_there() {
        let table = expected(&[|_| Point::new(40.0, 0.0), straight_on, left], &[0.2, 0.4, 0.4]);
        let found = kept(&table, 2).expect("a mode goes straight on");
        assert!((found[0] - 1.0 / 3.0).abs() < 1e-12 && found[1] == 0.0, "{found:?}");
    }
}
