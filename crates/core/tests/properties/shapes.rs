//! Footprints and areas: rectangles, circles, polygons and groups of every size.

use std::f64::consts::PI;

use interdrive_core::geometry::shape::{PlacedShape, Shape};
use interdrive_core::geometry::{Point, Pose};

use crate::source::Source;

/// Any shape that a scenario may hold: it passes its check.
pub fn shape(source: &mut Source) -> Shape {
    let shape = any_shape(source);
    match shape.check() {
        Ok(()) => shape,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            Shape::rectangle(4.5, 1.8)
        }
    }
}

fn any_shape(source: &mut Source) -> Shape {
    let car = |source: &mut Source| Shape::rectangle(source.finite(4.0, 5.0), source.finite(1.6, 2.0));
    match source.byte() {
        0..=160 => car(source),
        161..=180 => Shape::rectangle_at(
            source.any(0.0, 10.0),
            source.any(0.0, 3.0),
            Point::new(source.any(-5.0, 5.0), source.any(-5.0, 5.0)),
            source.any(-PI, PI),
        ),
        181..=200 => Shape::circle(source.any(0.0, 3.0)),
        201..=240 => polygon(source).unwrap_or_else(|| Shape::circle_at(1.0, Point::new(source.any(-5.0, 5.0), 0.0))),
        _ => {
            let n = source.below(3);
            Shape::group((0..n).map(|_| car(source)).collect())
        }
    }
}

/// A polygon, if the vertices make one; otherwise the reason was text.
pub fn polygon(source: &mut Source) -> Option<Shape> {
    let n = source.below(12);
    let is_star = source.chance(200);
    let vertices: Vec<Point> = (0..n)
        .map(|i| {
            if is_star {
                Point::from_angle(2.0 * PI * i as f64 / n as f64) * source.finite(0.5, 8.0)
            } else {
                Point::new(source.any(-8.0, 8.0), source.any(-8.0, 8.0))
            }
        })
        .collect();
    match Shape::polygon(&vertices) {
        Ok(shape) => Some(shape),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            None
        }
    }
}

/// A shape somewhere near a pose.
pub fn placed(source: &mut Source, near: Pose) -> PlacedShape {
    let shape = if source.chance(128) { shape(source) } else { Shape::rectangle(10.0, 4.0) };
    PlacedShape { shape, pose: near }
}

/// Two shapes at any poses: overlap and distance agree, nothing panics.
pub fn check(source: &mut Source) {
    let (a, b) = (shape(source), shape(source));
    let mut pose = || Pose::new(source.finite(-10.0, 10.0), source.finite(-10.0, 10.0), source.finite(-PI, PI));
    let (at, other_at) = (pose(), pose());
    let distance = a.distance(at, &b, other_at);
    assert!(distance >= 0.0, "{distance}");
    a.overlaps(at, &b, other_at);
    a.contains(at, other_at.position);
    a.oriented_box(at);
    a.aabb(at);
    a.centroid();
    a.outline();
}
