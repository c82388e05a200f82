//! The largest numbers that the core takes. They lie far beyond any map, recording or vehicle, and keep what is computed
//! from them finite and in proportion to the number of points. It depends on no other
//! module but `error`. Files are held to `scenario/limits.py`; these bounds are wider, for worlds built in memory.

use crate::error::{Error, Result};

/// Coordinates [m], speeds, accelerations, angles and sizes beyond this are refused: no place on earth is that far away in
/// any projection, and sixth powers of it are still numbers.
pub const NUMBER_MAX: f64 = 1e9;
/// Longest centre line of a lanelet [m].
pub const LANELET_LENGTH_MAX: f64 = 1e5;
/// Length of all lanelets together [m].
pub const ROADS_LENGTH_MAX: f64 = 4e6;
/// Longest reference path [m].
pub const PATH_LENGTH_MAX: f64 = 2e5;
/// Time steps beyond this in size are refused, and so are tables with more of them.
pub const TIME_STEP_MAX: i64 = 1 << 32;
/// Most past time steps in a scene.
pub const HISTORY_STEPS_MAX: usize = 100_000;
/// Most threads of a world.
pub const THREADS_MAX: usize = 1024;
/// Most lanelets that are followed one after the other: a bound for lanelets of next to no length that lead into each
/// other.
pub const LANELET_CHAIN_MAX: usize = 4096;

/// The value is a number of at most [`NUMBER_MAX`] in size.
#[inline(always)]
pub fn is_possible(value: f64) -> bool {
    value.abs() <= NUMBER_MAX
}

/// Refuses a time step that is none.
///
/// # Errors
/// `InvalidInput` naming what has it.
pub fn check_time_step(what: &str, time_step: i64) -> Result<()> {
    if (-TIME_STEP_MAX..=TIME_STEP_MAX).contains(&time_step) {
        return Ok(());
    }
    Err(Error::invalid(format!("{what} {time_step} is beyond {TIME_STEP_MAX}")))
}

/// Refuses a number of threads that no machine has, or none.
///
/// # Errors
/// `InvalidInput`.
pub fn check_threads(threads: usize) -> Result<()> {
    if (1..=THREADS_MAX).contains(&threads) {
        return Ok(());
    }
    Err(Error::invalid(format!("threads must be at least 1 and at most {THREADS_MAX}, not {threads}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limits_themselves_are_possible_and_what_lies_beyond_is_not() {
        assert!(is_possible(-NUMBER_MAX) && !is_possible(1.01 * NUMBER_MAX) && !is_possible(f64::NAN));
        assert!(check_time_step("time step", -TIME_STEP_MAX).is_ok());
        for time_step in [i64::MIN, TIME_STEP_MAX + 1] {
            let error = check_time_step("agent 3: its start", time_step).expect_err("refused").to_string();
            assert_eq!(error, format!("agent 3: its start {time_step} is beyond {TIME_STEP_MAX}"));
        }
        assert!(check_threads(THREADS_MAX).is_ok() && check_threads(0).is_err() && check_threads(usize::MAX).is_err());
    }
}
