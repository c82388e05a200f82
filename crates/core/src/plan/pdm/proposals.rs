//! What is proposed: car following along a path at a share of the lawful speed.

use super::super::car_following::CarFollowing;
use super::super::conflicts::LINE_GAP;
use super::super::speed_profile::SpeedProfile;
use super::super::{PlanRequest, lawful};
use super::forecast::Forecast;
use super::settings::PdmSettings;
use crate::barrier::Barriers;

/// Slower target speeds count as this one [m/s].
const TARGET_MIN: f64 = 0.01;
/// Share of the goal's interval of speeds that is left to its end.
const GOAL_RESERVE: f64 = 0.15;

/// The model of the year 2000 [m/s²]: a (1 - (v / v0)^exponent - (s* / s)²), no gap smaller than the least one, within the
/// bounds of the law. `leader` is the gap [m] and the speed [m/s] of one.
pub(super) fn acceleration(law: &CarFollowing, velocity: f64, target: f64, leader: Option<(f64, f64)>) -> f64 {
    let interaction = leader.map_or(0.0, |(gap, leader_velocity)| {
        let approach = (velocity - leader_velocity) / (2.0 * (law.acceleration * law.deceleration).sqrt());
        let wanted = law.minimum_gap + velocity * (law.time_gap + approach);
        (wanted / gap.max(law.minimum_gap).max(TARGET_MIN)).powi(2)
    });
    let free = (velocity / target.max(TARGET_MIN)).powf(law.exponent);
    (law.acceleration * (1.0 - free - interaction)).clamp(-law.deceleration, law.acceleration)
}

/// What all proposals of a plan share.
#[derive(Debug, Clone, Default)]
pub(super) struct Premises {
    profile: SpeedProfile,
    pub(super) forecast: Forecast,
    barriers: Barriers,
}

impl Premises {
    /// For an agent whose rear axle is at an arc length [m], with a speed [m/s].
    pub(super) fn fill(&mut self, request: &PlanRequest, settings: &PdmSettings, (s, velocity): (f64, f64)) {
        let limits = &request.rules.way.limits;
        let stated = |s: f64| limits.nearest(s, lawful::STATED_WITHIN).unwrap_or(settings.unlimited_velocity);
        let goal = goal_velocity(request);
        // False for goals without a place, too: their arc lengths are NaN.
        let is_at_goal = |s: f64| s + request.vehicle.rear_axle_to_center >= request.route.goal_entry_s;
        let limit = |s: f64| if is_at_goal(s) { stated(s).min(goal) } else { stated(s) };
        let most = velocity.max(stated(s)).min(request.vehicle.velocity_max);
        let reach = most * settings.horizon + 0.5 * most * most / settings.approach;
        let cornering = request.vehicle.cornering(settings.lateral_acceleration);
        self.profile.fill_below(&request.route.path, limit, (s, reach), cornering, settings.approach);
        self.forecast.fill(request, settings.radius, settings.horizon, s);
        self.barriers = request.barriers(request.rules.way, s);
    }

    /// Speeds of a proposal at points this far apart [s], for a path at an offset [m] and a share of the limit.
    pub(super) fn drive(
        &self,
        request: &PlanRequest,
        settings: &PdmSettings,
        (mut s, mut velocity): (f64, f64),
        (offset, share): (f64, f64),
        (n_points, step): (usize, f64),
        out: &mut Vec<f64>,
    ) {
        let (law, vehicle) = (&settings.law, request.vehicle);
        let limits = &request.rules.way.limits;
        let to_front = vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        out.clear();
        for point in 0..n_points {
            out.push(velocity);
            let time = point as f64 * step;
            let limit = limits.nearest(s, lawful::STATED_WITHIN).unwrap_or(settings.unlimited_velocity);
            let target = (share * limit).min(self.profile.at(s)).min(vehicle.velocity_max);
            let leader = self.forecast.leader(time, s, offset, vehicle.width);
            let behind = leader.map(|leader| (leader.low - s - to_front, leader.velocity));
            let mut next = acceleration(law, velocity, target, behind);
            for barrier in self.barriers.iter().filter(|barrier| barrier.until > time) {
                // It stops before the line by as much as others do.
                let gap = barrier.s - LINE_GAP + law.minimum_gap - s - to_front;
                next = next.min(acceleration(law, velocity, target, Some((gap, 0.0))));
            }
            s += velocity * step;
            velocity = (velocity + next * step).max(0.0);
        }
    }
}

/// The largest speed at the goal [m/s], with a reserve; infinite if it states none.
fn goal_velocity(request: &PlanRequest) -> f64 {
    let last = request.goal.states.iter().max_by_key(|state| state.time_step.1);
    let interval = last.and_then(|state| state.velocity).filter(|(_, high)| high.is_finite());
    interval.map_or(f64::INFINITY, |(low, high)| (high - GOAL_RESERVE * (high - low)).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::super::settings::PdmSettings;
    use super::acceleration;

    #[test]
    fn the_acceleration_is_that_of_the_published_law() {
        let law = PdmSettings::default().law;
        // 2 sqrt(1.5 · 3) = 4.2426
        for (v, target, leader, expected) in [
            (0.0, 10.0, None, 1.5),
            (10.0, 10.0, None, 0.0),
            (9.0, 10.0, None, 1.5 * (1.0 - 0.9_f64.powi(10))),
            (20.0, 10.0, None, -3.0),
            // s* = 1 + 15
            (10.0, 20.0, Some((32.0, 10.0)), 1.5 * (1.0 - 0.5_f64.powi(10) - 0.25)),
            // s* = 1 + 15 + 100 / 4.2426 = 39.5702
            (
                10.0,
                20.0,
                Some((60.0, 0.0)),
                1.5 * (1.0 - 0.5_f64.powi(10) - (39.570_226_039_551_585_f64 / 60.0).powi(2)),
            ),
            (5.0, 20.0, Some((-2.0, 0.0)), -3.0),
            // At rest the least gap is kept.
            (0.0, 20.0, Some((1.0, 0.0)), 0.0),
        ] {
            let found = acceleration(&law, v, target, leader);
            assert!((found - expected).abs() < 1e-9, "{v} {target} {leader:?}: {found} for {expected}");
        }
    }
}
