//! How vehicles drive, in numbers that planning, right of way, prediction and judgement share: what counts as standing, and
//! which braking is comfortable.

/// An agent that is slower than this stands [m/s]: it is told so by its own speed. Ten seconds of it are 1 m.
pub const STANDSTILL_SPEED: f64 = 0.1;

/// Another participant that is slower than this is stationary for those who see it [m/s]: its speed is observed, and its
/// heading says nothing about where it goes.
pub const STATIONARY_SPEED: f64 = 0.5;

/// A vehicle that is slower than this holds up those behind it [m/s].
pub const CRAWLING_SPEED: f64 = 1.0;

/// A vehicle that is slower than this stood, for who judges a run from its states [m/s]: twice the speed at which agents
/// stand by their own measure, so that nobody is judged for a stop that it has made.
pub const JUDGED_STANDSTILL_SPEED: f64 = 0.2;

/// Comfortable braking [m/s²]: with more than this nobody has to stop for a light that changes, and nobody is expected to
/// brake to give way. Traffic engineers time yellow lights by 10 ft/s², 3.05 m/s² (Institute of Transportation Engineers).
pub const COMFORTABLE_DECELERATION: f64 = 3.0;
