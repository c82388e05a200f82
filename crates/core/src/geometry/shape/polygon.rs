//! From the outline of any simple polygon to convex parts: clean, check, clip ears, merge what stays convex.

use crate::error::{Error, Result};
use crate::geometry::{Aabb, Point};
use crate::limits::NUMBER_MAX;

/// Consecutive vertices nearer than this are one [m].
const SAME_VERTEX: f64 = 1e-6;
/// A vertex nearer than this to the line between its neighbours is no corner [m]. Coordinates of real maps (1e6 m) are
/// exact to 1e-10 m.
const ON_LINE: f64 = 1e-9;

/// Twice the signed area [m²]; positive if the vertices run counter-clockwise.
pub(super) fn doubled_area(ring: &[Point]) -> f64 {
    // Relative to the first vertex: far from the origin the products would cancel.
    ring.windows(2).map(|pair| (pair[0] - ring[0]).cross(pair[1] - ring[0])).sum()
}

/// The corners of a simple polygon, counter-clockwise, without repeated vertices and vertices on straight lines.
///
/// # Errors
/// `InvalidInput` if a coordinate is not a number, fewer than three corners are left, or the outline crosses, touches
/// or folds back onto itself.
pub(super) fn simple_ring(points: &[Point]) -> Result<Vec<Point>> {
    if let Some(i) = points.iter().position(|p| !p.is_possible()) {
        return Err(Error::invalid(format!(
            "vertex {i} of a polygon is not a pair of finite numbers up to {NUMBER_MAX:e}"
        )));
    }
    let mut ring: Vec<Point> = Vec::with_capacity(points.len());
    for point in points {
        if ring.last().is_none_or(|last| last.distance(*point) > SAME_VERTEX) {
            ring.push(*point);
        }
    }
    while ring.len() > 1 && ring[0].distance(ring[ring.len() - 1]) <= SAME_VERTEX {
        ring.pop();
    }
    drop_straight_vertices(&mut ring)?;
    if ring.len() < 3 {
        return Err(Error::invalid(format!(
            "a polygon needs three corners that are not on one line, the {} given vertices have {}",
            points.len(),
            ring.len()
        )));
    }
    if let Some(at) = self_contact(&ring) {
        return Err(Error::invalid(format!("a polygon crosses or touches itself near ({:.3}, {:.3})", at.x, at.y)));
    }
    if doubled_area(&ring) < 0.0 {
        ring.reverse();
    }
    Ok(ring)
}

fn drop_straight_vertices(ring: &mut Vec<Point>) -> Result<()> {
    let mut i = 0;
    while i < ring.len() && ring.len() > 2 {
        let n = ring.len();
        let (before, vertex, after) = (ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]);
        let (chord, to_vertex) = (after - before, vertex - before);
        if chord.cross(to_vertex).abs() > ON_LINE * chord.norm() {
            i += 1;
        } else if to_vertex.dot(after - vertex) < 0.0 {
            return Err(Error::invalid(format!(
                "a polygon folds back onto itself at ({:.3}, {:.3})",
                vertex.x, vertex.y
            )));
        } else {
            ring.remove(i);
            // The corner before has a new neighbour.
            i = i.saturating_sub(1);
        }
    }
    Ok(())
}

/// A place where two sides that are no neighbours share a point.
fn self_contact(ring: &[Point]) -> Option<Point> {
    let n = ring.len();
    let side = |i: usize| (ring[i], ring[(i + 1) % n]);
    let boxes: Vec<Aabb> = (0..n).map(|i| Aabb::around([side(i).0, side(i).1])).collect();
    for i in 0..n {
        for j in i + 2..n {
            let are_neighbours = i == 0 && j == n - 1;
            if !are_neighbours && boxes[i].overlaps(&boxes[j]) && segments_share_a_point(side(i), side(j)) {
                return Some(side(i).0.lerp(side(i).1, 0.5));
            }
        }
    }
    None
}

/// Exact up to rounding, for segments whose axis-aligned boxes overlap.
fn segments_share_a_point((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
    let (side_c, side_d) = ((b - a).cross(c - a), (b - a).cross(d - a));
    let (side_a, side_b) = ((d - c).cross(a - c), (d - c).cross(b - c));
    side_c * side_d <= 0.0 && side_a * side_b <= 0.0
}

/// Convex polygons that fill a simple ring (see [`simple_ring`]).
///
/// # Errors
/// `InvalidInput` if rounding leaves no ear to clip: parts of the outline are nearer to each other than can be told.
pub(super) fn convex_parts(ring: &[Point]) -> Result<Vec<Vec<Point>>> {
    let mut parts: Vec<Vec<usize>> = Vec::new();
    let mut diagonals: Vec<(usize, usize)> = Vec::new();
    let mut rest: Vec<usize> = (0..ring.len()).collect();
    if is_convex(ring) {
        return Ok(vec![ring.to_vec()]);
    }
    let mut start = 0;
    while rest.len() > 3 {
        let n = rest.len();
        let corner = |i: usize| [rest[(i + n - 1) % n], rest[i % n], rest[(i + 1) % n]];
        let Some(ear) = (start..start + n).map(|i| i % n).find(|i| is_ear(ring, &rest, corner(*i))) else {
            return Err(Error::invalid("a polygon is too thin somewhere to be divided into convex parts"));
        };
        let [before, tip, after] = corner(ear);
        parts.push(vec![before, tip, after]);
        diagonals.push((before, after));
        rest.remove(ear);
        // Going on past the neighbour avoids a fan of slivers around one vertex.
        start = ear + 1;
    }
    parts.push(rest);
    merge_convex(ring, &mut parts, &diagonals);
    Ok(parts.into_iter().map(|part| part.into_iter().map(|i| ring[i]).collect()).collect())
}

fn is_convex(ring: &[Point]) -> bool {
    let n = ring.len();
    (0..n).all(|i| is_left_turn(ring[i], ring[(i + 1) % n], ring[(i + 2) % n]))
}

#[inline]
fn is_left_turn(a: Point, b: Point, c: Point) -> bool {
    (b - a).cross(c - b) >= 0.0
}

/// The triangle at a corner lies in the polygon and no other vertex lies in it or on its edge.
fn is_ear(ring: &[Point], rest: &[usize], corner: [usize; 3]) -> bool {
    let [a, b, c] = corner.map(|i| ring[i]);
    let is_inside = |p: Point| is_left_turn(a, b, p) && is_left_turn(b, c, p) && is_left_turn(c, a, p);
    (b - a).cross(c - b) > 0.0 && !rest.iter().any(|i| !corner.contains(i) && is_inside(ring[*i]))
}

/// Takes away every diagonal whose two sides together are convex (Hertel and Mehlhorn: at most four times the fewest
/// possible parts remain).
fn merge_convex(ring: &[Point], parts: &mut Vec<Vec<usize>>, diagonals: &[(usize, usize)]) {
    for (from, to) in diagonals {
        let (Some(first), Some(second)) = (with_side(parts, *from, *to), with_side(parts, *to, *from)) else {
            continue;
        };
        // The first part runs to .. from, the second from .. to: joined they meet at both ends.
        let head = starting_at(&parts[first], *to);
        let tail = starting_at(&parts[second], *from);
        let turn = |a: usize, b: usize, c: usize| is_left_turn(ring[a], ring[b], ring[c]);
        if turn(head[head.len() - 2], *from, tail[1]) && turn(tail[tail.len() - 2], *to, head[1]) {
            let joined = head.into_iter().chain(tail[1..tail.len() - 1].iter().copied()).collect();
            parts[first] = joined;
            parts.remove(second);
        }
    }
}

/// The part that has the side from one vertex to another.
fn with_side(parts: &[Vec<usize>], from: usize, to: usize) -> Option<usize> {
    let has =
        |part: &Vec<usize>| part.iter().position(|v| *v == from).is_some_and(|i| part[(i + 1) % part.len()] == to);
    parts.iter().position(has)
}

fn starting_at(part: &[usize], vertex: usize) -> Vec<usize> {
    let start = part.iter().position(|v| *v == vertex).unwrap_or(0);
    part[start..].iter().chain(&part[..start]).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    fn points(coordinates: &[(f64, f64)]) -> Vec<Point> {
        coordinates.iter().map(|(x, y)| Point::new(*x, *y)).collect()
    }

    #[test]
    fn a_ring_comes_out_clean_and_counter_clockwise_however_it_was_written() {
        let square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];
        let reversed = [(0.0, 2.0), (2.0, 2.0), (2.0, 0.0), (0.0, 0.0)];
        let closed = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)];
        let dense = [
            (1.0, 0.0),
            (2.0, 0.0),
            (2.0, 1e-8),
            (2.0, 1.0),
            (2.0, 2.0),
            (0.0, 2.0),
            (0.0, 1.0),
            (0.0, 0.0),
            (0.5, 0.0),
        ];
        for outline in [&square[..], &reversed, &closed, &dense] {
            let ring = simple_ring(&points(outline)).expect("a square");
            assert_eq!(ring.len(), 4, "{outline:?}");
            assert!((doubled_area(&ring) - 8.0).abs() < 1e-6, "{outline:?}");
        }
    }

    #[test]
    fn impossible_outlines_are_refused_with_a_reason() {
        for (outline, reason) in [
            (vec![], "three corners"),
            (vec![(0.0, 0.0), (1.0, 0.0)], "three corners"),
            (vec![(1.0, 1.0), (1.0, 1.0), (1.0, 1.0 + 1e-8)], "three corners"),
            (vec![(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], "folds back"),
            (vec![(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (2.0, -1.0)], "folds back"),
            (vec![(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)], "crosses or touches itself"),
            // A vertex on another side.
            (vec![(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 0.0), (0.0, 2.0)], "crosses or touches itself"),
            (vec![(0.0, 0.0), (f64::NAN, 0.0), (2.0, 0.0)], "vertex 1"),
        ] {
            let error = simple_ring(&points(&outline)).expect_err("not a simple polygon").to_string();
            assert!(error.contains(reason), "{outline:?}: {error}");
        }
    }

    #[test]
    fn an_l_is_two_parts_and_a_convex_outline_is_one() {
        let l = points(&[(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]);
        assert_eq!(convex_parts(&l).expect("simple").len(), 2);
        assert_eq!(convex_parts(&l[..3]).expect("simple").len(), 1);
    }

    #[test]
    fn the_parts_of_random_stars_are_convex_and_have_the_area_of_the_outline() {
        let mut random = Lcg::new(3);
        for corners in 3..80 {
            let angle = std::f64::consts::TAU / f64::from(corners);
            let ray = |i: i32, r: f64| Point::new(1e5, -2e5) + Point::from_angle(angle * f64::from(i)) * r;
            let star: Vec<Point> = (0..corners).map(|i| ray(i, random.within(0.3, 8.0))).collect();
            let ring = simple_ring(&star).expect("a star is simple");
            let parts = convex_parts(&ring).expect("a star can be divided");
            assert!(parts.iter().all(|part| is_convex(part)));
            let area: f64 = parts.iter().map(|part| doubled_area(part)).sum();
            assert!((area - doubled_area(&ring)).abs() < 1e-6, "{corners}");
        }
    }
}
