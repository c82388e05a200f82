//! What an agent perceives of those that it sees: late, elsewhere and at another speed than they are, and not at every
//! time step. Errors are a pure function of seed, agent, participant and time, so a run that is repeated has them, too.

use std::sync::Arc;

use super::{Scene, ViewLimits};
use crate::draws::{normal, uniform};
use crate::geometry::Point;
use crate::trajectory::{Predictions, State};

/// Errors change within this time [s].
const LASTING: f64 = 1.0;
/// What a number is drawn for.
const X: i64 = 0;
const Y: i64 = 1;
const SPEED: i64 = 2;
const MISSED: i64 = 3;

impl ViewLimits {
    /// Participants seem to be where they are, as fast as they are.
    pub(crate) fn is_exact(&self) -> bool {
        self.delay == 0.0 && self.position_error == 0.0 && self.speed_error == 0.0
    }

    /// What it perceives depends on draws.
    pub(crate) fn errs(&self) -> bool {
        self.position_error > 0.0 || self.speed_error > 0.0 || self.missed > 0.0
    }

    /// One participant, by their ids, does not perceive another one at a time step although it sees it.
    pub(crate) fn misses(&self, ids: [i64; 2], time_step: i64) -> bool {
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

    /// How many time steps late it is.
    pub(crate) fn late_steps(&self, dt: f64) -> i64 {
        (self.delay / dt).round() as i64
    }

    fn drawn(&self, purpose: i64, sd: f64, ids: [i64; 2], time: f64) -> f64 {
        if sd > 0.0 { sd * self.error(purpose, ids, time) } else { 0.0 }
    }

    /// How many times as fast one participant seems to another at a time [s].
    fn speed_factor(&self, ids: [i64; 2], time: f64) -> f64 {
        (1.0 + self.drawn(SPEED, self.speed_error, ids, time)).max(0.0)
    }

    /// How a state seems to be at a time [s].
    fn seeming(&self, state: State, ids: [i64; 2], time: f64) -> State {
        State {
            x: state.x + self.drawn(X, self.position_error, ids, time),
            y: state.y + self.drawn(Y, self.position_error, ids, time),
            velocity: state.velocity * self.speed_factor(ids, time),
            ..state
        }
    }
}

/// What an agent perceives, where that is not all as it is.
#[derive(Debug, Clone)]
pub struct Perceived {
    /// Those that it sees where they seem to be, with the past.
    pub scene: Arc<Scene>,
    /// How those present seem to move, in the order of `present`.
    motions: Vec<Motion>,
}

/// How a participant moves along its heading, as it can be observed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    /// [m/s]
    pub(crate) velocity: f64,
    /// Deceleration, not negative [m/s²].
    pub(crate) braking: f64,
}

impl Scene {
    /// The scene as the participant in a row perceives it: those of the rows that it sees who can move are late and not quite
    /// where they are. A participant that has just come is where it was before if it came at its first speed. `None` if
    /// nothing differs.
    pub fn perceived_by(&self, row: usize, limits: &ViewLimits, seen: &[usize]) -> Option<Perceived> {
        if limits.is_exact() {
            return None;
        }
        let mut seems = self.clone();
        let mut motions: Vec<Motion> =
            self.present.iter().map(|other| self.motion(*other, self.time_step, 1.0)).collect();
        for other in seen.iter().copied().filter(|other| self.differs(row, *other)) {
            for column in 0..self.past.n_steps {
                let then = self.past.first_time_step + column as i64;
                if let Some(state) = self.seeming_at(row, other, limits, then) {
                    seems.past.set(other, column, &state);
                }
            }
            if let Ok(place) = self.present.binary_search(&other) {
                motions[place] = self.seeming_motion(row, other, limits);
            }
        }
        Some(Perceived { scene: Arc::new(seems), motions })
    }

    /// How one who is present seems to be and to move now to the participant in a row; `None`: as it is and does.
    pub(crate) fn seeming_to(&self, row: usize, other: usize, limits: &ViewLimits) -> Option<(State, Motion)> {
        if limits.is_exact() || !self.differs(row, other) {
            return None;
        }
        Some((self.seeming_at(row, other, limits, self.time_step)?, self.seeming_motion(row, other, limits)))
    }

    fn differs(&self, row: usize, other: usize) -> bool {
        other != row && !self.participants.is_static[other]
    }

    fn ids_of(&self, row: usize, other: usize) -> [i64; 2] {
        [self.participants.ids[row], self.participants.ids[other]]
    }

    /// How another one seemed to be at a time step at which it was there.
    fn seeming_at(&self, row: usize, other: usize, limits: &ViewLimits, then: i64) -> Option<State> {
        let (_, state) = self.some_time_before(other, then, limits.late_steps(self.dt))?;
        Some(limits.seeming(state, self.ids_of(row, other), then as f64 * self.dt))
    }

    fn seeming_motion(&self, row: usize, other: usize, limits: &ViewLimits) -> Motion {
        // Errors would contradict the true speeds, so these are observed first.
        let late = limits.late_steps(self.dt);
        let (then, _) = self.some_time_before(other, self.time_step, late).expect("it is present");
        self.motion(other, then, limits.speed_factor(self.ids_of(row, other), self.time_step as f64 * self.dt))
    }

    /// Where a participant was so many time steps before one at which it is there, and the time step at which it was observed:
    /// the first one, if it came later.
    fn some_time_before(&self, row: usize, then: i64, steps: i64) -> Option<(i64, State)> {
        self.past.get(row, then)?;
        let (first, state) = (then - steps..=then).find_map(|step| Some((step, self.past.get(row, step)?)))?;
        let way = Point::from_angle(state.orientation) * (state.velocity * (first - (then - steps)) as f64 * self.dt);
        Some((first, State { x: state.x - way.x, y: state.y - way.y, ..state }))
    }

    fn motion(&self, row: usize, then: i64, factor: f64) -> Motion {
        let velocity = self.observed_velocity_at(row, then).expect("it was there");
        let braking = self.observed_braking_at(row, then).expect("it was there");
        Motion { velocity: velocity * factor, braking: braking * factor }
    }
}

impl Perceived {
    /// Speed along the heading as a participant present, by its place, seems to have it [m/s].
    pub(crate) fn velocity(&self, place: usize) -> f64 {
        self.motions[place].velocity
    }

    /// Its deceleration, not negative [m/s²].
    #[cfg(test)]
    fn braking(&self, place: usize) -> f64 {
        self.motions[place].braking
    }

    /// What is expected of participants that are perceived otherwise than they are in `truth`: the same ways from where they
    /// seem to be, all the time as much faster or slower as they seem to be now. `row_of` says where a place among those
    /// present is in the table.
    pub fn expected(
        &self,
        truth: &Scene,
        predictions: &Predictions,
        row_of: &dyn Fn(usize) -> Option<usize>,
    ) -> Predictions {
        let mut found = predictions.clone();
        for (place, row) in truth.present.iter().enumerate() {
            let (is, seen) = (truth.state(*row), self.scene.state(*row));
            let faster = self.velocity(place) - truth.observed_velocity(*row);
            let Some(own) = row_of(place) else { continue };
            if is == seen && faster == 0.0 {
                continue;
            }
            found.shift(own, seen.pose().position - is.pose().position, faster, truth.dt);
        }
        found
    }
}

impl Predictions {
    /// Has a row begin elsewhere, and be faster all the time by a speed [m/s].
    pub(crate) fn shift(&mut self, row: usize, off: Point, faster: f64, dt: f64) {
        for mode in 0..self.n_modes {
            let first = self.offset(row, mode);
            let mut off = off;
            for k in (first..first + self.n_steps).filter(|k| self.valid[*k]) {
                let (velocity, axis) = (self.velocity[k], Point::from_angle(self.orientation[k]));
                self.velocity[k] = changed(velocity, faster);
                off = off + axis * ((self.velocity[k] - velocity) * dt);
                (self.x[k], self.y[k]) = (self.x[k] + off.x, self.y[k] + off.y);
            }
        }
    }
}

/// A speed and a change of it [m/s], after which nobody goes the other way.
fn changed(velocity: f64, by: f64) -> f64 {
    if velocity < 0.0 { (velocity + by).min(0.0) } else { (velocity + by).max(0.0) }
}

#[cfg(test)]
mod tests {
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

    fn perceived(limits: ViewLimits) -> Perceived {
        scene().perceived_by(0, &limits, &[1]).expect("it differs")
    }

    #[test]
    fn without_errors_nothing_differs() {
        assert!(
            scene()
                .perceived_by(0, &ViewLimits { missed: 0.5, error_seed: 3, ..ViewLimits::default() }, &[1])
                .is_none()
        );
    }

    #[test]
    fn who_is_late_sees_what_was_and_itself_as_it_is() {
        let seems = perceived(ViewLimits { delay: 0.3, ..ViewLimits::default() });
        assert_eq!((seems.scene.state(1).x, seems.scene.state(0)), (27.0, scene().state(0)));
        let x = |step| seems.scene.past.get(1, step).expect("it was there").x;
        assert!((x(2) + 1.0).abs() < 1e-12 && (x(0) + 3.0).abs() < 1e-12, "it had come before, at 10 m/s");
        let moved: Vec<f64> = (1..31).map(|step| x(step) - x(step - 1)).collect();
        assert!(moved.iter().all(|way| (way - 1.0).abs() < 1e-12), "it never stands: {moved:?}");
    }

    #[test]
    fn one_that_is_replayed_seems_as_fast_as_its_error_of_speed_says_wherever_it_seems_to_be() {
        let mut scene = scene();
        Arc::make_mut(&mut scene.participants).is_agent[1] = false;
        for (delay, position_error) in [(0.3, 0.0), (0.0, 5.0), (3.0, 2.0)] {
            let limits = ViewLimits { delay, position_error, speed_error: 0.3, error_seed: 2, ..ViewLimits::default() };
            let seems = scene.perceived_by(0, &limits, &[1]).expect("it differs");
            assert_eq!(seems.velocity(1), seems.scene.state(1).velocity, "planners of the core perceive the same");
            assert!((seems.velocity(1) - 10.0).abs() > 1.0 && seems.braking(1) == 0.0);
            let (state, motion) = scene.seeming_to(0, 1, &limits).expect("it differs");
            assert_eq!((state, motion.velocity), (seems.scene.state(1), seems.velocity(1)));
            assert!(scene.seeming_to(0, 0, &limits).is_none(), "it perceives itself as it is");
            let unseen = scene.perceived_by(0, &limits, &[]).expect("it looks with errors");
            assert_eq!((unseen.scene.state(1), unseen.velocity(1)), (scene.state(1), 10.0));
        }
    }

    #[test]
    fn braking_is_perceived_late() {
        let mut scene = scene();
        for step in 21..31 {
            let velocity = 10.0 - 0.5 * (step - 20) as f64;
            scene.past.set(1, step, &State { x: step as f64, velocity, ..State::default() });
        }
        let seems =
            |delay| scene.perceived_by(0, &ViewLimits { delay, ..ViewLimits::default() }, &[1]).expect("it differs");
        assert!((seems(0.3).braking(1) - 5.0).abs() < 1e-9 && seems(1.0).braking(1) == 0.0);
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

    /// What is expected 0.1 and 0.2 s ahead, in x and as speeds, of car 2, which is at 30 m with a speed [m/s] and keeps it,
    /// by an agent to which it seems to be at 29 m, 0.5 m to the left, with another speed.
    fn expected(speed: f64, seeming: f64) -> ([f64; 2], [f64; 2]) {
        let (mut is, mut table) = (scene(), Predictions::empty(30, vec![1, 2], 1, 2));
        is.past.set(1, 30, &State { x: 30.0, velocity: speed, ..State::default() });
        let mut seems = is.clone();
        seems.past.set(1, 30, &State { x: 29.0, y: 0.5, velocity: seeming, ..State::default() });
        let motions = [0.0, seeming].map(|velocity| Motion { velocity, braking: 0.0 }).to_vec();
        for (k, t) in [(2, 0.1), (3, 0.2)] {
            (table.x[k], table.y[k], table.orientation[k]) = (30.0 + speed * t, 0.0, 0.0);
            (table.velocity[k], table.valid[k]) = (speed, true);
        }
        let found = Perceived { scene: Arc::new(seems), motions }.expected(&is, &table, &Some);
        assert_eq!((&found.y[2..], &found.valid[..]), (&[0.5, 0.5][..], &[false, false, true, true][..]));
        ([found.x[2], found.x[3]], [found.velocity[2], found.velocity[3]])
    }

    #[test]
    fn expectations_begin_where_a_participant_seems_to_be_and_go_on_as_much_faster_as_it_seems_to_be() {
        for (speed, seeming, x, velocity) in [
            (10.0, 11.0, [30.1, 31.2], 11.0),
            (10.0, 8.0, [29.8, 30.6], 8.0),
            // A leader has come to a stop, and is seen late: nobody knows that it has.
            (0.51, 5.0, [29.5, 30.0], 5.0),
            (0.0, 5.0, [29.5, 30.0], 5.0),
            // It starts.
            (5.0, 0.0, [29.0, 29.0], 0.0),
        ] {
            let (found, speeds) = expected(speed, seeming);
            assert!(found.iter().zip(x).all(|(found, x)| (found - x).abs() < 1e-9), "{speed} {seeming}: {found:?}");
            assert!(speeds.iter().all(|found| (found - velocity).abs() < 1e-9), "{speed} {seeming}: {speeds:?}");
        }
    }

    #[test]
    fn who_brakes_to_a_stop_is_not_expected_to_go_backwards() {
        assert_eq!(
            [changed(2.0, -3.0), changed(-2.0, 3.0), changed(0.0, -1.0), changed(2.0, 1.0)],
            [0.0, 0.0, 0.0, 3.0]
        );
    }
}
