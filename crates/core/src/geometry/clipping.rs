//! Cutting convex polygons: intersections, and strips between two bounds as convex pieces.

use super::Point;

/// Area of a counter-clockwise polygon [m²].
pub(crate) fn area(polygon: &[Point]) -> f64 {
    0.5 * polygon.windows(2).map(|pair| (pair[0] - polygon[0]).cross(pair[1] - polygon[0])).sum::<f64>()
}

/// The part of a convex polygon in front of a line.
pub(crate) fn clip(polygon: &[Point], origin: Point, normal: Point) -> Vec<Point> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let (start, end) = ((from - origin).dot(normal), (to - origin).dot(normal));
        if start >= 0.0 {
            out.push(from);
        }
        if (start > 0.0 && end < 0.0) || (start < 0.0 && end > 0.0) {
            out.push(from.lerp(to, start / (start - end)));
        }
    }
    out
}

/// Intersection of convex polygons (Sutherland and Hodgman).
pub(crate) fn intersection(a: &[Point], b: &[Point]) -> Vec<Point> {
    let mut out = a.to_vec();
    for (i, &from) in b.iter().enumerate() {
        let to = b[(i + 1) % b.len()];
        out = clip(&out, from, (to - from).left());
        if out.len() < 3 {
            return Vec::new();
        }
    }
    out
}

/// Convex pieces of the strip between two bounds, without inverted pieces.
pub(crate) fn strip(left: &[Point], right: &[Point]) -> Vec<Vec<Point>> {
    let mut pieces = Vec::new();
    for i in 0..left.len() - 1 {
        let quad = [right[i], right[i + 1], left[i + 1], left[i]];
        let turn = |a: usize, b: usize, c: usize| (quad[b] - quad[a]).cross(quad[c] - quad[b]);
        if (0..4).all(|k| turn(k, (k + 1) % 4, (k + 2) % 4) >= 0.0) {
            pieces.push(quad.to_vec());
            continue;
        }
        let [a, b, c, d] = quad;
        let twice = |p: Point, q: Point, r: Point| (q - p).cross(r - p);
        let halves = if twice(a, b, c).min(twice(a, c, d)) >= twice(a, b, d).min(twice(b, c, d)) {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        };
        pieces.extend(halves.into_iter().filter(|[p, q, r]| twice(*p, *q, *r) > 0.0).map(|half| half.to_vec()));
    }
    pieces
}
