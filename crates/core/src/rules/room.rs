//! Room behind a passage.

use super::course::Passage;
use super::meeting::{Ahead, Body, Meeting, Seen};

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
        seen: &Seen<'_>,
    ) -> (bool, Option<usize>) {
        let traveller = &self.travellers[index];
        let mut needed = reserved + self.bodies[traveller.body].length + ROOM;
        let (mut fits, mut before_crosswalk, mut nearest) = (true, needed, None);
        for &Ahead { rear, body, .. } in seen.ahead(index, passage.end) {
            let Body { length, velocity, .. } = self.bodies[body];
            nearest = nearest.or(Some(body));
            let braking = 0.5 * velocity.powi(2) / BRAKING;
            fits &= rear + braking - passage.end >= needed;
            needed += length + ROOM;
            if rear + length <= traveller.crosswalk {
                before_crosswalk = needed;
            }
        }
        fits &= traveller.crosswalk - passage.end >= before_crosswalk;
        (fits, nearest)
    }
}
