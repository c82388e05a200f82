//! Parameters and limits of a vehicle as a handle.

use interdrive_core::vehicle::{ParticipantKind, Vehicle, VehicleLimits};
use pyo3::prelude::*;

use crate::errors::exception;
use crate::getters::getters;

/// Size and limits of a vehicle.
#[pyclass(frozen, name = "Vehicle", module = "interdrive._core", from_py_object)]
#[derive(Clone)]
pub struct PyVehicle(pub Vehicle);

#[pymethods]
impl PyVehicle {
    fn __repr__(&self) -> String {
        let Vehicle { length, width, wheelbase, .. } = self.0;
        format!("<Vehicle {length:.2} m long, {width:.2} m wide, wheelbase {wheelbase:.2} m>")
    }

    /// Limits that fit a footprint; keyword arguments replace single limits.
    #[new]
    #[pyo3(signature = (
        kind, length, width, *, acceleration_max=None, velocity_max=None, steering_angle_max=None,
        steering_rate_max=None, lateral_acceleration_max=None
    ))]
    fn new(
        kind: i64,
        length: f64,
        width: f64,
        acceleration_max: Option<f64>,
        velocity_max: Option<f64>,
        steering_angle_max: Option<f64>,
        steering_rate_max: Option<f64>,
        lateral_acceleration_max: Option<f64>,
    ) -> PyResult<Self> {
        let kind = ParticipantKind::from_code(kind).map_err(exception)?;
        let limits = VehicleLimits {
            acceleration_max,
            velocity_max,
            steering_angle_max,
            steering_rate_max,
            lateral_acceleration_max,
        };
        let vehicle = Vehicle::for_footprint(kind, length, width).and_then(|vehicle| vehicle.with_limits(&limits));
        vehicle.map(Self).map_err(exception)
    }

    /// The vehicle of a CommonRoad vehicle type, 1 to 4; a top speed replaces its own.
    #[staticmethod]
    #[pyo3(signature = (number, *, velocity_max=None))]
    fn of_type(number: i64, velocity_max: Option<f64>) -> PyResult<Self> {
        let limits = VehicleLimits { velocity_max, ..VehicleLimits::default() };
        Vehicle::of_type(number).and_then(|vehicle| vehicle.with_limits(&limits)).map(Self).map_err(exception)
    }
}

getters! { PyVehicle {
    /// Length of the footprint [m].
    length: f64 = |this| this.0.length;
    /// Width of the footprint [m].
    width: f64 = |this| this.0.width;
    /// Distance of the axles [m].
    wheelbase: f64 = |this| this.0.wheelbase;
    /// From the rear axle forward to the centre of the footprint [m].
    rear_axle_to_center: f64 = |this| this.0.rear_axle_to_center;
    /// Largest acceleration and deceleration [m/s²].
    acceleration_max: f64 = |this| this.0.acceleration_max;
    /// Above this speed the engine limits the acceleration to `acceleration_max * velocity_switch / v` [m/s].
    velocity_switch: f64 = |this| this.0.velocity_switch;
    /// Top speed [m/s].
    velocity_max: f64 = |this| this.0.velocity_max;
    /// Largest steering angle [rad].
    steering_angle_max: f64 = |this| this.0.steering_angle_max;
    /// Largest change of the steering angle [rad/s].
    steering_rate_max: f64 = |this| this.0.steering_rate_max;
    /// Largest lateral acceleration [m/s²].
    lateral_acceleration_max: f64 = |this| this.0.lateral_acceleration_max;
    /// Curvature of the rear axle's path at full steering [1/m].
    curvature_max: f64 = |this| this.0.curvature_max();
} }
