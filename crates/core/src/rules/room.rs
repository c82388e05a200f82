//! Room behind a passage.

use super::course::Passage;
use super::meeting::{Body, Meeting};

/// Room that is left behind a passage and between vehicles beside their lengths [m].
pub(super) const ROOM: f64 = 1.0;
/// Vehicles ahead brake so hard at most [m/s²]: they rarely stop where they have just begun to move.
const BRAKING: f64 = 0.5;

impl Meeting<'_> {
    /// Whether there is room for an agent behind a passage beside what is reserved [m], and the last body there. Each body
    /// ahead may come to rest, with all that are between, and so do those before a crosswalk that holds the agent.
    pub(super) fn has_room(
        &self,
        index: usize,
        passage: &Passage,
        reserved: f64,
        seen: &[usize],
    ) -> (bool, Option<usize>) {
        let traveller = &self.travellers[index];
        let mut needed = reserved + self.bodies[traveller.body].length + ROOM;
        let ahead = self.ahead(index, passage.end, seen);
        let (mut fits, mut before_crosswalk) = (true, needed);
        for &(rear, other) in &ahead {
            let Body { length, velocity, .. } = self.bodies[other];
            let braking = 0.5 * velocity.powi(2) / BRAKING;
            fits &= rear + braking - passage.end >= needed;
            needed += length + ROOM;
            if rear + length <= traveller.crosswalk {
                before_crosswalk = needed;
            }
        }
        fits &= traveller.crosswalk - passage.end >= before_crosswalk;
        (fits, ahead.first().map(|one| one.1))
    }

    /// Bodies on the path of a traveller whose front is beyond an arc length [m], the nearest one first: arc length of the
    /// rear [m], and position in `bodies`.
    pub(super) fn ahead(&self, index: usize, beyond: f64, seen: &[usize]) -> Vec<(f64, usize)> {
        let traveller = &self.travellers[index];
        let place = |&other: &usize| {
            let front = self.front_on(traveller.course, other, traveller.front)?;
            (other != traveller.body && front > beyond).then(|| (front - self.bodies[other].length, other))
        };
        let mut ahead: Vec<(f64, usize)> = seen.iter().filter_map(place).collect();
        ahead.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ahead
    }
}
