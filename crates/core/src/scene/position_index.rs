//! Where all participants present are, ordered so that those near a place are found without looking at all of them.

use super::{Participants, Scene};
use crate::geometry::Point;

/// From this many participants, and this many who look, on it takes less time to put them in order than to look at all.
const ORDERED_FROM: usize = 48;
const VIEWERS_FROM: usize = 6;
/// Up to this many places are put in order by marks.
const MARKED_MAX: usize = 2048;
/// Rounding of a position, and of the distance between two [m].
const ROUNDING: f64 = 1e-3;

/// Positions of the participants present at one time step, ascending in x where there are many.
#[derive(Debug, Clone, Default)]
pub(crate) struct PositionIndex {
    /// In the order of `Scene::present` [m]; behind them there may be those of others that agents were told of.
    pub(crate) positions: Vec<Point>,
    n_present: usize,
    /// x [m] and place of each position, ascending; empty if there are few.
    by_x: Vec<(f64, usize)>,
    /// Largest radius around a body that never moves: it is seen from so much farther [m].
    extra: f64,
}

impl PositionIndex {
    /// Puts other positions in the place of those that it has, of the participants in the rows that are present, for so
    /// many who look around.
    pub(crate) fn write(
        &mut self,
        participants: &Participants,
        present: &[usize],
        positions: impl Iterator<Item = Point>,
        viewers: usize,
    ) {
        self.positions.clear();
        self.positions.extend(positions);
        self.n_present = self.positions.len();
        self.by_x.clear();
        if self.n_present >= ORDERED_FROM && viewers >= VIEWERS_FROM {
            self.by_x.extend(self.positions.iter().map(|position| position.x).zip(0..));
            self.by_x.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let still = present.iter().filter(|row| participants.is_static[**row]);
            self.extra = still.map(|row| participants.shape[*row].bounding_radius()).fold(0.0, f64::max);
        }
    }

    /// Writes the places of all that may be within a radius of a position, ascending, and of few others.
    pub(crate) fn around(&self, eye: Point, radius: f64, places: &mut Vec<usize>) {
        places.clear();
        if self.by_x.is_empty() {
            places.extend(0..self.n_present);
            return;
        }
        let reach = radius + self.extra + ROUNDING;
        let from = self.by_x.partition_point(|(x, _)| *x < eye.x - reach);
        let near = self.by_x[from..].iter().take_while(|(x, _)| *x <= eye.x + reach);
        let near = near.map(|(_, place)| *place).filter(|place| (self.positions[*place].y - eye.y).abs() <= reach);
        if self.n_present > MARKED_MAX {
            places.extend(near);
            places.sort_unstable();
            return;
        }
        // A mark for each place takes less time than sorting.
        let mut marks = [0_u64; MARKED_MAX / 64];
        near.for_each(|place| marks[place / 64] |= 1 << (place % 64));
        for (word, mut left) in marks.into_iter().enumerate().take(self.n_present.div_ceil(64)) {
            while left != 0 {
                places.push(64 * word + left.trailing_zeros() as usize);
                left &= left - 1;
            }
        }
    }
}

impl Scene {
    /// Where the participants present are, for so many who look around.
    pub(crate) fn position_index(&self, viewers: usize) -> PositionIndex {
        let mut index = PositionIndex::default();
        let positions = self.present.iter().map(|row| self.state(*row).pose().position);
        index.write(&self.participants, &self.present, positions, viewers);
        index
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Storeys, ViewLimits};
    use super::*;
    use crate::geometry::shape::{Lcg, Shape};
    use crate::trajectory::{State, States};
    use crate::vehicle::ParticipantKind;
    use std::sync::Arc;

    #[test]
    fn in_a_crowd_exactly_those_near_are_seen() {
        let mut random = Lcg::new(3);
        let n = 400_usize;
        let mut past = States::absent((0..n as i64).collect(), 0, 1);
        for row in 0..n {
            // Every fourth at 80 m from the one before, to the east: it is seen from there.
            let before = past.get(row.saturating_sub(1), 0).filter(|_| row % 4 == 3);
            let (x, y) = before
                .map_or_else(|| (random.within(-300.0, 300.0), random.within(-300.0, 300.0)), |at| (at.x + 80.0, at.y));
            past.set(row, 0, &State { x, y, ..State::default() });
        }
        let participants = Participants {
            ids: (0..n as i64).collect(),
            kind: vec![ParticipantKind::Car; n],
            shape: (0..n).map(|row| Shape::rectangle(if row % 5 == 0 { 30.0 } else { 4.0 }, 2.0)).collect(),
            is_static: (0..n).map(|row| row % 5 == 0).collect(),
            is_agent: vec![false; n],
            storeys: Storeys::default(),
        };
        let scene = Scene {
            time_step: 0,
            dt: 0.1,
            participants: Arc::new(participants),
            present: (0..n).collect(),
            turns: vec![None; n],
            past,
        };
        let limits = ViewLimits::default();
        let position = |row: usize| scene.state(row).pose().position;
        let mut index = scene.position_index(n);
        assert!(!index.by_x.is_empty());
        // What an agent was told of is not seen.
        index.positions.push(position(0));
        let mut seen = Vec::new();
        for row in 0..n {
            let is_near = |other: usize, limits| {
                other != row && scene.participants.is_near(other, position(other), position(row), limits)
            };
            let all: Vec<usize> = (0..n).filter(|other| is_near(*other, &limits)).collect();
            scene.see(row, &limits, &index, &mut seen);
            assert_eq!(seen, all, "from {row}");
            assert_eq!(scene.visible_from(row, &limits), all, "alone, from {row}");
            assert!(all.len() < n / 4, "{} of {n}", all.len());
        }
        scene.see(0, &ViewLimits { sensor_radius: f64::INFINITY, ..limits }, &index, &mut seen);
        assert_eq!(seen.len(), n - 1);
    }
}
