//! Points, footprints and areas.

use crate::document::{Read, Refusal, Shape};
use crate::tree::{Element, Tree};

/// A full turn, and beyond it no orientation is valid [rad].
const TURN: f64 = std::f64::consts::TAU;

/// Coordinates of a point: two, or three with a height.
pub fn point(element: Element<'_>) -> Read<Vec<f64>> {
    let mut coordinates = vec![element.real_of("x")?, element.real_of("y")?];
    if let Some(height) = element.first("z") {
        coordinates.push(height.real()?);
    }
    Ok(coordinates)
}

/// Coordinates of a point in the plane.
pub fn point_in_plane(element: Element<'_>) -> Read<[f64; 2]> {
    let found = point(element)?;
    Ok([found[0], found[1]])
}

/// Points of an element, all of them with heights or none.
pub fn points(element: Element<'_>) -> Read<Vec<[f64; 2]>> {
    let found: Vec<Vec<f64>> = element.all("point").map(point).collect::<Read<_>>()?;
    if found.windows(2).any(|pair| pair[0].len() != pair[1].len()) {
        return Err(element.refused("some of its points have a height and others have none"));
    }
    Ok(found.into_iter().map(|point| [point[0], point[1]]).collect())
}

/// The footprint of an obstacle.
pub fn footprint(shape: Element<'_>, number: i64) -> Read<Shape> {
    let wrong = || Refusal::of(format!("the shape of obstacle {number} cannot be read; correct it"));
    let primitives = primitives(shape);
    let known = primitives.iter().all(|one| matches!(one.tag_name().name(), "rectangle" | "circle" | "polygon"));
    if !known {
        let mut parts = shape.elements();
        let (Some(only), None) = (parts.next(), parts.next()) else { return Err(wrong()) };
        return lorry(only).ok_or_else(wrong);
    }
    let mut shapes: Vec<Shape> = primitives.into_iter().map(primitive).collect::<Option<_>>().ok_or_else(wrong)?;
    Ok(if shapes.len() == 1 { shapes.remove(0) } else { Shape::Group(shapes) })
}

fn primitives(shape: Element<'_>) -> Vec<Element<'_>> {
    let mut found = Vec::new();
    for child in shape.elements() {
        if matches!(child.tag_name().name(), "shapeGroup" | "shape") {
            found.extend(primitives(child)); // nested no deeper than documents are
        } else {
            found.push(child);
        }
    }
    found
}

fn primitive(element: Element<'_>) -> Option<Shape> {
    let size = |name: &str| element.real_of(name).ok();
    let center = || match element.first("center") {
        None => Some([0.0, 0.0]),
        Some(center) => Some([center.real_of("x").ok()?, center.real_of("y").ok()?]),
    };
    match element.tag_name().name() {
        "rectangle" => {
            let center = match element.first("originXShift") {
                Some(shift) => [-shift.real().ok()?, 0.0],
                None => center()?,
            };
            let orientation = match element.first("orientation") {
                Some(turn) if !turn.words().is_empty() => turn.real().ok()?,
                _ => 0.0,
            };
            Some(Shape::Rectangle { length: size("length")?, width: size("width")?, center, orientation })
        }
        "circle" => Some(Shape::Circle { radius: size("radius")?, center: center()? }),
        _ => {
            let mut vertices = Vec::new();
            for point in element.all("point") {
                vertices.push([point.real_of("x").ok()?, point.real_of("y").ok()?]);
            }
            Some(Shape::Polygon(opened(vertices)))
        }
    }
}

/// A lorry, alone or with its trailer straight behind it.
fn lorry(element: Element<'_>) -> Option<Shape> {
    let truck = |element: Element<'_>| {
        let dims = element.first("truckDims")?;
        let size = |name: &str| dims.real_of(name).ok();
        let [length, width, rear, hitch] =
            [size("length")?, size("width")?, size("distFromRearToRearAxle")?, size("distFromRearAxleToHitch")?];
        size("wheelbase")?;
        size("cabinLength")?;
        let shift = element.real_of("originXShift").ok()?;
        let body = Shape::Rectangle { length, width, center: [-shift, 0.0], orientation: 0.0 };
        // The origin that the format means is at the rear axle.
        Some((body, hitch + (-(length / 2.0 - rear) - shift)))
    };
    match element.tag_name().name() {
        "truckShape" => truck(element).map(|(body, _)| body),
        "semiTrailerTruckShape" => {
            let (body, hitch) = truck(element.first("truckShape")?)?;
            let dims = element.first("trailerDims")?;
            let size = |name: &str| dims.real_of(name).ok();
            let (length, width, front) = (size("length")?, size("width")?, size("distFromFrontToHitch")?);
            size("wheelbase")?;
            let center = [hitch - (length / 2.0 - front), 0.0];
            Some(Shape::Group(vec![body, Shape::Rectangle { length, width, center, orientation: 0.0 }]))
        }
        _ => None,
    }
}

/// Vertices without a repeated last one, row by row.
fn opened(mut vertices: Vec<[f64; 2]>) -> Vec<f64> {
    if vertices.len() > 1 && vertices.first() == vertices.last() {
        vertices.pop();
    }
    vertices.into_iter().flatten().collect()
}

/// An area in the world; `None` among its parts: of a kind that is not known.
pub fn area(element: Element<'_>) -> Read<Vec<Option<Shape>>> {
    let parts: Vec<Option<Shape>> = element.elements().map(part).collect::<Read<_>>()?;
    if parts.is_empty() { Err(element.unreadable()) } else { Ok(parts) }
}

/// The same as one shape, of kinds that are known.
pub fn known_area(element: Element<'_>) -> Read<Shape> {
    let mut parts: Vec<Shape> =
        area(element)?.into_iter().collect::<Option<_>>().ok_or_else(|| element.unreadable())?;
    Ok(if parts.len() == 1 { parts.remove(0) } else { Shape::Group(parts) })
}

fn part(element: Element<'_>) -> Read<Option<Shape>> {
    let center = || element.first("center").map_or(Ok([0.0, 0.0]), point_in_plane);
    Ok(match element.tag_name().name() {
        "rectangle" => {
            let (length, width) = (element.real_of("length")?, element.real_of("width")?);
            let orientation = element.first("orientation").map_or(Ok(0.0), |turn| turn.real())?;
            if orientation.abs() > TURN {
                return Err(element.refused("its orientation is more than a full turn"));
            }
            Some(Shape::Rectangle { length, width, center: center()?, orientation })
        }
        "circle" => Some(Shape::Circle { radius: element.real_of("radius")?, center: center()? }),
        "polygon" => {
            let mut vertices = points(element)?;
            if vertices.len() < 3 {
                return Err(element.refused("a polygon has at least 3 points"));
            }
            if vertices.len() == 3 || vertices.first() != vertices.last() {
                vertices.push(vertices[0]);
            }
            if is_counter_clockwise(&vertices) {
                vertices.reverse();
            }
            Some(Shape::Polygon(opened(vertices)))
        }
        _ => None,
    })
}

/// Whether a closed ring runs counter-clockwise, judged at its highest point as in GEOS.
fn is_counter_clockwise(ring: &[[f64; 2]]) -> bool {
    let n = ring.len() - 1;
    if n < 3 {
        return false;
    }
    // The end of the last rising side that reaches the top, and where that side begins.
    let mut top = 0;
    for i in 1..=n {
        if ring[i][1] > ring[i - 1][1] && ring[i][1] >= ring[top][1] {
            top = i;
        }
    }
    if top == 0 {
        return false;
    }
    let (high, before) = (ring[top], ring[top - 1]);
    let mut falling = top;
    loop {
        falling = (falling + 1) % n;
        if falling == top || ring[falling][1] != high[1] {
            break;
        }
    }
    let after = ring[falling];
    let last_high = ring[if falling > 0 { falling - 1 } else { n - 1 }];
    if high != last_high {
        return last_high[0] < high[0];
    }
    if before == high || after == high || before == after {
        return false;
    }
    let turn = (high[0] - before[0]) * (after[1] - high[1]) - (high[1] - before[1]) * (after[0] - high[0]);
    turn > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_are_judged_at_their_highest_point() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]];
        assert!(is_counter_clockwise(&square));
        let mut back = square;
        back.reverse();
        assert!(!is_counter_clockwise(&back));
        let crossed = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [4.0, 4.0], [0.0, 0.0]];
        assert!(!is_counter_clockwise(&crossed));
        let flat = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 0.0]];
        assert!(!is_counter_clockwise(&flat));
        let doubled = [[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 0.0]];
        assert!(is_counter_clockwise(&doubled));
    }
}
