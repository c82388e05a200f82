//! Which stretches of a path something can be near to or can cross: a coarse look before the exact one.

use crate::geometry::Point;
use crate::simd::multiversion;

/// Segments of a stretch.
pub(super) const STRIDE: usize = 16;
/// Stretches that are examined together.
const LANES: usize = 4;
/// Stretches that have a bit in a mask; those behind are always examined.
const BITS: usize = 64;
/// More than any rounding of a distance [m].
pub(super) const ROUNDING: f64 = 1e-6;

/// Four stretches: start, chord, reciprocal of its length squared (0: no chord), and how far the knots are from it at most.
#[derive(Debug, Clone, Copy)]
struct Block {
    x: [f64; LANES],
    y: [f64; LANES],
    chord_x: [f64; LANES],
    chord_y: [f64; LANES],
    inverse: [f64; LANES],
    deviation: [f64; LANES],
}

/// Stretches that nothing is near to.
const NOWHERE: Block = Block {
    x: [1e150; LANES],
    y: [1e150; LANES],
    chord_x: [0.0; LANES],
    chord_y: [0.0; LANES],
    inverse: [0.0; LANES],
    deviation: [0.0; LANES],
};

/// The stretches of a path, 16 segments each; neighbours share a knot.
#[derive(Debug, Clone, Default)]
pub(super) struct Index {
    blocks: Vec<Block>,
    n: usize,
}

/// The stretches that need an exact look, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Candidates {
    near: u64,
    crossed: u64,
}

impl Index {
    /// Of the knots of a path; the memory is reused.
    pub(super) fn build(&mut self, points: &[Point]) {
        let n_segments = points.len() - 1;
        self.n = n_segments.div_ceil(STRIDE);
        self.blocks.clear();
        self.blocks.resize(self.n.div_ceil(LANES), NOWHERE);
        for k in 0..self.n {
            let knots = &points[k * STRIDE..=((k + 1) * STRIDE).min(n_segments)];
            let (start, chord) = (knots[0], knots[knots.len() - 1] - knots[0]);
            let length_squared = chord.norm_squared();
            let inverse = if length_squared > 0.0 { length_squared.recip() } else { 0.0 };
            let mut squared = 0.0_f64;
            for knot in &knots[1..knots.len() - 1] {
                let delta = *knot - start;
                let fraction = (delta.dot(chord) * inverse).clamp(0.0, 1.0);
                squared = squared.max((delta - chord * fraction).norm_squared());
            }
            let (block, lane) = (&mut self.blocks[k / LANES], k % LANES);
            (block.x[lane], block.y[lane]) = (start.x, start.y);
            (block.chord_x[lane], block.chord_y[lane]) = (chord.x, chord.y);
            (block.inverse[lane], block.deviation[lane]) = (inverse, squared.sqrt() + ROUNDING);
        }
    }

    /// The stretches that may be nearer to a point than `distance` [m], and the stretches that a straight way from
    /// there may meet.
    pub(super) fn look(&self, point: Point, distance: f64, way: Point) -> Candidates {
        let found = look(&self.blocks, point, distance, way);
        let known = if self.n < BITS { (1 << self.n) - 1 } else { u64::MAX };
        Candidates { near: found.near & known, crossed: found.crossed & known }
    }

    /// Stretches that are near, ascending.
    pub(super) fn near(&self, candidates: Candidates) -> impl Iterator<Item = usize> {
        ones(candidates.near).chain(BITS..self.n)
    }

    /// Stretches that are crossed, ascending.
    pub(super) fn crossed(&self, candidates: Candidates) -> impl Iterator<Item = usize> {
        ones(candidates.crossed).chain(BITS..self.n)
    }
}

/// Places of the ones in a mask, ascending.
fn ones(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = (mask != 0).then(|| mask.trailing_zeros() as usize)?;
        mask &= mask - 1;
        Some(place)
    })
}

multiversion! {
    fn look = look_at_blocks, (blocks: &[Block], point: Point, distance: f64, way: Point) -> Candidates
}

/// A number per stretch of a block: small loops of their own, which the compiler turns into wide operations.
macro_rules! per_lane {
    ($lane:ident: $value:expr) => {{
        let mut values = [0.0; LANES];
        for $lane in 0..LANES {
            values[$lane] = $value;
        }
        values
    }};
}

/// All knots of a stretch lie within its deviation of the chord, so on each side of the way, and along it, the ends of
/// the chord tell where they can be.
#[expect(clippy::needless_range_loop, reason = "functions of iterators are not inlined where AVX2 is on")]
#[inline(always)]
fn look_at_blocks(blocks: &[Block], point: Point, distance: f64, way: Point) -> Candidates {
    let way_squared = way.norm_squared();
    let way_length = way_squared.sqrt();
    let mut found = Candidates { near: 0, crossed: 0 };
    let n = if blocks.len() < BITS / LANES { blocks.len() } else { BITS / LANES };
    for (k, block) in blocks[..n].iter().enumerate() {
        let Block { x, y, chord_x, chord_y, inverse, deviation } = block;
        let (x, y) = (per_lane!(i: point.x - x[i]), per_lane!(i: point.y - y[i]));
        let fraction = per_lane!(i: (x[i] * chord_x[i] + y[i] * chord_y[i]) * inverse[i]);
        let fraction = per_lane!(i: less(more(fraction[i], 0.0), 1.0));
        let away_x = per_lane!(i: x[i] - chord_x[i] * fraction[i]);
        let away_y = per_lane!(i: y[i] - chord_y[i] * fraction[i]);
        let reach = per_lane!(i: distance + deviation[i]);
        let near = per_lane!(i: reach[i] * reach[i] - (away_x[i] * away_x[i] + away_y[i] * away_y[i]));
        // Start and end of the chord beside and along the way.
        let side = per_lane!(i: way.y * x[i] - way.x * y[i]);
        let side_end = per_lane!(i: side[i] + (way.x * chord_y[i] - way.y * chord_x[i]));
        let along = per_lane!(i: -(way.x * x[i] + way.y * y[i]));
        let along_end = per_lane!(i: along[i] + (way.x * chord_x[i] + way.y * chord_y[i]));
        let beside = per_lane!(i: less(-less(side[i], side_end[i]), more(side[i], side_end[i])));
        let before = per_lane!(i: less(more(along[i], along_end[i]), way_squared - less(along[i], along_end[i])));
        let crossed = per_lane!(i: less(beside[i], before[i]) + deviation[i] * way_length);
        for i in 0..LANES {
            found.near |= u64::from(near[i] >= 0.0) << (k * LANES + i);
        }
        for i in 0..LANES {
            found.crossed |= u64::from(crossed[i] >= 0.0) << (k * LANES + i);
        }
    }
    found
}

/// The smaller of two numbers; without the detours of `f64::min` for what is not a number.
#[inline(always)]
fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn more(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A road that winds, with a kink and two knots at one place.
    fn points(n: usize) -> Vec<Point> {
        let mut points: Vec<Point> =
            (0..n).map(|i| Point::new(i as f64, 12.0 * (i as f64 / 9.0).sin() + f64::from(i > 40) * 3.0)).collect();
        points[20] = points[19];
        points
    }

    #[test]
    fn every_stretch_with_a_segment_within_the_distance_or_on_the_way_is_found_and_few_others() {
        for n in [2, 17, 100, 1200] {
            let points = if n == 2 { vec![Point::default(), Point::new(3.0, 4.0)] } else { points(n.max(42)) };
            let mut index = Index::default();
            index.build(&points);
            let mut looked_at = 0;
            for i in 0..400 {
                let point = Point::new(f64::from(i * 7 % 130) - 10.0, f64::from(i * 13 % 41) - 20.0);
                let (distance, way) = (3.0, Point::from_angle(f64::from(i)) * 25.0);
                let found = index.look(point, distance, way);
                for k in 0..index.n {
                    let segments = || points[k * STRIDE..points.len().min((k + 1) * STRIDE + 1)].windows(2);
                    let is_near = segments().any(|pair| {
                        (0..=20).any(|u| pair[0].lerp(pair[1], f64::from(u) / 20.0).distance(point) < distance)
                    });
                    let is_crossed = segments().any(|pair| {
                        let (left, right) = (way.cross(pair[0] - point), way.cross(pair[1] - point));
                        let meeting = pair[0].lerp(pair[1], left / (left - right));
                        left * right <= 0.0
                            && left != right
                            && (0.0..=1.0).contains(&((meeting - point).dot(way) / way.norm_squared()))
                    });
                    let (may_be_near, may_be_crossed) =
                        (index.near(found).any(|near| near == k), index.crossed(found).any(|crossed| crossed == k));
                    assert!((!is_near || may_be_near) && (!is_crossed || may_be_crossed), "{n} knots, {point:?}, {k}");
                    if k < BITS {
                        looked_at += usize::from(may_be_near) + usize::from(may_be_crossed);
                    }
                }
            }
            let all = 800 * index.n.min(BITS);
            assert!(n == 2 || 3 * looked_at < all, "{looked_at} of {all}");
        }
    }

    #[test]
    fn wide_machines_find_the_same() {
        let mut index = Index::default();
        index.build(&points(300));
        for i in 0..100 {
            let (point, way) = (Point::new(f64::from(i), 3.0), Point::from_angle(f64::from(i)) * 30.0);
            let narrow = look_at_blocks(&index.blocks, point, 3.4, way);
            assert_eq!(look(&index.blocks, point, 3.4, way), narrow);
        }
    }
}
