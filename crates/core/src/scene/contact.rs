//! Contacts of a trajectory with predicted participants.

use super::Scene;
use crate::geometry::Pose;
use crate::geometry::shape::{OrientedBox, Shape};
use crate::trajectory::Predictions;

/// A footprint and where it is now.
#[derive(Debug, Clone, Copy)]
pub struct PlacedBody<'a> {
    /// In its body frame.
    pub shape: &'a Shape,
    /// Footprint centre.
    pub pose: Pose,
    /// Never moves.
    pub is_static: bool,
}

impl Scene {
    /// Id and interval of the first contact of a drive of `agent` that begins now with another predicted participant,
    /// where the most probable mode expects them; of several in one interval, the smallest id.
    ///
    /// `drive` holds the swept boxes of the intervals from now on. Participants are longer and wider by `margin` [m],
    /// in all, and are swept between their positions as well; static obstacles count with their exact shapes. `told` knows
    /// the bodies of participants that the agent does not see itself.
    pub fn first_contact<'a>(
        &'a self,
        agent: i64,
        drive: &[OrientedBox],
        predictions: &Predictions,
        margin: [f64; 2],
        told: &dyn Fn(i64) -> Option<PlacedBody<'a>>,
    ) -> Option<(i64, usize)> {
        let mut first: Option<(i64, usize)> = None;
        let now = self.body(agent).map(|body| body.pose);
        for (row, id) in predictions.ids.iter().enumerate().filter(|(_, id)| **id != agent) {
            let until = first.map_or(drive.len(), |(_, interval)| interval);
            let Some(body) = told(*id).or_else(|| self.body(*id)) else { continue };
            if now.is_some_and(|now| self.participants.storeys.are_apart(now, body.pose)) {
                continue;
            }
            let found = if body.is_static {
                contact_with_static(&drive[..until], body, margin)
            } else {
                self.contact_with_moving(&drive[..until], body, predictions, row, margin)
            };
            first = found.map(|interval| (*id, interval)).or(first);
        }
        first
    }

    /// Of a participant that is present.
    fn body(&self, id: i64) -> Option<PlacedBody<'_>> {
        let row =
            self.participants.ids.binary_search(&id).ok().filter(|row| self.present.binary_search(row).is_ok())?;
        let (shape, is_static) = (&self.participants.shape[row], self.participants.is_static[row]);
        Some(PlacedBody { shape, pose: self.state(row).pose(), is_static })
    }

    fn contact_with_moving(
        &self,
        drive: &[OrientedBox],
        PlacedBody { shape, pose, .. }: PlacedBody<'_>,
        predictions: &Predictions,
        row: usize,
        margin: [f64; 2],
    ) -> Option<usize> {
        let shift = usize::try_from(self.time_step - predictions.time_step).ok()?;
        let probability = &predictions.probability[row * predictions.n_modes..(row + 1) * predictions.n_modes];
        let likeliest =
            (1..probability.len()).fold(0, |best, k| if probability[k] > probability[best] { k } else { best });
        let first = predictions.offset(row, likeliest);
        let body = |pose: Pose| {
            let body = shape.oriented_box(pose);
            OrientedBox {
                half_length: body.half_length + 0.5 * margin[0],
                half_width: body.half_width + 0.5 * margin[1],
                ..body
            }
        };
        let mut before = body(pose);
        for (interval, swept) in drive.iter().enumerate().take(predictions.n_steps.saturating_sub(shift)) {
            let k = first + shift + interval;
            if !predictions.valid[k] {
                return None;
            }
            let after = body(Pose::new(predictions.x[k], predictions.y[k], predictions.orientation[k]));
            if swept.overlaps(&OrientedBox::spanning(&before, &after)) {
                return Some(interval);
            }
            before = after;
        }
        None
    }
}

fn contact_with_static(
    drive: &[OrientedBox],
    PlacedBody { shape, pose, .. }: PlacedBody<'_>,
    margin: [f64; 2],
) -> Option<usize> {
    let aabb = shape.aabb(pose);
    drive.iter().position(|swept| {
        let grown = OrientedBox {
            half_length: swept.half_length + 0.5 * margin[0],
            half_width: swept.half_width + 0.5 * margin[1],
            ..*swept
        };
        grown.aabb().overlaps(&aabb) && {
            let body = Shape::rectangle(2.0 * grown.half_length, 2.0 * grown.half_width);
            shape.overlaps(pose, &body, Pose { position: grown.center, orientation: grown.axis.angle() })
        }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::collision::swept_boxes;
    use crate::scene::Participants;
    use crate::trajectory::{State, States};
    use crate::vehicle::ParticipantKind;

    /// A car of 4 m by 2 m at (20, 0) that drives at 10 m/s towards the origin, and a standing wall from (0, 5) to
    /// (30, 5), 0.2 m thick.
    fn oncoming() -> (Scene, Predictions) {
        let mut past = States::absent(vec![3, 8], 0, 1);
        past.set(0, 0, &State { x: 20.0, orientation: std::f64::consts::PI, velocity: 10.0, ..State::default() });
        past.set(1, 0, &State { x: 15.0, y: 5.0, ..State::default() });
        let participants = Participants {
            ids: vec![3, 8],
            kind: vec![ParticipantKind::Car, ParticipantKind::Structure],
            shape: vec![Shape::rectangle(4.0, 2.0), Shape::rectangle(30.0, 0.2)],
            is_static: vec![false, true],
            is_agent: vec![false, false],
            ..Participants::default()
        };
        let mut predictions = Predictions::empty(0, vec![3, 8], 2, 10);
        for row in 0..2 {
            predictions.probability[2 * row] = 0.2;
            predictions.probability[2 * row + 1] = 0.8;
            for step in 0..10 {
                let k = predictions.offset(row, 1) + step;
                let x = if row == 0 { 20.0 - (step as f64 + 1.0) } else { 15.0 };
                predictions.x[k] = x;
                predictions.y[k] = if row == 0 { 0.0 } else { 5.0 };
                predictions.orientation[k] = if row == 0 { std::f64::consts::PI } else { 0.0 };
                predictions.valid[k] = true;
            }
        }
        let (present, turns) = (vec![0, 1], vec![None; 2]);
        let scene = Scene { time_step: 0, dt: 0.1, participants: Arc::new(participants), present, turns, past };
        (scene, predictions)
    }

    fn drive(velocity: f64, y: f64) -> Vec<OrientedBox> {
        let poses: Vec<Pose> = (0..=10).map(|i| Pose::new(velocity * 0.1 * f64::from(i), y, 0.0)).collect();
        swept_boxes(&poses, 4.0, 2.0)
    }

    #[test]
    fn two_that_meet_touch_in_the_interval_in_which_their_bumpers_meet() {
        let (scene, predictions) = oncoming();
        // 16 m between the bumpers close at 20 m/s: contact at 0.8 s, the end of interval 7.
        assert_eq!(scene.first_contact(1, &drive(10.0, 0.0), &predictions, [0.0, 0.0], &|_| None), Some((3, 7)));
        assert_eq!(scene.first_contact(1, &drive(10.0, 0.0), &predictions, [4.2, 0.0], &|_| None), Some((3, 6)));
        assert_eq!(scene.first_contact(1, &drive(5.0, 0.0), &predictions, [0.0, 0.0], &|_| None), None);
    }

    #[test]
    fn who_passes_beside_touches_only_with_the_margin() {
        let (scene, predictions) = oncoming();
        assert_eq!(scene.first_contact(1, &drive(10.0, 2.1), &predictions, [0.0, 0.0], &|_| None), None);
        assert_eq!(scene.first_contact(1, &drive(10.0, 2.1), &predictions, [0.0, 0.3], &|_| None), Some((3, 7)));
        assert_eq!(scene.first_contact(1, &drive(10.0, 3.95), &predictions, [0.0, 0.0], &|_| None), Some((8, 0)));
        assert_eq!(scene.first_contact(1, &drive(10.0, 3.85), &predictions, [0.0, 0.0], &|_| None), None);
    }

    #[test]
    fn only_others_of_the_predictions_count() {
        let (scene, predictions) = oncoming();
        assert_eq!(scene.first_contact(3, &drive(10.0, 0.0), &predictions, [0.0, 0.0], &|_| None), None);
        assert_eq!(scene.first_contact(1, &drive(10.0, 0.0), &predictions.of(&[8]), [0.0, 0.0], &|_| None), None);
    }
}
