//! Names that the format knows.

use std::f64::consts::TAU;

/// Kinds of lanelets.
pub const LANELET_TYPES: [&str; 20] = [
    "urban",
    "country",
    "highway",
    "driveWay",
    "mainCarriageWay",
    "accessRamp",
    "exitRamp",
    "shoulder",
    "busLane",
    "busStop",
    "bicycleLane",
    "sidewalk",
    "crosswalk",
    "interstate",
    "intersection",
    "border",
    "parking",
    "restricted",
    "restricted_area",
    "unknown",
];
/// Lines on the bounds of lanelets.
pub const LINE_MARKINGS: [&str; 12] = [
    "dashed",
    "solid",
    "solid_solid",
    "dashed_dashed",
    "solid_dashed",
    "dashed_solid",
    "curb",
    "lowered_curb",
    "broad_dashed",
    "broad_solid",
    "unknown",
    "no_marking",
];
/// Who may use a lanelet.
pub const ROAD_USERS: [&str; 10] =
    ["vehicle", "car", "truck", "bus", "priorityVehicle", "motorcycle", "bicycle", "pedestrian", "train", "taxi"];
/// Kinds of obstacles.
pub const OBSTACLE_TYPES: [&str; 16] = [
    "unknown",
    "car",
    "truck",
    "bus",
    "bicycle",
    "pedestrian",
    "priorityVehicle",
    "parkedVehicle",
    "constructionZone",
    "train",
    "roadBoundary",
    "motorcycle",
    "taxi",
    "building",
    "pillar",
    "median_strip",
];
/// What a traffic light shows.
pub const LIGHT_STATES: [&str; 5] = ["red", "yellow", "redYellow", "green", "inactive"];
/// Ways for which a traffic light counts; any other text means all of them.
pub const LIGHT_DIRECTIONS: [&str; 6] = ["right", "straight", "left", "leftStraight", "straightRight", "leftRight"];
/// Versions of the format that are read.
pub const VERSIONS: [&str; 2] = ["2018b", "2020a"];
/// Intervals of headings from this width on hold every heading; decimals of a full turn are cut in files [rad].
pub const ANY_HEADING: f64 = TAU - 1e-4;

/// The country at the beginning of a benchmark id, if it has a list of signs of its own; otherwise the default one.
pub fn country(benchmark_id: &str) -> &'static str {
    const LISTED: [&str; 12] = ["DEU", "USA", "CHN", "ESP", "RUS", "ARG", "BEL", "FRA", "GRC", "HRV", "ITA", "PRI"];
    let start = benchmark_id.strip_prefix("C-").unwrap_or(benchmark_id);
    LISTED.into_iter().find(|name| start.starts_with(name)).unwrap_or("ZAM")
}

/// What a sign says of limits in the list of a country; "OTHER": nothing, or another meaning. Signs of priority count by
/// their numbers, in every country (`scenario/signs.py` of the package).
pub fn sign(country: &str, code: &str) -> &'static str {
    if code == "274" {
        return "MAX_SPEED"; // some files have Germany's number in every country
    }
    match (country, code) {
        ("DEU" | "ZAM", "274.1") => "MAX_SPEED_ZONE_START",
        ("DEU" | "ZAM", "310") => "TOWN_SIGN",
        ("USA" | "PRI", "R2-1")
        | ("ESP", "r301")
        | ("RUS", "3.24")
        | ("ARG", "R15")
        | ("BEL", "C43")
        | ("FRA", "B14")
        | ("GRC", "Ρ-32")
        | ("HRV", "B31") => "MAX_SPEED",
        _ => "OTHER",
    }
}
