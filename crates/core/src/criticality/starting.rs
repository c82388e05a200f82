//! Whether vehicles can have come to where they start: the conflicts that no driver would have let happen.

use crate::geometry::Point;

/// A vehicle at its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Centre of its footprint [m]; not finite: it is not there.
    pub position: Point,
    /// Heading [rad].
    pub orientation: f64,
    /// Speed along it [m/s].
    pub velocity: f64,
    /// Length and width of its footprint [m].
    pub size: (f64, f64),
}

/// What counts as a conflict.
#[derive(Debug, Clone, PartialEq)]
pub struct StartLimits {
    /// Vehicles farther apart are not looked at [m].
    pub reach: f64,
    /// A leader is so far at most to the side of who follows it [m].
    pub lane: f64,
    /// A follower may have to brake so hard [m/s²].
    pub braking: f64,
    /// The times at which both may touch straight on [s].
    pub times: Vec<f64>,
}

/// Why two vehicles cannot have started like this.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StartConflict {
    /// Their footprints overlap.
    Overlap,
    /// Who follows has to brake so hard [m/s²].
    Braking(f64),
    /// They touch straight on, whichever of them brakes.
    Inevitable,
}

/// The first conflict of some rows with other vehicles that is not in the recording, with both rows.
///
/// # Arguments
/// * `recorded`, `starts` - the same vehicles as recorded, and as they start; shape (vehicles).
/// * `rows` - whose conflicts are looked for, in this order; those of two of them count once.
pub fn start_conflict(
    recorded: &[Start],
    starts: &[Start],
    rows: &[usize],
    limits: &StartLimits,
) -> Option<(usize, usize, StartConflict)> {
    rows.iter().enumerate().find_map(|(place, row)| {
        let others = (0..starts.len()).filter(|other| !rows[..=place].contains(other));
        others
            .filter_map(|other| {
                let (now, before) = ((&starts[*row], &starts[other]), (&recorded[*row], &recorded[other]));
                new_conflict(now, before, limits).map(|why| (*row, other, why))
            })
            .next()
    })
}

fn new_conflict(now: (&Start, &Start), before: (&Start, &Start), limits: &StartLimits) -> Option<StartConflict> {
    let distance = (now.0.position - now.1.position).norm();
    if distance.is_nan() || distance > limits.reach {
        return None;
    }
    if overlap(now) && !overlap(before) {
        return Some(StartConflict::Overlap);
    }
    let braking = |(one, other): (&Start, &Start)| {
        needed_braking(one, other, limits.lane).max(needed_braking(other, one, limits.lane))
    };
    let needed = braking(now);
    // Who was not there in the recording did not have to brake.
    let was_hard = braking(before) > limits.braking;
    if needed > limits.braking && !was_hard {
        return Some(StartConflict::Braking(needed));
    }
    (is_inevitable(now, limits) && !is_inevitable(before, limits)).then_some(StartConflict::Inevitable)
}

/// What a follower needs not to hit its leader \[m/s²\]; 0 where that one is not ahead on the same line, or faster.
fn needed_braking(follower: &Start, leader: &Start, lane: f64) -> f64 {
    let (heading, led) = (Point::from_angle(follower.orientation), Point::from_angle(leader.orientation));
    let apart = leader.position - follower.position;
    let (along, turned) = (apart.dot(heading), led.dot(heading));
    let closing = follower.velocity - leader.velocity * turned;
    let is_led = along > 0.0
        && heading.cross(apart).abs() <= lane
        && turned >= std::f64::consts::FRAC_PI_4.cos()
        && closing > 0.0;
    let gap = along - 0.5 * (follower.size.0 + leader.size.0);
    if is_led { closing * closing / (2.0 * gap.max(0.01)) } else { 0.0 }
}

/// Whether both touch straight on, whichever of them brakes as hard as a follower may have to.
fn is_inevitable((one, other): (&Start, &Start), limits: &StartLimits) -> bool {
    let touch = |braking: f64, braking_other: f64| {
        limits.times.iter().any(|time| touch(one, other, way(other, braking_other, *time) - way(one, braking, *time)))
    };
    touch(limits.braking, 0.0) && touch(0.0, limits.braking)
}

/// How far a vehicle gets straight on \[m\].
fn way(start: &Start, braking: f64, time: f64) -> Point {
    let speed = start.velocity.max(0.0);
    let moving = if braking > 0.0 { time.min(speed / braking) } else { time };
    Point::from_angle(start.orientation) * (speed * moving - 0.5 * braking * moving * moving)
}

fn overlap((one, other): (&Start, &Start)) -> bool {
    touch(one, other, Point::default())
}

/// Whether two footprints overlap after a displacement of the second one: no side of either separates them.
fn touch(one: &Start, other: &Start, displacement: Point) -> bool {
    let apart = other.position - one.position + displacement;
    let radius = |start: &Start| 0.5 * start.size.0.hypot(start.size.1);
    if apart.norm() > radius(one) + radius(other) {
        return false;
    }
    let axes = |start: &Start| {
        let along = Point::from_angle(start.orientation);
        [along, Point::new(-along.y, along.x)]
    };
    let extent = |start: &Start, axis: Point| {
        let [along, across] = axes(start);
        0.5 * (start.size.0 * along.dot(axis).abs() + start.size.1 * across.dot(axis).abs())
    };
    axes(one)
        .into_iter()
        .chain(axes(other))
        .all(|axis| apart.dot(axis).abs() <= extent(one, axis) + extent(other, axis))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car(x: f64, y: f64, orientation: f64, velocity: f64) -> Start {
        Start { position: Point::new(x, y), orientation, velocity, size: (5.0, 2.0) }
    }

    fn conflict(starts: [Start; 2], recorded: [Start; 2]) -> Option<StartConflict> {
        let times = (0..30).map(|i| 0.1 * f64::from(i)).collect();
        let limits = StartLimits { reach: 80.0, lane: 2.0, braking: 4.0, times };
        start_conflict(&recorded, &starts, &[1], &limits).map(|(_, _, why)| why)
    }

    const FAR: [Start; 2] = [
        Start { position: Point::new(0.0, 0.0), orientation: 0.0, velocity: 0.0, size: (5.0, 2.0) },
        Start { position: Point::new(500.0, 0.0), orientation: 0.0, velocity: 0.0, size: (5.0, 2.0) },
    ];

    #[test]
    fn who_starts_on_another_vehicle_overlaps_it_unless_it_was_recorded_there() {
        let close = [car(0.0, 0.0, 0.0, 5.0), car(4.9, 0.0, 0.0, 5.0)];
        assert_eq!(conflict(close, FAR), Some(StartConflict::Overlap));
        assert_eq!(conflict(close, close), None);
        assert_eq!(conflict([close[0], car(5.1, 0.0, 0.0, 5.0)], FAR), None);
        let turned = [close[0], car(0.0, 3.4, std::f64::consts::FRAC_PI_2, 0.0)];
        assert_eq!(conflict(turned, FAR), Some(StartConflict::Overlap), "its front is 0.9 m from the other's middle");
        assert_eq!(conflict([close[0], car(0.0, 3.6, std::f64::consts::FRAC_PI_2, 0.0)], FAR), None);
    }

    #[test]
    fn a_follower_brakes_with_the_square_of_the_closing_speed_over_twice_the_gap() {
        // 15 m/s to 5 m/s within 10 m.
        let hard = [car(0.0, 0.0, 0.0, 15.0), car(15.0, 0.0, 0.0, 5.0)];
        assert_eq!(conflict(hard, FAR), Some(StartConflict::Braking(5.0)));
        assert_eq!(conflict(hard, hard), None, "as recorded");
        assert_eq!(conflict([hard[0], car(18.0, 0.0, 0.0, 5.0)], FAR), None, "3.8 m/s² are enough");
        assert_eq!(conflict([hard[0], car(15.0, 2.1, 0.0, 5.0)], FAR), None, "it is in the next lane");
    }

    #[test]
    fn who_crosses_too_closely_for_either_to_brake_cannot_have_come_there() {
        let crossing = |x: f64| [car(0.0, -x, std::f64::consts::FRAC_PI_2, 15.0), car(-x, 0.0, 0.0, 15.0)];
        assert_eq!(conflict(crossing(12.0), FAR), Some(StartConflict::Inevitable), "28 m to a standstill");
        assert_eq!(conflict(crossing(40.0), FAR), None);
        let mut gone = crossing(12.0);
        gone[0].position.x = f64::NAN;
        assert_eq!(conflict(gone, FAR), None, "nobody is there");
    }
}
