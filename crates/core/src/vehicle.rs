//! Kinds of participants, vehicle parameters and limits, and the kinematic single-track relations.

pub mod single_track;

use crate::error::{Error, Result};
use crate::geometry::shape::OrientedBox;
use crate::geometry::{Point, Pose};

/// Part of the largest lateral acceleration that planners use in curves. Trucks take them at 3 m/s² at most, a reserve of a
/// quarter before they tip.
const CORNERING_SHARE: f64 = 0.75;

/// Kind of a participant, in CommonRoad's words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum ParticipantKind {
    /// Anything the format does not name.
    Unknown = 0,
    /// Passenger car.
    Car = 1,
    /// Truck.
    Truck = 2,
    /// Bus.
    Bus = 3,
    /// Motorcycle.
    Motorcycle = 4,
    /// Bicycle.
    Bicycle = 5,
    /// Pedestrian.
    Pedestrian = 6,
    /// Priority vehicle.
    PriorityVehicle = 7,
    /// Train.
    Train = 8,
    /// Taxi.
    Taxi = 9,
    /// Parked vehicle.
    ParkedVehicle = 10,
    /// Construction zone.
    ConstructionZone = 11,
    /// Road boundary, building, pillar, median strip: static structure.
    Structure = 12,
}

impl ParticipantKind {
    /// All kinds; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 13] = [
        Self::Unknown,
        Self::Car,
        Self::Truck,
        Self::Bus,
        Self::Motorcycle,
        Self::Bicycle,
        Self::Pedestrian,
        Self::PriorityVehicle,
        Self::Train,
        Self::Taxi,
        Self::ParkedVehicle,
        Self::ConstructionZone,
        Self::Structure,
    ];

    /// From its code.
    ///
    /// # Errors
    /// `InvalidInput` for a code that no kind has.
    pub fn from_code(code: i64) -> Result<Self> {
        usize::try_from(code)
            .ok()
            .and_then(|index| Self::ALL.get(index).copied())
            .ok_or_else(|| Error::invalid(format!("there is no participant kind with code {code}")))
    }

    /// Follows lanes and steers like a single-track vehicle.
    pub fn is_vehicle(self) -> bool {
        matches!(
            self,
            Self::Car | Self::Truck | Self::Bus | Self::Motorcycle | Self::Bicycle | Self::PriorityVehicle | Self::Taxi
        )
    }

    /// Stands or drives on lanes: any vehicle, or one whose kind is not known.
    pub fn is_on_the_road(self) -> bool {
        self.is_vehicle() || matches!(self, Self::Unknown | Self::ParkedVehicle | Self::Train)
    }

    /// Others cannot be seen through or past it: everything but pedestrians, bicycles and motorcycles.
    pub fn blocks_sight(self) -> bool {
        !matches!(self, Self::Pedestrian | Self::Bicycle | Self::Motorcycle)
    }
}

/// Parameters and limits of a vehicle. Positions of participants are footprint centres; the kinematic model lives at
/// the rear axle, `rear_axle_to_center` behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    /// Footprint length [m].
    pub length: f64,
    /// Footprint width [m].
    pub width: f64,
    /// Distance between the axles [m].
    pub wheelbase: f64,
    /// Distance from the rear axle forward to the footprint centre [m].
    pub rear_axle_to_center: f64,
    /// Largest longitudinal acceleration and deceleration [m/s²].
    pub acceleration_max: f64,
    /// Above this speed [m/s] the engine limits acceleration to `acceleration_max * velocity_switch / v`.
    pub velocity_switch: f64,
    /// Largest speed [m/s].
    pub velocity_max: f64,
    /// Largest steering angle, both sides [rad].
    pub steering_angle_max: f64,
    /// Largest rate of the steering angle [rad/s].
    pub steering_rate_max: f64,
    /// Largest lateral acceleration [m/s²].
    pub lateral_acceleration_max: f64,
}

/// Limits that replace those of a vehicle, in the units of [`Vehicle`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct VehicleLimits {
    /// Largest acceleration and deceleration.
    pub acceleration_max: Option<f64>,
    /// Largest speed.
    pub velocity_max: Option<f64>,
    /// Largest steering angle.
    pub steering_angle_max: Option<f64>,
    /// Largest rate of the steering angle.
    pub steering_rate_max: Option<f64>,
    /// Largest lateral acceleration.
    pub lateral_acceleration_max: Option<f64>,
}

impl Vehicle {
    /// Ford Escort: CommonRoad vehicle type 1 (commonroad-vehicle-models 3.0.2, as all types). Lateral limits are ours:
    /// dry road with the tyres' friction not used to the end.
    pub const FORD_ESCORT: Self = Self {
        length: 4.298,
        width: 1.674,
        wheelbase: 2.392_68,
        rear_axle_to_center: 1.508_76,
        acceleration_max: 11.5,
        velocity_switch: 4.755,
        velocity_max: 45.8,
        steering_angle_max: 0.910,
        steering_rate_max: 0.4,
        lateral_acceleration_max: 8.0,
    };

    /// BMW 320i: CommonRoad vehicle type 2.
    pub const BMW_320I: Self = Self {
        length: 4.508,
        width: 1.610,
        wheelbase: 2.578_912_8,
        rear_axle_to_center: 1.422_717_093_6,
        acceleration_max: 11.5,
        velocity_switch: 7.319,
        velocity_max: 50.8,
        steering_angle_max: 1.066,
        steering_rate_max: 0.4,
        lateral_acceleration_max: 8.0,
    };

    /// VW Vanagon: CommonRoad vehicle type 3.
    pub const VW_VANAGON: Self = Self {
        length: 4.569,
        width: 1.844,
        wheelbase: 2.471_928,
        rear_axle_to_center: 1.321_136_397_6,
        acceleration_max: 11.5,
        velocity_switch: 7.824,
        velocity_max: 41.7,
        steering_angle_max: 1.023,
        steering_rate_max: 0.4,
        lateral_acceleration_max: 8.0,
    };

    /// Semi-trailer truck without its trailer: CommonRoad vehicle type 4.
    pub const TRUCK: Self = Self {
        length: 5.1,
        width: 2.55,
        wheelbase: 3.6,
        rear_axle_to_center: 1.8,
        acceleration_max: 11.5,
        velocity_switch: 7.824,
        velocity_max: 22.22,
        steering_angle_max: 0.55,
        steering_rate_max: 0.7103,
        lateral_acceleration_max: 4.0,
    };

    /// The vehicle of a CommonRoad vehicle type.
    ///
    /// # Errors
    /// `InvalidInput` for a number other than 1 to 4.
    pub fn of_type(number: i64) -> Result<Self> {
        match number {
            1 => Ok(Self::FORD_ESCORT),
            2 => Ok(Self::BMW_320I),
            3 => Ok(Self::VW_VANAGON),
            4 => Ok(Self::TRUCK),
            _ => Err(Error::invalid(format!("there is no vehicle type {number}: expected a number from 1 to 4"))),
        }
    }

    /// Parameters that fit a footprint: axle positions scale with the length of the BMW 320i; trucks, buses and
    /// two-wheelers get lower limits.
    ///
    /// # Errors
    /// `InvalidInput` if length or width is not a positive number.
    pub fn for_footprint(kind: ParticipantKind, length: f64, width: f64) -> Result<Self> {
        if !(length > 0.0 && width > 0.0 && length.is_finite() && width.is_finite()) {
            return Err(Error::invalid(format!("a vehicle of {length} m by {width} m is impossible")));
        }
        let car = Self::BMW_320I;
        let scale = length / car.length;
        let mut vehicle = Self {
            length,
            width,
            wheelbase: car.wheelbase * scale,
            rear_axle_to_center: car.rear_axle_to_center * scale,
            ..car
        };
        match kind {
            ParticipantKind::Truck | ParticipantKind::Bus => {
                vehicle.acceleration_max = 7.0;
                vehicle.velocity_max = 33.0;
                vehicle.lateral_acceleration_max = 4.0;
            }
            ParticipantKind::Motorcycle => vehicle.lateral_acceleration_max = 7.0,
            ParticipantKind::Bicycle => {
                vehicle.acceleration_max = 5.0;
                vehicle.velocity_max = 17.0;
                vehicle.lateral_acceleration_max = 4.0;
            }
            _ => {}
        }
        Ok(vehicle)
    }

    /// The vehicle with other limits; `None` keeps one.
    ///
    /// # Errors
    /// `InvalidInput` naming the limit that is not a positive number.
    pub fn with_limits(mut self, limits: &VehicleLimits) -> Result<Self> {
        for (name, field, limit) in [
            ("acceleration_max", &mut self.acceleration_max, limits.acceleration_max),
            ("velocity_max", &mut self.velocity_max, limits.velocity_max),
            ("steering_angle_max", &mut self.steering_angle_max, limits.steering_angle_max),
            ("steering_rate_max", &mut self.steering_rate_max, limits.steering_rate_max),
            ("lateral_acceleration_max", &mut self.lateral_acceleration_max, limits.lateral_acceleration_max),
        ] {
            let limit = limit.unwrap_or(*field);
            if !(limit > 0.0 && limit.is_finite()) {
                return Err(Error::invalid(format!("vehicle.{name} must be positive, not {limit}")));
            }
            *field = limit;
        }
        Ok(self)
    }

    /// Lateral acceleration that the tyres hold while the vehicle brakes or accelerates [m/s²]: both together are at most
    /// `acceleration_max` (friction circle).
    pub fn lateral_acceleration_beside(&self, acceleration: f64) -> f64 {
        let rest = (self.acceleration_max.powi(2) - acceleration.powi(2)).max(0.0).sqrt();
        self.lateral_acceleration_max.min(rest)
    }

    /// Lateral acceleration at which curves are taken [m/s²]: the comfortable one, but at most [`CORNERING_SHARE`] of the largest.
    pub fn cornering(&self, comfortable: f64) -> f64 {
        comfortable.min(CORNERING_SHARE * self.lateral_acceleration_max)
    }

    /// Tangent of the largest change of the steering angle in a time [s]; angles beyond 1.5 rad are as good as any.
    pub fn steering_step(&self, time: f64) -> f64 {
        (self.steering_rate_max * time).min(1.5).tan()
    }

    /// Curvature of the rear axle's path after the wheels have turned from one towards another, by at most a steering angle
    /// with this tangent, and no tighter than a largest curvature [1/m].
    pub fn turned(&self, from: f64, wanted: f64, step: f64, tightest: f64) -> f64 {
        // The tangent of the steering angle is L k; by the largest step more and less.
        let now = self.wheelbase * from;
        let high = if now * step < 1.0 { (now + step) / (1.0 - now * step) } else { f64::INFINITY };
        let low = if now * step > -1.0 { (now - step) / (1.0 + now * step) } else { f64::NEG_INFINITY };
        (self.wheelbase * wanted.clamp(-tightest, tightest)).clamp(low, high) / self.wheelbase
    }

    /// Largest curvature of the rear axle's path [1/m].
    pub fn curvature_max(&self) -> f64 {
        self.steering_angle_max.tan() / self.wheelbase
    }

    /// Largest forward acceleration at a speed [m/s²].
    #[inline(always)]
    pub fn forward_acceleration_max(&self, velocity: f64) -> f64 {
        if velocity > self.velocity_switch {
            self.acceleration_max * self.velocity_switch / velocity
        } else {
            self.acceleration_max
        }
    }

    /// The rectangle from the rear to the front axle, as wide as the footprint. A footprint that is larger all around (by a
    /// margin) has a rectangle that is larger by as much.
    #[inline]
    pub fn wheels(&self, footprint: &OrientedBox) -> OrientedBox {
        OrientedBox {
            center: footprint.center + footprint.axis * (0.5 * self.wheelbase - self.rear_axle_to_center),
            half_length: footprint.half_length - 0.5 * (self.length - self.wheelbase),
            ..*footprint
        }
    }

    /// Rear axle position for a pose of the footprint centre.
    #[inline]
    pub fn rear_axle_from_center(&self, center: Pose) -> Point {
        center.position - Point::from_angle(center.orientation) * self.rear_axle_to_center
    }
}

#[cfg(test)]
mod tests {
    use super::Vehicle;

    #[test]
    fn a_type_has_the_size_and_limits_of_its_number() {
        assert_eq!(Vehicle::of_type(2).unwrap(), Vehicle::BMW_320I);
        let limits = [1, 2, 3, 4].map(|number| Vehicle::of_type(number).unwrap().velocity_max);
        assert_eq!(limits, [45.8, 50.8, 41.7, 22.22]);
        for number in [0, 5, -1] {
            assert!(Vehicle::of_type(number).unwrap_err().to_string().contains("expected a number from 1 to 4"));
        }
    }

    #[test]
    fn braking_leaves_the_tyres_less_for_turning() {
        // 11.5² = 132.25, of which 8² = 64 to the side leave sqrt(68.25) = 8.26 m/s² along; 11.5² - 10.5² = 22 = 4.69².
        for (along, beside) in [(0.0, 8.0), (8.2, 8.0), (-10.5, 22.0_f64.sqrt()), (11.5, 0.0), (-12.0, 0.0)] {
            let found = Vehicle::BMW_320I.lateral_acceleration_beside(along);
            assert!((found - beside).abs() < 1e-12, "{along} m/s²: {found} m/s²");
        }
    }

    #[test]
    fn curves_are_taken_comfortably_but_never_near_the_limit_of_the_vehicle() {
        for (vehicle, comfortable, taken) in
            [(Vehicle::BMW_320I, 4.0, 4.0), (Vehicle::TRUCK, 4.0, 3.0), (Vehicle::TRUCK, 2.0, 2.0)]
        {
            assert_eq!(vehicle.cornering(comfortable), taken);
        }
    }
}
