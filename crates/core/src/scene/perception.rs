//! What an agent perceives of those that it sees: late, elsewhere and at another speed than they are, and not at every
//! time step. Errors are a pure function of seed, agent, participant and time, so a run that is repeated has them, too.

use super::{Scene, ViewLimits};
use crate::draws::{normal, uniform};
use crate::geometry::Point;
use crate::trajectory::{Predictions, State};

/// Errors change within this time [s].
const LASTING: f64 = 1.0;
/// Below this speed [m/s] a participant is expected to go as far as it is.
const SLOW: f64 = 0.5;
/// What a number is drawn for.
const X: i64 = 0;
const Y: i64 = 1;
const SPEED: i64 = 2;
const MISSED: i64 = 3;

impl ViewLimits {
    /// Participants seem to be where they are, as fast as they are.
    fn is_exact(&self) -> bool {
        self.delay == 0.0 && self.position_error == 0.0 && self.speed_error == 0.0
    }

    /// One participant, by their ids, does not perceive another one at a time step although it sees it.
    pub(super) fn misses(&self, ids: [i64; 2], time_step: i64) -> bool {
        self.missed > 0.0 && uniform(self.error_seed as u64, &[MISSED, ids[0], ids[1], time_step]) < self.missed
    }

    /// A standard normal number that changes from second to second.
    fn error(&self, purpose: i64, [own, other]: [i64; 2], time: f64) -> f64 {
        let place = time / LASTING;
        let (knot, share) = (place.floor(), place - place.floor());
        let drawn = |knot: f64| normal(self.error_seed as u64, [purpose, own, other, knot as i64]);
        // Its variance is 1 between the knots, too.
        ((1.0 - share) * drawn(knot) + share * drawn(knot + 1.0)) / (1.0 - share).hypot(share)
    }

    /// How a state seems to be at a time [s].
    fn seeming(&self, state: State, ids: [i64; 2], time: f64) -> State {
        let drawn = |purpose: i64, sd: f64| if sd > 0.0 { sd * self.error(purpose, ids, time) } else { 0.0 };
        State {
            x: state.x + drawn(X, self.position_error),
            y: state.y + drawn(Y, self.position_error),
            velocity: state.velocity * (1.0 + drawn(SPEED, self.speed_error)).max(0.0),
            ..state
        }
    }
}

impl Scene {
    /// The scene as the participant in a row perceives it: everybody else who can move is late and not quite where it is. A
    /// participant that has just come is where it came. `None` if nothing differs.
    pub fn perceived_by(&self, row: usize, limits: &ViewLimits) -> Option<Self> {
        if limits.is_exact() {
            return None;
        }
        let (mut seems, participants) = (self.clone(), &self.participants);
        let late = (limits.delay / self.dt).round() as i64;
        for other in (0..participants.ids.len()).filter(|other| *other != row && !participants.is_static[*other]) {
            let ids = [participants.ids[row], participants.ids[other]];
            for column in 0..self.past.n_steps {
                let then = self.past.first_time_step + column as i64;
                if self.past.get(other, then).is_none() {
                    continue;
                }
                if let Some(state) = (then - late..=then).find_map(|step| self.past.get(other, step)) {
                    seems.past.set(other, column, &limits.seeming(state, ids, then as f64 * self.dt));
                }
            }
        }
        Some(seems)
    }

    /// What is expected of participants that are perceived otherwise: the same ways from where they seem to be, and as much
    /// longer as they seem to be faster. `row_of` says where a place among those present is in the table.
    pub fn expected_of(
        &self,
        seems: &Self,
        predictions: &Predictions,
        row_of: &dyn Fn(usize) -> Option<usize>,
    ) -> Predictions {
        let mut found = predictions.clone();
        for (place, row) in self.present.iter().enumerate() {
            let (is, seen) = (self.state(*row), seems.state(*row));
            let Some(own) = row_of(place) else { continue };
            if is == seen {
                continue;
            }
            let stretch = if is.velocity.abs() > SLOW { seen.velocity / is.velocity } else { 1.0 };
            let (from, to) = (is.pose().position, seen.pose().position);
            let first = predictions.offset(own, 0);
            for k in (first..first + predictions.n_modes * predictions.n_steps).filter(|k| predictions.valid[*k]) {
                let way = Point::new(predictions.x[k] - from.x, predictions.y[k] - from.y) * stretch;
                (found.x[k], found.y[k]) = (to.x + way.x, to.y + way.y);
                found.velocity[k] *= stretch;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::geometry::shape::Shape;
    use crate::scene::{Participants, Storeys};
    use crate::trajectory::States;
    use crate::vehicle::ParticipantKind;

    /// An agent 1 that stands, and a car 2 that has driven from 0 along x with 10 m/s for 3 s, a step of 0.1 s ago.
    fn scene() -> Scene {
        let mut past = States::absent(vec![1, 2], 0, 31);
        for column in 0..31 {
            past.set(0, column, &State { y: 20.0, ..State::default() });
            past.set(1, column, &State { x: column as f64, velocity: 10.0, ..State::default() });
        }
        let participants = Participants {
            ids: vec![1, 2],
            kind: vec![ParticipantKind::Car; 2],
            shape: vec![Shape::rectangle(4.0, 2.0); 2],
            is_static: vec![false; 2],
            is_agent: vec![true; 2],
            storeys: Storeys::default(),
        };
        let participants = Arc::new(participants);
        Scene { time_step: 30, dt: 0.1, participants, present: vec![0, 1], turns: vec![None; 2], past }
    }

    fn perceived(limits: ViewLimits) -> Scene {
        scene().perceived_by(0, &limits).expect("it differs")
    }

    #[test]
    fn without_errors_nothing_differs() {
        assert!(scene().perceived_by(0, &ViewLimits { missed: 0.5, error_seed: 3, ..ViewLimits::default() }).is_none());
    }

    #[test]
    fn who_is_late_sees_what_was_and_itself_as_it_is() {
        let seems = perceived(ViewLimits { delay: 0.3, ..ViewLimits::default() });
        assert_eq!((seems.state(1).x, seems.state(0)), (27.0, scene().state(0)));
        assert_eq!(seems.past.get(1, 2).map(|state| state.x), Some(0.0), "it came there");
    }

    #[test]
    fn errors_have_their_spread_change_slowly_and_are_those_of_seed_agent_and_participant() {
        let drawn = |error_seed: usize, time: f64| {
            let limits = ViewLimits { position_error: 0.5, error_seed, ..ViewLimits::default() };
            limits.seeming(State::default(), [1, 2], time).x
        };
        let n = 4000;
        for time in [0.0, 0.3, 0.5] {
            let mean_square = (0..n).map(|seed| drawn(seed, time).powi(2)).sum::<f64>() / n as f64;
            assert!((mean_square.sqrt() - 0.5).abs() < 0.02, "{time} {mean_square}");
        }
        let steps: Vec<f64> = (0..100).map(|k| drawn(7, 0.1 * k as f64)).collect();
        let largest = steps.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(0.01 < largest && largest < 0.4, "{largest}");
        let limits = ViewLimits { position_error: 0.5, ..ViewLimits::default() };
        let of = |ids| limits.seeming(State::default(), ids, 1.0).x;
        assert!(of([1, 2]) != of([2, 1]) && of([1, 2]) != of([1, 3]) && drawn(1, 1.0) != drawn(2, 1.0));
    }

    #[test]
    fn a_share_of_looks_misses_a_participant() {
        let limits = ViewLimits { missed: 0.2, ..ViewLimits::default() };
        let missed = (0..5000).filter(|step| limits.misses([1, 2], *step)).count();
        assert!((900..1100).contains(&missed), "{missed}");
        assert!(!(0..5000).any(|step| ViewLimits::default().misses([1, 2], step)));
        let unseen = ViewLimits { missed: 1.0, ..ViewLimits::default() };
        assert_eq!(scene().visible_from(0, &unseen), Vec::<usize>::new());
    }

    #[test]
    fn expectations_begin_where_a_participant_seems_to_be_and_are_as_long_as_it_seems_fast() {
        let (is, mut seems) = (scene(), scene());
        seems.past.set(1, 30, &State { x: 29.0, y: 0.5, velocity: 11.0, ..State::default() });
        let mut table = Predictions::empty(30, vec![1, 2], 1, 2);
        for (k, x) in [(2, 31.0), (3, 32.0)] {
            (table.x[k], table.y[k], table.velocity[k], table.valid[k]) = (x, 0.0, 10.0, true);
        }
        let found = is.expected_of(&seems, &table, &Some);
        assert!((found.x[2] - 30.1).abs() < 1e-12 && (found.x[3] - 31.2).abs() < 1e-12, "{:?}", found.x);
        assert_eq!((found.y[3], found.velocity[3], found.valid[1]), (0.5, 11.0, false));
    }
}
