//! Bounds that a document is checked against while it is read; those of its contents as a whole are the reader's user's.

/// Ids beyond this are not exact in JSON and in reports.
pub const LARGEST_ID: i64 = (1 << 53) - 1;
/// Time between steps, smallest and largest [s].
pub const SMALLEST_DT: f64 = 1e-3;
/// The same, largest [s].
pub const LARGEST_DT: f64 = 10.0;
/// Time steps of states and starts.
pub const LARGEST_TIME_STEP: i64 = 100_000;
/// Time steps of goals: "some time" is often written as the largest 32-bit number.
pub const LARGEST_GOAL_TIME_STEP: i64 = (1 << 31) - 1;
/// Coordinates beyond this are no place on earth in any projection; larger ones would lose millimetres [m].
pub const LARGEST_COORDINATE: f64 = 1e9;
/// Speeds beyond this are errors of units [m/s].
pub const LARGEST_VELOCITY: f64 = 1e4;
/// Accelerations beyond this are errors of units [m/s²].
pub const LARGEST_ACCELERATION: f64 = 1e7;
/// Yaw rates beyond this are errors of units [rad/s].
pub const LARGEST_YAW_RATE: f64 = 1e4;
/// commonroad-io subtracts one turn at a time, which for larger angles takes for ever [rad].
pub const LARGEST_ANGLE: f64 = 1000.0;
/// Lanelets of a map.
pub const MOST_LANELETS: usize = 20_000;
/// Points on one bound of a lanelet.
pub const MOST_POINTS_OF_A_LANELET: usize = 5_000;
/// Points on all bounds.
pub const MOST_POINTS: usize = 500_000;
/// Obstacles of a scenario.
pub const MOST_OBSTACLES: usize = 10_000;
/// States of all obstacles.
pub const MOST_STATES: usize = 1_000_000;
/// Planning problems of a scenario.
pub const MOST_PROBLEMS: usize = 1_000;
/// Nesting depth of a document.
pub const DEEPEST: usize = 50;
