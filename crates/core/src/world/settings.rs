//! Settings of the world.

use crate::settings::{between, positive, settings};
use crate::v2x::{Logged, V2xSettings};

settings! {
    /// Steps of the world.
    pub struct StepSettings as CoreStepSettings {
        /// Time steps between plans; in between, an agent follows its last plan.
        replan_every: usize = 1, between(1.0, 10_000.0);
        /// Factor on the time limit of an agent, counted from its start, after which a late agent is stopped.
        grace_factor: f64 = 1.7, between(1.0, 1_000.0);
        /// Past time steps in a scene. With time steps shorter than 0.1 s, as many as span the same time at 0.1 s.
        history_steps: usize = 30, between(1.0, 10_000.0);
        /// How long an agent that enters after the beginning waits for room: until it overlaps no vehicle, and can
        /// follow the vehicle ahead with 4 m/s² or less; the time of its goal waits with it. Then it does not enter at
        /// all. 0: it enters at its time, come what may.
        entry_wait: f64 ["s"] = 0.0, between(0.0, 1e5);
        /// Largest number of time steps of a run; agents still driving then end with time_limit. 0: the largest of
        /// 5000, twice the recorded time steps, and the time steps that the goals of all agents need (up to 20000; up
        /// to 1000000 for those of generated vehicles). A run without agents ends when `step.duration` says, but no
        /// later than this.
        max_steps: usize = 0, between(0.0, 1_000_000.0);
        /// Time without any motion, plus the longest cycle of traffic lights, after which a run ends, provided that
        /// nothing can set an agent in motion any more; its agents end with time_limit. inf: never. The default, our
        /// choice, is several times longer than any rule of the road lets an agent stand.
        standstill_s: f64 ["s"] = 60.0, positive(f64::INFINITY);
    }
}

impl StepSettings {
    /// Number of time steps after which a run ends, given the recorded time steps and the `needed` time steps of its
    /// last agent.
    pub fn steps_at_most(&self, n_recorded: usize, needed: i64) -> usize {
        const OWN_TIMES_MAX: i64 = 20_000;
        let needed = needed.clamp(0, OWN_TIMES_MAX) as usize;
        if self.max_steps > 0 { self.max_steps } else { (2 * n_recorded).max(5_000).max(needed) }
    }

    /// Last time step of the grace period of an agent that starts and whose goal ends at these time steps.
    pub fn time_limit(&self, start: i64, end: i64) -> i64 {
        start.saturating_add((self.grace_factor * end.saturating_sub(start) as f64).floor() as i64)
    }

    /// Number of past time steps in a scene, for steps of `dt` [s].
    pub fn history_at(&self, dt: f64) -> usize {
        (self.history_steps as f64 * (0.1 / dt).max(1.0) - 1e-6).ceil() as usize
    }
}

/// A clock [ns] that the caller reads for the core, to say how long plans took; nothing else depends on it.
#[derive(Debug, Clone, Copy)]
pub struct Clock(pub fn() -> u64);

impl PartialEq for Clock {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.0, other.0)
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
    /// Number of time steps that a world without agents takes.
    pub steps_without_agents: usize,
    /// Measures every plan of the core; `None`: nothing is measured.
    pub clock: Option<Clock>,
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
            steps_without_agents: 0,
            clock: None,
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
    fn a_run_ends_after_5000_steps_twice_the_recording_or_the_times_of_its_agents_unless_it_is_stated() {
        let settings = StepSettings::default();
        for (n_recorded, needed, expected) in
            [(2_500, 5_000, 5_000), (2_501, 0, 5_002), (100, 5_542, 5_542), (100, i64::MAX, 20_000), (100, -3, 5_000)]
        {
            assert_eq!(settings.steps_at_most(n_recorded, needed), expected);
        }
        assert_eq!(StepSettings { max_steps: 3, ..settings }.steps_at_most(2_501, 5_542), 3);
    }

    #[test]
    fn a_grace_period_lasts_1_7_times_as_long_as_the_time_of_the_goal() {
        assert_eq!(StepSettings::default().time_limit(10, 110), 180);
        assert_eq!(StepSettings::default().time_limit(0, i64::MAX), i64::MAX);
    }
}
