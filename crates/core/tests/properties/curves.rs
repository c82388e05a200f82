//! Polylines and the smooth reference paths through them.

use interdrive_core::geometry::Point;
use interdrive_core::geometry::polyline::{Polyline, ReferencePath};

use crate::roads::line;
use crate::source::Source;

/// Any points make a curve or a reason in words; feet, points and resampled vertices of a curve are numbers.
pub fn check(source: &mut Source) {
    let mut points = Vec::new();
    let mut start = Point::new(source.any(0.0, 0.0), source.any(0.0, 0.0));
    for _ in 0..=source.below(3) {
        let heading = source.finite(-3.0, 3.0);
        points.extend(line(source, start, heading).0);
        start = points[points.len() - 1];
    }
    if source.is_odd() {
        points.truncate(source.below(4));
    }
    let mut aside = || Point::new(start.x + source.finite(-30.0, 30.0), start.y + source.finite(-30.0, 30.0));
    let asides = [aside(), aside()];
    let (s, window) = (source.finite(-10.0, 100.0), source.finite(0.0, 50.0));
    polyline(&points, &asides, (s, window));
    path(&points, &asides, (s, window));
}

fn polyline(points: &[Point], asides: &[Point], (s, window): (f64, f64)) {
    let line = match Polyline::new(points) {
        Ok(line) => line,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert!(line.length().is_finite() && line.at(s).is_finite() && line.direction_at(s).is_finite());
    for aside in asides.iter().filter(|aside| aside.is_possible()) {
        for foot in [line.project(*aside), line.project_between(*aside, s - window, s + window)] {
            assert!((0.0..=line.length()).contains(&foot.s), "{foot:?}");
            assert!(!foot.distance.is_nan() && foot.distance == foot.d.abs(), "{foot:?}");
        }
    }
    if line.length() < 1e4 {
        assert!(line.resampled(window.max(0.1)).iter().all(|point| point.is_finite()));
    }
}

fn path(points: &[Point], asides: &[Point], (s, window): (f64, f64)) {
    let path = match ReferencePath::through(points) {
        Ok(path) => path,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert!(path.length().is_finite() && path.length() > 0.0);
    for field in [path.x(), path.y(), path.theta(), path.curvature()] {
        assert!(field.iter().all(|value| value.is_finite()));
    }
    let at = path.at(s);
    assert!(at.position.is_finite() && at.theta.is_finite() && at.curvature.is_finite());
    for aside in asides {
        for foot in [path.project(*aside), path.project_near(*aside, s, window)] {
            assert!(foot.is_none_or(|(s, d)| s.is_finite() && d.is_finite()));
        }
        path.project_from(*aside, s, window);
    }
}
