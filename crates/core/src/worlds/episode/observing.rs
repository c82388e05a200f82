//! What the learners of an episode observe.

use super::super::{Rows, WorldsSettings};
use super::{CallMemory, Episode, Learner};
use crate::geometry::Point;
use crate::observation::{self, ObservedBody, Observer, PIXELS, layout::EGO_LENGTH};
use crate::plan::frenet::N_TERMS as N_COSTS;
use crate::plan::weights::WeightActions;
use crate::trajectory::PlanStatus;

impl Episode {
    /// Writes what a learner observes now, with a picture if there is room for one.
    fn observe(
        &self,
        slot: usize,
        settings: &WorldsSettings,
        (out, picture): (&mut [f32], &mut [u8]),
        memory: &mut CallMemory,
    ) {
        let learner = &self.learners[slot];
        let (out, planner) =
            out.split_at_mut(out.len() - settings.actions.weights().map_or(0, WeightActions::n_observed));
        if let Some(own) = settings.actions.weights() {
            observe_planner(own, learner, self.world.terms(learner.agent), planner);
        }
        let driver = self.world.driver(learner.agent);
        let observer = Observer {
            state: &learner.state,
            vehicle: &driver.agent.vehicle,
            route: &driver.agent.route,
            table: &learner.table,
            limits: driver.limits,
            goal: &driver.agent.goal,
            road: &self.world.scenario().road,
            predictions: self.step.predictions(),
            s: driver.s,
            time_step: self.world.time_step(),
            dt: self.world.scenario().dt,
            last_time_step: driver.last_time_step,
        };
        let CallMemory { bodies, present, index, seen, observation, .. } = memory;
        let (participants, view) = (self.world.participants(), &driver.agent.view);
        let pose = learner.state.pose();
        seen.clear();
        match driver.state {
            Some(_) if self.has_scene => self.step.scene.see(driver.row, view, index, seen),
            Some(_) => {
                index.around(pose.position, view.sensor_radius, seen);
                let is_near = |row: usize, at: Point| participants.is_near(row, at, pose.position, view);
                seen.retain(|i| present[*i] != driver.row && is_near(present[*i], index.positions[*i]));
            }
            None => (),
        }
        // Those that have just ended are seen by learners that have just ended only: the others look after that.
        let is_seen = |body: &ObservedBody| {
            body.id != learner.id
                && body.position.distance(pose.position) <= view.sensor_radius
                && !participants.storeys.are_apart_at(|| (pose, body.pose()))
        };
        if !learner.is_driving {
            seen.extend((present.len()..bodies.len()).filter(|place| is_seen(&bodies[*place])));
        }
        observation::observe(&observer, bodies, seen, &settings.observation, observation, out);
        if !picture.is_empty() {
            observation::draw(&observer, bodies, seen, picture);
        }
    }

    /// Writes observations, masks and ids of all rows. Those of learners that have ended in this call hold their last
    /// observation already if `keep_last`; all others that do not drive are zero.
    pub(in crate::worlds) fn write(
        &self,
        settings: &WorldsSettings,
        rows: &mut Rows<'_>,
        keep_last: bool,
        memory: &mut CallMemory,
    ) {
        let n = settings.n_observations();
        let pixels = if settings.observation.raster { PIXELS } else { 0 };
        for slot in 0..rows.masks.len() {
            let out = &mut rows.observations[slot * n..(slot + 1) * n];
            let picture = &mut rows.rasters[slot * pixels..(slot + 1) * pixels];
            let Some(learner) = self.learners.get(slot).filter(|learner| learner.has_entered) else {
                clear(out);
                picture.fill(0);
                let id = self.learners.get(slot).map_or(-1, |learner| learner.id);
                (rows.masks[slot], rows.agent_ids[slot], rows.outcomes[slot]) = (false, id, -1);
                continue;
            };
            let (is_driving, has_ended, id) = (learner.is_driving, learner.has_ended, learner.id);
            (rows.masks[slot], rows.agent_ids[slot]) = (is_driving, id);
            if is_driving {
                self.observe(slot, settings, (out, picture), memory);
            } else if !(has_ended && keep_last) {
                clear(out);
                picture.fill(0);
            }
        }
    }

    /// Writes the last observation of a learner that has just ended: to `observations` if it is kept there, and to
    /// `final_observations` if there is room for it.
    pub(super) fn write_last(
        &self,
        slot: usize,
        settings: &WorldsSettings,
        rows: &mut Rows<'_>,
        keep_last: bool,
        memory: &mut CallMemory,
    ) {
        let n = settings.n_observations();
        let of = |array: &[u8]| if array.is_empty() { 0..0 } else { slot * PIXELS..(slot + 1) * PIXELS };
        let (pictures, final_pictures) = (of(rows.rasters), of(rows.final_rasters));
        if keep_last {
            let out = &mut rows.observations[slot * n..(slot + 1) * n];
            self.observe(slot, settings, (out, &mut rows.rasters[pictures]), memory);
        }
        if !rows.final_observations.is_empty() {
            let out = &mut rows.final_observations[slot * n..(slot + 1) * n];
            self.observe(slot, settings, (out, &mut rows.final_rasters[final_pictures]), memory);
        }
    }
}

/// Fills an unused row with zeros, unless it holds no observation: every observation begins with numbers about the
/// observer, of which its size is never zero.
fn clear(row: &mut [f32]) {
    if row[..EGO_LENGTH].iter().any(|value| value.to_bits() != 0) {
        row.fill(0.0);
    }
}

/// Writes what a learner observes about its planner: weights, terms of its last choice, how that came about.
fn observe_planner(own: &WeightActions, learner: &Learner, terms: Option<[f64; N_COSTS]>, out: &mut [f32]) {
    let powers = own.powers(&learner.weights).map(|power| (power / 3.0).clamp(-1.0, 1.0));
    // An infinite amount is 1.
    let shares = terms.unwrap_or_default().map(|amount| 1.0 - 1.0 / (1.0 + amount));
    let is = |flag: bool| f64::from(u8::from(flag));
    let none = learner.status == PlanStatus::None;
    let planned = learner.status == PlanStatus::Planned;
    let status = [is(planned), is(!planned && !none), is(none)];
    for (out, number) in out.iter_mut().zip(powers.chain(shares).chain(status)) {
        *out = number as f32;
    }
}
