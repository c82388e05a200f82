//! Settings of the world.

use crate::settings::{between, settings};
use crate::v2x::{Logged, V2xSettings};

settings! {
    /// Steps of the world.
    pub struct StepSettings as CoreStepSettings {
        /// Number of time steps from one plan to the next; in between the last plan is followed.
        replan_every: usize = 1, between(1.0, 10_000.0);
        /// A late agent may continue until its time limit, counted from its start, times this factor.
        grace_factor: f64 = 1.7, between(1.0, 1_000.0);
        /// Number of past time steps in a scene; for time steps shorter than 0.1 s, as many as cover the same time as
        /// this number of steps of 0.1 s.
        history_steps: usize = 30, between(1.0, 10_000.0);
        /// Largest number of time steps of a run; agents that are still driving then end with time_limit. 0: 5000, or
        /// twice the number of recorded time steps if that is more.
        max_steps: usize = 0, between(0.0, 1_000_000.0);
    }
}

impl StepSettings {
    /// Number of time steps after which a run of a scenario with so many recorded time steps ends.
    pub fn steps_at_most(&self, n_recorded: usize) -> usize {
        if self.max_steps > 0 { self.max_steps } else { (2 * n_recorded).max(5_000) }
    }

    /// Number of past time steps in a scene, for steps of `dt` [s].
    pub fn history_at(&self, dt: f64) -> usize {
        (self.history_steps as f64 * (0.1 / dt).max(1.0) - 1e-6).ceil() as usize
    }
}

/// All settings of a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldSettings {
    /// Steps.
    pub step: StepSettings,
    /// Number of threads that plan.
    pub threads: usize,
    /// Record at every step which participants each driving agent sees.
    pub record_views: bool,
    /// Cooperation.
    pub v2x: V2xSettings,
    /// Seed of what cooperation draws.
    pub seed: u64,
    /// How much of the messages is recorded.
    pub record_messages: Logged,
    /// Keep all states and plans; otherwise only as much of the past as a scene shows.
    pub keep_recording: bool,
}

impl Default for WorldSettings {
    fn default() -> Self {
        Self {
            step: StepSettings::default(),
            threads: 1,
            record_views: false,
            v2x: V2xSettings::default(),
            seed: 0,
            record_messages: Logged::None,
            keep_recording: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_in_a_scene_lasts_as_long_however_short_the_steps_are() {
        for (dt, steps) in [(0.1, 30), (0.2, 30), (0.04, 75), (0.05, 60)] {
            assert_eq!(StepSettings::default().history_at(dt), steps, "{dt} s");
        }
    }

    #[test]
    fn a_run_ends_after_5000_steps_or_twice_the_recording_unless_it_is_stated() {
        assert_eq!(StepSettings::default().steps_at_most(2_500), 5_000);
        assert_eq!(StepSettings::default().steps_at_most(2_501), 5_002);
        assert_eq!(StepSettings { max_steps: 3, ..StepSettings::default() }.steps_at_most(2_501), 3);
    }
}
