//! Harm of collisions: probability of severe injuries (MAIS 3+) in each of the vehicles involved, by logistic regression
//! over speed change and impact area. Masses and coefficients are those of the published model
//! (docs/reference/criticality.md).

use std::f64::consts::{FRAC_PI_4, PI};

use crate::geometry::wrap_angle;
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

/// The regression of car masses is negative for small footprints; nothing on wheels is lighter than this [kg].
const CAR_MASS_MIN: f64 = 300.0;

/// Coefficients `(constant, per m/s of speed change)`.
type Line = (f64, f64);
const REDUCED_SYMMETRIC: Line = (-4.457, 0.177);
const REDUCED_ASYMMETRIC: Line = (-4.476, 0.179);
const WITHOUT_ANGLE: Line = (-4.591, 0.185);
const UNPROTECTED: Line = (-3.164, 0.288);

/// Where a vehicle is hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ImpactArea {
    /// Within 45 degrees of straight ahead.
    Front = 0,
    /// From 45 to 135 degrees to the left.
    Left = 1,
    /// From 45 to 135 degrees to the right.
    Right = 2,
    /// The rest.
    Rear = 3,
}

impl ImpactArea {
    /// All areas.
    pub const ALL: [Self; 4] = [Self::Front, Self::Left, Self::Right, Self::Rear];

    /// From the direction to the other vehicle, seen from this one [rad].
    pub fn of(angle: f64) -> Self {
        let angle = wrap_angle(angle);
        match angle.abs() {
            a if a < FRAC_PI_4 => Self::Front,
            a if a >= 3.0 * FRAC_PI_4 => Self::Rear,
            _ if angle > 0.0 => Self::Left,
            _ => Self::Right,
        }
    }
}

/// Whether a side impact on the left is told from one on the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sides {
    /// Both sides alike (LR4S).
    #[default]
    Symmetric,
    /// The driver sits on the left (LR4A).
    Asymmetric,
}

/// One of those involved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CrashBody {
    /// Kind.
    pub kind: ParticipantKind,
    /// Mass [kg].
    pub mass: f64,
    /// State at the collision.
    pub state: State,
    /// Position at the last step without contact.
    pub before: crate::geometry::Point,
}

/// What a collision does to one of those involved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harm {
    /// Probability of MAIS 3+; NaN for things.
    pub probability: f64,
    /// Speed change [m/s].
    pub speed_change: f64,
    /// Direction to the other one, seen from this one [rad]; NaN for the edge of the road.
    pub angle: f64,
    /// Where it was hit; front for the edge of the road.
    pub area: ImpactArea,
}

/// Mass of a participant [kg] by kind and footprint [m].
pub fn mass(kind: ParticipantKind, length: f64, width: f64) -> f64 {
    match kind {
        ParticipantKind::Car
        | ParticipantKind::Taxi
        | ParticipantKind::PriorityVehicle
        | ParticipantKind::ParkedVehicle => (-1333.5 + 526.9 * (length * width).powf(0.8)).max(CAR_MASS_MIN),
        ParticipantKind::Truck => 25_000.0,
        ParticipantKind::Bus => 13_000.0,
        ParticipantKind::Train => 118_800.0,
        ParticipantKind::Motorcycle => 250.0,
        ParticipantKind::Bicycle => 90.0,
        ParticipantKind::Pedestrian => 75.0,
        ParticipantKind::Unknown => 300.0,
        // Nothing that gives way.
        ParticipantKind::ConstructionZone | ParticipantKind::Structure => f64::INFINITY,
    }
}

/// Its occupants sit in a body with a crumple zone.
pub fn is_protected(kind: ParticipantKind) -> bool {
    use ParticipantKind::{Bus, Car, ParkedVehicle, PriorityVehicle, Taxi, Train, Truck};
    matches!(kind, Car | Truck | Bus | PriorityVehicle | ParkedVehicle | Train | Taxi)
}

fn is_thing(kind: ParticipantKind) -> bool {
    matches!(kind, ParticipantKind::ConstructionZone | ParticipantKind::Structure)
}

fn logistic((constant, slope): Line, speed_change: f64, area: f64) -> f64 {
    1.0 / (1.0 + (-(constant + slope * speed_change + area)).exp())
}

fn in_vehicle(speed_change: f64, area: ImpactArea, sides: Sides) -> f64 {
    let (line, of_area) = match sides {
        Sides::Symmetric => (
            REDUCED_SYMMETRIC,
            match area {
                ImpactArea::Front => 0.0,
                ImpactArea::Left | ImpactArea::Right => 0.244,
                ImpactArea::Rear => -0.431,
            },
        ),
        Sides::Asymmetric => (
            REDUCED_ASYMMETRIC,
            match area {
                ImpactArea::Front => 0.0,
                ImpactArea::Left => 0.250,
                ImpactArea::Right => 0.259,
                ImpactArea::Rear => -0.445,
            },
        ),
    };
    logistic(line, speed_change, of_area)
}

/// Harm of driving against something that does not give way at a speed [m/s]: the edge of the road, a building.
pub fn boundary_harm(kind: ParticipantKind, impact_speed: f64) -> f64 {
    logistic(if is_protected(kind) { WITHOUT_ANGLE } else { UNPROTECTED }, impact_speed.abs(), 0.0)
}

/// Size of the relative velocity [m/s] of two vehicles with speeds along their headings.
pub fn relative_speed(first: &State, second: &State) -> f64 {
    let turn = second.orientation - first.orientation + PI;
    let (v1, v2) = (first.velocity, second.velocity);
    (v1 * v1 + v2 * v2 + 2.0 * v1 * v2 * turn.cos()).max(0.0).sqrt()
}

/// Harm of a perfectly plastic collision for both.
pub fn collision_harm(first: &CrashBody, second: &CrashBody, sides: Sides) -> [Harm; 2] {
    let relative = relative_speed(&first.state, &second.state);
    [(first, second), (second, first)].map(|(own, other)| {
        let speed_change = match (own.mass.is_finite(), other.mass.is_finite()) {
            (true, true) => other.mass / (own.mass + other.mass) * relative,
            (true, false) => relative,
            (false, _) => 0.0,
        };
        let angle = wrap_angle((other.before - own.before).angle() - own.state.orientation);
        let area = ImpactArea::of(angle);
        let probability = if is_thing(own.kind) {
            f64::NAN
        } else if is_thing(other.kind) {
            boundary_harm(own.kind, speed_change)
        } else if !is_protected(own.kind) {
            logistic(UNPROTECTED, speed_change, 0.0)
        } else if is_protected(other.kind) {
            in_vehicle(speed_change, area, sides)
        } else {
            logistic(WITHOUT_ANGLE, speed_change, 0.0)
        };
        Harm { probability, speed_change, angle, area }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    fn body(kind: ParticipantKind, mass: f64, x: f64, y: f64, orientation: f64, velocity: f64) -> CrashBody {
        let state = State { x, y, orientation, velocity, ..State::default() };
        CrashBody { kind, mass, state, before: Point::new(x, y) }
    }

    fn car(mass: f64, x: f64, y: f64, orientation: f64, velocity: f64) -> CrashBody {
        body(ParticipantKind::Car, mass, x, y, orientation, velocity)
    }

    #[track_caller]
    fn check(harm: &Harm, probability: f64, speed_change: f64, area: ImpactArea) {
        assert!((harm.probability - probability).abs() < 1e-6, "{harm:?}");
        assert!((harm.speed_change - speed_change).abs() < 1e-6, "{harm:?}");
        assert_eq!(harm.area, area);
    }

    #[test]
    fn head_on_with_equal_masses_each_loses_its_speed() {
        let harm =
            collision_harm(&car(1500.0, 0.0, 0.0, 0.0, 15.0), &car(1500.0, 5.0, 0.0, PI, 15.0), Sides::Symmetric);
        for one in harm {
            check(&one, 0.141608, 15.0, ImpactArea::Front);
            assert!((one.probability - 1.0 / (1.0 + 1.802_f64.exp())).abs() < 1e-12);
        }
    }

    #[test]
    fn rear_end_is_worse_for_the_one_behind() {
        let harm = collision_harm(&car(900.0, 0.0, 0.0, 0.3, 20.0), &car(900.0, 4.5, 1.4, 0.3, 10.0), Sides::Symmetric);
        check(&harm[0], 0.027332, 5.0, ImpactArea::Front);
        check(&harm[1], 0.017933, 5.0, ImpactArea::Rear);
    }

    #[test]
    fn a_pedestrian_takes_nearly_all_of_the_speed() {
        let person = body(ParticipantKind::Pedestrian, 75.0, 3.0, 0.0, 1.0, 0.0);
        let harm = collision_harm(&car(1093.3, 0.0, 0.0, 0.0, 10.0), &person, Sides::Symmetric);
        assert!((harm[1].speed_change - 9.358042).abs() < 1e-6);
        assert!((harm[1].probability - 0.384880).abs() < 1e-6);
        check(&harm[0], 0.011293, 0.641958, ImpactArea::Front);
        let other = body(ParticipantKind::Bicycle, 90.0, 0.0, 0.0, 0.0, 5.0);
        let both = collision_harm(&other, &person, Sides::Symmetric);
        assert!(both.iter().all(|one| one.probability > 0.04), "two unprotected ones are both unprotected");
    }

    #[test]
    fn a_perpendicular_impact_hits_front_and_side() {
        let harm = collision_harm(
            &car(1500.0, 0.0, 0.0, 0.0, 10.0),
            &car(1000.0, 3.0, -2.0, 0.5 * PI, 10.0),
            Sides::Symmetric,
        );
        check(&harm[0], 0.030598, 5.656854, ImpactArea::Front);
        check(&harm[1], 0.062321, 8.485281, ImpactArea::Left);
        assert!((harm[0].angle.to_degrees() + 33.690068).abs() < 1e-6);
        assert!((harm[1].angle.to_degrees() - 56.309932).abs() < 1e-6);
        let asymmetric = collision_harm(
            &car(1500.0, 0.0, 0.0, 0.0, 10.0),
            &car(1000.0, 3.0, -2.0, 0.5 * PI, 10.0),
            Sides::Asymmetric,
        );
        let expected = 1.0 / (1.0 + (4.476 - 0.179 * asymmetric[1].speed_change - 0.250).exp());
        assert!((asymmetric[1].probability - expected).abs() < 1e-12);
    }

    #[test]
    fn edges_and_things_stop_a_vehicle_at_its_impact_speed() {
        assert!((boundary_harm(ParticipantKind::Car, 15.0) - 0.139915).abs() < 1e-6);
        let wall = body(ParticipantKind::Structure, f64::INFINITY, 3.0, 0.0, 0.0, 0.0);
        let harm = collision_harm(&car(1200.0, 0.0, 0.0, 0.0, 15.0), &wall, Sides::Symmetric);
        check(&harm[0], 0.139915, 15.0, ImpactArea::Front);
        assert!(harm[1].probability.is_nan() && harm[1].speed_change == 0.0);
    }

    #[test]
    fn masses_follow_the_footprint() {
        assert!((mass(ParticipantKind::Car, 4.508, 1.610) - 1239.122).abs() < 1e-3);
        assert_eq!(mass(ParticipantKind::Car, 1.5, 1.0), 300.0);
        assert_eq!(mass(ParticipantKind::Truck, 9.0, 2.5), 25_000.0);
        assert_eq!(mass(ParticipantKind::Unknown, 1.0, 1.0), 300.0);
    }

    #[test]
    fn harm_is_the_same_wherever_the_world_is_turned_and_swaps_with_the_bodies() {
        let (a, b) = (car(1500.0, 1.0, 2.0, 0.2, 12.0), car(1100.0, 4.0, 0.0, 2.0, 7.0));
        let turned = |body: &CrashBody| {
            let to = |p: Point| Point::new(-p.y + 100.0, p.x - 50.0);
            let state = State { orientation: body.state.orientation + 0.5 * PI, ..body.state };
            CrashBody { state, before: to(body.before), ..*body }
        };
        let [first, second] = collision_harm(&a, &b, Sides::Symmetric);
        let there = collision_harm(&turned(&a), &turned(&b), Sides::Symmetric);
        let swapped = collision_harm(&b, &a, Sides::Symmetric);
        for (one, other) in [(first, there[0]), (second, there[1]), (first, swapped[1]), (second, swapped[0])] {
            assert!((one.probability - other.probability).abs() < 1e-12 && one.area == other.area);
        }
    }

    #[test]
    fn areas_are_cut_at_45_and_135_degrees() {
        for (degrees, area) in [
            (0.0, ImpactArea::Front),
            (44.9, ImpactArea::Front),
            (350.0, ImpactArea::Front),
            (90.0, ImpactArea::Left),
            (-60.0, ImpactArea::Right),
            (135.1, ImpactArea::Rear),
            (-180.0, ImpactArea::Rear),
        ] {
            assert_eq!(ImpactArea::of(f64::to_radians(degrees)), area, "{degrees}");
        }
    }

    #[test]
    fn every_kind_has_its_mass_and_its_protection() {
        use ParticipantKind::*;
        let of_car = 526.9 * 8.0_f64.powf(0.8) - 1333.5;
        for (kind, expected, protected) in [
            (Unknown, 300.0, false),
            (Car, of_car, true),
            (Truck, 25_000.0, true),
            (Bus, 13_000.0, true),
            (Motorcycle, 250.0, false),
            (Bicycle, 90.0, false),
            (Pedestrian, 75.0, false),
            (PriorityVehicle, of_car, true),
            (Train, 118_800.0, true),
            (Taxi, of_car, true),
            (ParkedVehicle, of_car, true),
            (ConstructionZone, f64::INFINITY, false),
            (Structure, f64::INFINITY, false),
        ] {
            assert_eq!(mass(kind, 4.0, 2.0), expected, "{kind:?}");
            assert_eq!(is_protected(kind), protected, "{kind:?}");
        }
    }

    #[test]
    fn the_impact_area_changes_the_odds_by_its_coefficient() {
        let odds = |probability: f64| (probability / (1.0 - probability)).ln();
        for (sides, line, of_area) in [
            (Sides::Symmetric, (-4.457, 0.177), [0.0, 0.244, 0.244, -0.431]),
            (Sides::Asymmetric, (-4.476, 0.179), [0.0, 0.250, 0.259, -0.445]),
        ] {
            for (area, coefficient) in ImpactArea::ALL.into_iter().zip(of_area) {
                let expected = line.0 + line.1 * 12.0 + coefficient;
                assert!((odds(in_vehicle(12.0, area, sides)) - expected).abs() < 1e-9, "{area:?} {sides:?}");
            }
        }
        assert!((odds(boundary_harm(ParticipantKind::Truck, -12.0)) - (-4.591 + 0.185 * 12.0)).abs() < 1e-9);
        assert!((odds(boundary_harm(ParticipantKind::Bicycle, 12.0)) - (-3.164 + 0.288 * 12.0)).abs() < 1e-9);
    }

    #[test]
    fn the_roles_in_an_impact_decide_on_the_model() {
        use ParticipantKind::{Bicycle, Car, Structure};
        // Both 10 m/s, head-on: 20 m/s, shared by equal masses, all of it against what does not give way.
        let against = |own, other| {
            let mass = |kind| if kind == Structure { f64::INFINITY } else { 500.0 };
            let first = body(own, mass(own), 0.0, 0.0, 0.0, 10.0);
            collision_harm(&first, &body(other, mass(other), 3.0, 0.0, PI, 10.0), Sides::Symmetric)[0]
        };
        for (own, other, speed_change, line) in [
            (Car, Car, 10.0, (-4.457, 0.177)),
            (Car, Bicycle, 10.0, (-4.591, 0.185)),
            (Car, Structure, 20.0, (-4.591, 0.185)),
            (Bicycle, Car, 10.0, (-3.164, 0.288)),
            (Bicycle, Structure, 20.0, (-3.164, 0.288)),
        ] {
            let (constant, slope): Line = line;
            let expected = 1.0 / (1.0 + (-(constant + slope * speed_change)).exp());
            let found = against(own, other);
            assert!((found.speed_change - speed_change).abs() < 1e-9, "{own:?} {other:?}: {found:?}");
            assert!((found.probability - expected).abs() < 1e-12, "{own:?} {other:?}: {found:?}");
        }
        let thing = against(Structure, Car);
        assert!(thing.probability.is_nan() && thing.speed_change == 0.0);
        assert!(is_thing(ParticipantKind::ConstructionZone) && !is_thing(Car));
    }

    #[test]
    fn the_relative_speed_is_the_length_of_the_difference_of_the_velocities() {
        let moving = |orientation: f64, velocity: f64| State { orientation, velocity, ..State::default() };
        for (first, second, expected) in [
            (moving(0.3, 12.0), moving(0.3, 5.0), 7.0),
            (moving(0.0, 12.0), moving(PI, 5.0), 17.0),
            (moving(1.0, 12.0), moving(1.0 + 0.5 * PI, 5.0), 13.0),
            (moving(0.0, 3.0), moving(PI / 3.0, 3.0), 3.0),
            (moving(2.0, 4.0), moving(2.0, 4.0), 0.0),
        ] {
            assert!((relative_speed(&first, &second) - expected).abs() < 1e-6, "{first:?} {second:?}");
        }
    }

    #[test]
    fn the_borders_of_areas_belong_to_the_sides_and_to_the_rear() {
        for (angle, area) in [
            (FRAC_PI_4, ImpactArea::Left),
            (-FRAC_PI_4, ImpactArea::Right),
            (3.0 * FRAC_PI_4, ImpactArea::Rear),
            (-3.0 * FRAC_PI_4, ImpactArea::Rear),
            (3.0 * FRAC_PI_4 - 1e-9, ImpactArea::Left),
            (-3.0 * FRAC_PI_4 + 1e-9, ImpactArea::Right),
        ] {
            assert_eq!(ImpactArea::of(angle), area, "{angle}");
        }
    }
}
