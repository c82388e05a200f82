//! What moves or stands on an agent's path ahead.

use super::Negotiator;
use crate::conduct::CRAWLING_SPEED;
use crate::geometry::Pose;

/// Another one on the road, as an agent knows of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Neighbour {
    pub(crate) pose: Pose,
    pub(crate) velocity: f64,
    pub(crate) half_width: f64,
    /// Its place among the equipped agents.
    pub(crate) place: Option<usize>,
}

/// What moves or stands on an agent's path ahead.
pub(super) struct Lane(Vec<(f64, Neighbour)>);

impl Lane {
    pub(super) fn of(agent: &Negotiator<'_>, around: &[Neighbour]) -> Self {
        let half = 0.5 * agent.extent.1;
        let on_path = |other: &Neighbour| {
            let (s, d) = agent.path.project_near(other.pose.position, agent.front + 30.0, 60.0)?;
            (d.abs() < half + other.half_width && s > agent.front).then_some((s, *other))
        };
        Self(around.iter().filter_map(on_path).collect())
    }

    /// The nearest one up to an arc length [m].
    pub(super) fn next(&self, from: f64, to: f64) -> Option<&Neighbour> {
        let between = self.0.iter().filter(|(s, _)| (from..to).contains(s));
        between.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, other)| other)
    }

    pub(super) fn is_blocked(&self, from: f64, to: f64) -> bool {
        self.0.iter().any(|(s, other)| (from..=to).contains(s) && other.velocity.abs() < CRAWLING_SPEED)
    }
}
