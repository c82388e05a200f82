//! Rewards: a weighted sum of amounts. Signs are in the weights; amounts are not negative, except progress.

use crate::recording::OutcomeKind;
use crate::settings::{ANY, settings};

settings! {
    /// Weights of the reward.
    ///
    /// The reward of a step is the sum of weight times amount.
    pub struct RewardWeights as RewardWeights {
        /// Change of the completed share of the way to the goal (of at least 10 m).
        progress: f64 = 1.0, ANY;
        /// Reached the goal in time.
        goal_reached: f64 = 1.0, ANY;
        /// Reached the goal late.
        goal_reached_late: f64 = 0.5, ANY;
        /// Drove past the goal.
        goal_missed: f64 = -0.5, ANY;
        /// Hit another participant.
        collision: f64 = -1.0, ANY;
        /// Left the road.
        off_road: f64 = -1.0, ANY;
        /// No plan, not even braking.
        infeasible: f64 = -1.0, ANY;
        /// The action was not a number.
        planner_error: f64 = -1.0, ANY;
        /// The grace period ended.
        time_limit: f64 = 0.0, ANY;
        /// Speed of the impact / 10 m/s.
        collision_speed: f64 = 0.0, ANY;
        /// Acceleration / 4 m/s², squared, by time.
        acceleration: f64 = -0.02, ANY;
        /// Lateral acceleration / 4 m/s², squared, by time.
        lateral_acceleration: f64 = -0.02, ANY;
        /// Jerk / 20 m/s³, squared, by time.
        jerk: f64 = -0.01, ANY;
        /// Offset from the path / 2 m, at most 1, by time.
        path_offset: f64 = -0.05, ANY;
        /// Speed above the limit / limit, by time.
        overspeed: f64 = 0.0, ANY;
        /// 1 - gap / (1.5 s times speed), if positive, to the nearest visible participant ahead, by time; 0 unless
        /// weighted.
        headway: f64 = 0.0, ANY;
        /// exp(-distance to the present position of the own recording / 2 m), by time; 0 without a recording, and
        /// unless weighted.
        recorded: f64 = 0.0, ANY;
        /// 1 in a step in which the vehicle could not execute the action.
        limited: f64 = 0.0, ANY;
        /// Mean absolute change of the logarithms (base 10) of cost weights in a decision.
        weight_change: f64 = 0.0, ANY;
    }
}

/// Number of terms.
pub const N_TERMS: usize = 19;

impl RewardWeights {
    /// Names of the terms.
    pub const NAMES: [&str; N_TERMS] = [
        "progress",
        "goal_reached",
        "goal_reached_late",
        "goal_missed",
        "collision",
        "off_road",
        "infeasible",
        "planner_error",
        "time_limit",
        "collision_speed",
        "acceleration",
        "lateral_acceleration",
        "jerk",
        "path_offset",
        "overspeed",
        "headway",
        "recorded",
        "limited",
        "weight_change",
    ];

    /// The weights in the order of the names.
    pub fn as_array(&self) -> [f64; N_TERMS] {
        [
            self.progress,
            self.goal_reached,
            self.goal_reached_late,
            self.goal_missed,
            self.collision,
            self.off_road,
            self.infeasible,
            self.planner_error,
            self.time_limit,
            self.collision_speed,
            self.acceleration,
            self.lateral_acceleration,
            self.jerk,
            self.path_offset,
            self.overspeed,
            self.headway,
            self.recorded,
            self.limited,
            self.weight_change,
        ]
    }
}

/// Amounts of a step, in the order of the names.
pub(super) type Amounts = [f64; N_TERMS];

/// Positions of the terms.
pub(super) mod term {
    pub(crate) const PROGRESS: usize = 0;
    pub(crate) const COLLISION: usize = 4;
    pub(crate) const OFF_ROAD: usize = 5;
    pub(crate) const COLLISION_SPEED: usize = 9;
    pub(crate) const ACCELERATION: usize = 10;
    pub(crate) const LATERAL_ACCELERATION: usize = 11;
    pub(crate) const JERK: usize = 12;
    pub(crate) const PATH_OFFSET: usize = 13;
    pub(crate) const OVERSPEED: usize = 14;
    pub(crate) const HEADWAY: usize = 15;
    pub(crate) const RECORDED: usize = 16;
    pub(crate) const LIMITED: usize = 17;
    pub(crate) const WEIGHT_CHANGE: usize = 18;
}

/// The term of an outcome; `None` while it runs.
pub(super) fn term_of(kind: OutcomeKind, off_road: bool) -> Option<usize> {
    match kind {
        OutcomeKind::Running => None,
        OutcomeKind::GoalReached => Some(1),
        OutcomeKind::GoalReachedLate => Some(2),
        OutcomeKind::GoalMissed => Some(3),
        OutcomeKind::Collision if off_road => Some(term::OFF_ROAD),
        OutcomeKind::Collision => Some(term::COLLISION),
        OutcomeKind::Infeasible => Some(6),
        OutcomeKind::PlannerError => Some(7),
        OutcomeKind::TimeLimit => Some(8),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Record;

    #[test]
    fn names_and_weights_are_in_the_order_of_the_table() {
        let mut weights = RewardWeights::default();
        let names: Vec<&str> = weights.fields().into_iter().map(|(field, _)| field.name).collect();
        assert_eq!(names, RewardWeights::NAMES);
        let mut numbered = weights;
        for (i, (_, value)) in numbered.fields().into_iter().enumerate() {
            if let crate::settings::Value::Number(number) = value {
                *number = i as f64;
            }
        }
        assert_eq!(numbered.as_array(), std::array::from_fn(|i| i as f64));
        assert_eq!(RewardWeights::NAMES[term::RECORDED], "recorded");
        assert_eq!(RewardWeights::NAMES[term::LIMITED], "limited");
        assert_eq!(RewardWeights::NAMES[term::WEIGHT_CHANGE], "weight_change");
    }
}
