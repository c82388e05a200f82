//! Names, scales and order of the features.

use super::history::{INSTANT, N_INSTANTS};
use super::motion_smoothness::N_SMOOTHNESS;

/// Meaning and order of the features; files of weights made for another one are refused.
pub const VERSION: i64 = 2;
/// Neighbours that are told.
pub const N_NEIGHBOURS: usize = 8;
/// Features of a vehicle.
pub const N_AGENT: usize = N_INSTANTS * PAST.len() + NOW.len() + SMOOTHNESS.len();
/// Features of a neighbour.
pub const N_NEIGHBOUR: usize = NEIGHBOUR.len();
/// Features of a path.
pub const N_PATH: usize = PATH.len();

/// A feature: its value is a physical quantity divided by the scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Name.
    pub name: &'static str,
    /// Divisor, in the unit of the quantity.
    pub scale: f64,
    /// In a mirrored world the value is multiplied by this, 1 or -1.
    pub mirror: f64,
}

const fn feature(name: &'static str, scale: f64) -> Feature {
    Feature { name, scale, mirror: 1.0 }
}

/// Left and right are opposite.
const fn sided(name: &'static str, scale: f64) -> Feature {
    Feature { name, scale, mirror: -1.0 }
}

/// Of every instant of the past: position [m] minus that at constant velocity, ahead and left of the pose now; speed
/// minus that now [m/s].
pub(super) const PAST: [Feature; 4] =
    [feature("past_x", 5.0), sided("past_y", 2.0), feature("past_velocity", 5.0), feature("past_known", 1.0)];

/// Of the present.
pub(super) const NOW: [Feature; 14] = [
    feature("velocity", 10.0),
    feature("acceleration_half_second", 3.0),
    feature("acceleration_second", 3.0),
    sided("yaw_rate", 0.5),
    feature("length", 5.0),
    feature("width", 2.0),
    feature("is_car", 1.0),
    feature("is_truck", 1.0),
    feature("is_bus", 1.0),
    feature("is_motorcycle", 1.0),
    feature("is_bicycle", 1.0),
    feature("is_other", 1.0),
    feature("seconds_known", 1.0),
    feature("seconds_unmoved", 1.0),
];

/// How even the past was: logarithms of its roughness along and across the heading over 0.8, 1.2 and 2 s, and of how far the
/// speed was from that now over 1 and 2 s. They tell exact simulated motion from what cameras measured.
pub(super) const SMOOTHNESS: [Feature; N_SMOOTHNESS] = [
    feature("roughness_along_0.8", 2.0),
    feature("roughness_along_1.2", 2.0),
    feature("roughness_along_2.0", 2.0),
    feature("roughness_across_0.8", 2.0),
    feature("roughness_across_1.2", 2.0),
    feature("roughness_across_2.0", 2.0),
    feature("unsteadiness_1.0", 2.0),
    feature("unsteadiness_2.0", 2.0),
];

/// Of a neighbour, in the frame of the vehicle's pose now.
pub(super) const NEIGHBOUR: [Feature; 11] = [
    feature("x", 20.0),
    sided("y", 10.0),
    feature("relative_velocity_x", 10.0),
    sided("relative_velocity_y", 5.0),
    feature("heading_cos", 1.0),
    sided("heading_sin", 1.0),
    feature("length", 5.0),
    feature("width", 2.0),
    feature("speed", 10.0),
    feature("is_static", 1.0),
    feature("is_present", 1.0),
];

/// Of a path.
pub(super) const PATH: [Feature; 42] = [
    feature("is_own", 1.0),
    feature("is_left", 1.0),
    feature("is_right", 1.0),
    feature("is_free", 1.0),
    feature("share", 1.0),
    sided("offset", 2.0),
    sided("heading_error", 0.3),
    feature("width", 3.5),
    sided("curvature_5", 0.1),
    sided("curvature_10", 0.1),
    sided("curvature_15", 0.1),
    sided("curvature_20", 0.1),
    sided("curvature_30", 0.1),
    sided("curvature_40", 0.1),
    sided("curvature_60", 0.1),
    feature("curve_speed_20", 10.0),
    feature("curve_speed_40", 10.0),
    feature("curve_speed_60", 10.0),
    feature("road_end", 33.0),
    feature("has_speed_limit", 1.0),
    feature("speed_limit", 10.0),
    feature("leader_gap", 27.0),
    feature("leader_velocity", 10.0),
    feature("leader_relative_velocity", 5.0),
    feature("leader_change", 2.0),
    sided("leader_offset", 1.0),
    feature("leader_length", 5.0),
    feature("has_leader", 1.0),
    feature("second_gap", 27.0),
    feature("second_velocity", 10.0),
    feature("has_second", 1.0),
    feature("follower_gap", 27.0),
    feature("follower_relative_velocity", 5.0),
    feature("has_follower", 1.0),
    feature("crossing_distance", 27.0),
    feature("crossing_time", 2.0),
    feature("crossing_own_time", 2.0),
    feature("crossing_speed", 10.0),
    feature("crossing_cos", 1.0),
    sided("crossing_sin", 1.0),
    feature("has_crossing", 1.0),
    feature("own_paths", 3.0),
];

/// Columns of the paths that change places in a mirrored world.
pub const MIRRORED_COLUMNS: (usize, usize) = (1, 2);

/// Features of a vehicle with their names, in order.
pub fn agent_features() -> Vec<(String, Feature)> {
    let past = (0..N_INSTANTS).flat_map(|k| {
        PAST.map(|feature| (format!("{}_{:.1}", feature.name, (k + 1) as f64 * INSTANT), feature)).into_iter()
    });
    past.chain(NOW.iter().chain(&SMOOTHNESS).map(|feature| (feature.name.to_string(), *feature))).collect()
}

/// Features of a neighbour, in order.
pub fn neighbour_features() -> &'static [Feature] {
    &NEIGHBOUR
}

/// Features of a path, in order.
pub fn path_features() -> &'static [Feature] {
    &PATH
}
