//! Rewards of the learners of an episode, and how they ended.

use super::super::rewards::{Amounts, N_TERMS, term, term_of};
use super::super::{Ended, Rows, WorldsSettings};
use super::{CallMemory, Episode};
use crate::recording::OutcomeKind;
use crate::trajectory::State;
use crate::world::Driver;

impl Episode {
    /// The reward of a learner for the last step, and whether it has ended.
    pub(super) fn judge(
        &mut self,
        slot: usize,
        weights: &Amounts,
        rows: &mut Rows<'_>,
        is_late: bool,
        settings: &WorldsSettings,
        memory: &CallMemory,
    ) {
        let learner = &self.learners[slot];
        let driver = self.world.driver(learner.agent);
        let (before, dt) = (learner.state, self.world.scenario().dt);
        // One that ends without moving stays where it was.
        let state = driver.state.unwrap_or(before);
        let outcome = driver.outcome;
        let vehicle = &driver.agent.vehicle;
        let q = driver.s + vehicle.rear_axle_to_center;
        let mut amounts = [0.0; N_TERMS];
        let progress = ((q - learner.start_q) / learner.way).clamp(-1.0, 1.0);
        amounts[term::PROGRESS] = progress - learner.progress;
        let lateral = state.velocity * state.yaw_rate;
        amounts[term::ACCELERATION] = (state.acceleration / 4.0).powi(2) * dt;
        amounts[term::LATERAL_ACCELERATION] = (lateral / 4.0).powi(2) * dt;
        amounts[term::JERK] = ((state.acceleration - before.acceleration) / (20.0 * dt)).powi(2) * dt;
        let at = driver.agent.route.path.at(driver.s);
        let offset = at.tangent().cross(vehicle.rear_axle_from_center(state.pose()) - at.position);
        amounts[term::PATH_OFFSET] = (0.5 * offset.abs()).min(1.0) * dt;
        amounts[term::OVERSPEED] = (state.velocity.abs() / driver.limits.at(q) - 1.0).max(0.0) * dt;
        amounts[term::LIMITED] = f64::from(u8::from(learner.limited));
        amounts[term::WEIGHT_CHANGE] = learner.weight_change;
        if let Some(term) = term_of(outcome.kind, outcome.off_road) {
            amounts[term] = 1.0;
            if outcome.kind == OutcomeKind::Collision {
                amounts[term::COLLISION_SPEED] = outcome.impact_speed / 10.0;
            }
        }
        if weights[term::HEADWAY] != 0.0 {
            amounts[term::HEADWAY] = self.headway(&driver, &state, memory) * dt;
        }
        if weights[term::RECORDED] != 0.0 {
            let obstacles = &self.world.scenario().obstacles.states;
            let recorded = learner.recorded.and_then(|row| obstacles.get(row, self.world.time_step()));
            amounts[term::RECORDED] = recorded
                .map_or(0.0, |recorded| (-0.5 * recorded.pose().position.distance(state.pose().position)).exp() * dt);
        }
        let is_running = outcome.kind == OutcomeKind::Running;
        let kind = outcome.kind;
        let has_ended = !is_running || is_late;
        let reward: f64 = weights.iter().zip(&amounts).map(|(weight, amount)| weight * amount).sum();
        rows.rewards[slot] += reward as f32;
        if !rows.components.is_empty() {
            let components = &mut rows.components[slot * N_TERMS..(slot + 1) * N_TERMS];
            components.iter_mut().zip(&amounts).for_each(|(sum, amount)| *sum += *amount as f32);
        }
        let learner = &mut self.learners[slot];
        learner.progress = progress;
        learner.steps += 1;
        // Once in a decision.
        learner.weight_change = 0.0;
        learner.distance += before.pose().position.distance(state.pose().position);
        learner.total += reward;
        learner.components.iter_mut().zip(&amounts).for_each(|(sum, amount)| *sum += amount);
        learner.state = state;
        if has_ended {
            (learner.is_driving, learner.has_ended) = (false, true);
            let is_time = kind == OutcomeKind::TimeLimit && !settings.time_limit_terminates;
            let truncated = is_running || is_time;
            (rows.terminals[slot], rows.truncations[slot]) = (!truncated, truncated);
        }
        rows.outcomes[slot] = kind as i8;
    }

    /// 1 - gap / (1.5 s times speed) to the nearest participant seen ahead whose footprint overlaps the own width along
    /// the path; 0 where that is negative, or there is none.
    fn headway(&self, driver: &Driver<'_>, state: &State, memory: &CallMemory) -> f64 {
        /// A smaller time gap costs [s].
        const TIME: f64 = 1.5;
        let (path, vehicle) = (&driver.agent.route.path, &driver.agent.vehicle);
        let reach = TIME * state.velocity;
        if reach <= 0.0 {
            return 0.0;
        }
        let (pose, storeys) = (state.pose(), &self.world.participants().storeys);
        let eye = pose.position;
        let front = driver.s + vehicle.rear_axle_to_center + 0.5 * vehicle.length;
        let radius = driver.agent.view.sensor_radius;
        let mut gap = f64::INFINITY;
        for (body, row) in memory.bodies.iter().zip(&memory.present) {
            let distance = body.position.distance(eye);
            let half_length = 0.5 * body.size.0;
            if *row == driver.row || distance > radius || distance > reach + vehicle.length + half_length + 5.0 {
                continue;
            }
            let Some((s, d)) = path.project_near(body.position, front, reach + half_length + 5.0) else { continue };
            let turned = path.at(s).tangent().cross(body.axis).abs();
            let half_width = 0.5 * body.size.1 + (half_length - 0.5 * body.size.1) * turned;
            let ahead = s - half_length - front;
            let is_ahead = d.abs() < half_width + 0.5 * vehicle.width && s > front - 0.5 * vehicle.length;
            if is_ahead && !storeys.are_apart_at(|| (pose, body.pose())) {
                gap = gap.min(ahead.max(0.0));
            }
        }
        (1.0 - gap / reach).max(0.0)
    }

    /// Adds the information about learners that ended in this call; `first_row` is that of the world.
    pub(in crate::worlds) fn tell(&self, first_row: usize, settings: &WorldsSettings, ended: &mut Vec<Ended>) {
        for (slot, learner) in self.learners.iter().enumerate().filter(|(_, learner)| learner.has_ended) {
            let outcome = self.world.driver(learner.agent).outcome;
            let truncated = match outcome.kind {
                OutcomeKind::Running => true,
                OutcomeKind::TimeLimit => !settings.time_limit_terminates,
                _ => false,
            };
            ended.push(Ended {
                row: first_row + slot,
                agent_id: learner.id,
                stage: self.spec.stage,
                outcome: outcome.kind,
                truncated,
                partner: outcome.partner,
                off_road: outcome.off_road,
                impact_speed: outcome.impact_speed,
                steps: learner.steps,
                seconds: learner.steps as f64 * self.world.scenario().dt,
                distance: learner.distance,
                progress: learner.progress,
                total: learner.total,
                components: learner.components,
            });
        }
    }
}
