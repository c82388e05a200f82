//! Conflict zones between the ways that agents tell each other, beyond those of the map.

use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, Pose};

/// Room beside both vehicles [m].
const ROOM_BESIDE: f64 = 0.5;
/// Shorter gaps between shared stretches are closed [m].
const GAP_MIN: f64 = 3.0;
/// Ways whose directions differ by less than 60° go the same way: plans say enough. The cosine of that.
const SAME_HEADING: f64 = 0.5;

/// The strip that a vehicle of a width [m] needs along the points of a way, box by box.
pub(crate) fn strip(way: &[Pose], width: f64) -> Vec<OrientedBox> {
    let half_width = 0.5 * (width + ROOM_BESIDE);
    let between = |pair: &[Pose]| {
        let [a, b] = [pair[0], pair[1]].map(|pose| pose.position);
        let (step, length) = (b - a, a.distance(b));
        let axis = if length > 1e-6 { step * (1.0 / length) } else { Point::from_angle(pair[0].orientation) };
        OrientedBox { center: (a + b) * 0.5, axis, half_length: 0.5 * length, half_width }
    };
    way.windows(2).map(between).collect()
}

/// The first stretch of two strips in which the ways cross or run against each other, as positions of the boxes of both,
/// the ends excluded.
pub(crate) fn crossing(
    ours: &[OrientedBox],
    theirs: &[OrientedBox],
    are_apart: &dyn Fn(Pose, Pose) -> bool,
) -> Option<[(usize, usize); 2]> {
    let radius = |one: &OrientedBox| one.half_length.hypot(one.half_width);
    let largest = |strip: &[OrientedBox]| strip.iter().map(radius).fold(0.0, f64::max);
    let reach = largest(ours) + largest(theirs);
    let mut found: Option<[(usize, usize); 2]> = None;
    let (mut k, mut gap) = (0, 0.0);
    while let Some(own) = ours.get(k) {
        let nearest = theirs.iter().map(|other| other.center.distance(own.center)).fold(f64::INFINITY, f64::min);
        let meets = |other: &OrientedBox| {
            other.axis.dot(own.axis) < SAME_HEADING && other.overlaps(own) && !are_apart(other.pose(), own.pose())
        };
        let first = if nearest <= reach { theirs.iter().position(meets) } else { None };
        if let Some(first) = first {
            let last = theirs.iter().rposition(meets).unwrap_or(first) + 1;
            let [(begin, _), (enters, leaves)] = found.unwrap_or([(k, k), (first, last)]);
            found = Some([(begin, k + 1), (enters.min(first), leaves.max(last))]);
            gap = 0.0;
        } else {
            gap += 2.0 * own.half_length;
            if found.is_some() && gap > GAP_MIN {
                break;
            }
        }
        // Nothing nearer than the difference can meet either.
        let skipped = ((nearest - reach) / (2.0 * own.half_length.max(0.25))) as usize;
        k += if found.is_none() { skipped.max(1) } else { 1 };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight way of so many metres, a point each.
    fn straight(from: (f64, f64), heading: f64, length: usize) -> Vec<OrientedBox> {
        let at = |i: usize| {
            let position = Point::new(from.0, from.1) + Point::from_angle(heading) * i as f64;
            Pose { position, orientation: heading }
        };
        strip(&(0..=length).map(at).collect::<Vec<_>>(), 1.8)
    }

    fn found(theirs: &[OrientedBox], apart: bool) -> Option<[(usize, usize); 2]> {
        crossing(&straight((0.0, 0.0), 0.0, 60), theirs, &|_, _| apart)
    }

    #[test]
    fn ways_cross_where_the_strips_of_both_vehicles_overlap() {
        // Strips are 2.3 m wide: 1.15 m to each side.
        let north = straight((30.5, -20.0), std::f64::consts::FRAC_PI_2, 40);
        assert_eq!(found(&north, false), Some([(29, 32), (18, 22)]));
        assert_eq!(found(&north, true), None, "one is above the other");
    }

    #[test]
    fn ways_that_run_against_each_other_meet_where_they_are_near_and_ways_in_the_same_direction_do_not() {
        let back = |y: f64| straight((50.0, y), std::f64::consts::PI, 40);
        assert_eq!(found(&back(2.2), false), Some([(9, 51), (0, 40)]));
        assert_eq!(found(&back(2.4), false), None);
        assert_eq!(found(&straight((10.0, 1.0), 0.2, 40), false), None);
    }
}
