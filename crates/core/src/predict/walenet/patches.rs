//! Tables of what was computed from patches of a map.

/// An input of which there is nothing to be known.
pub(super) const NONE: u16 = u16::MAX;
/// Slots of a table at first.
const SLOTS: usize = 32_768;

/// Vectors by the patch that they were computed from: a patch has `WORDS` words, its entry is a row of `rows`.
///
/// Open addressing; entry `i` belongs to the i-th patch. Fewer than 2^15 entries fit, which is for the owner to see to.
#[derive(Debug, Clone, Default)]
pub(super) struct Patches<const WORDS: usize> {
    /// Entry by slot; `NONE`: free. Always less than half full.
    slots: Vec<u16>,
    patches: Vec<[u64; WORDS]>,
    /// Memory of all rows; what stands behind the last entry is left over.
    rows: Vec<f32>,
}

impl<const WORDS: usize> Patches<WORDS> {
    /// Number of entries.
    pub(super) fn len(&self) -> usize {
        self.patches.len()
    }

    /// The patches of the last `n` entries.
    pub(super) fn last(&self, n: usize) -> &[[u64; WORDS]] {
        &self.patches[self.patches.len() - n..]
    }

    /// All rows.
    pub(super) fn rows(&self) -> &[f32] {
        &self.rows
    }

    /// The rows of the last `n` entries, to be written; `width` numbers each.
    pub(super) fn last_rows(&mut self, n: usize, width: usize) -> &mut [f32] {
        let (from, to) = ((self.len() - n) * width, self.len() * width);
        if self.rows.len() < to {
            // All at once: memory that is not used costs nothing, moving rows to a larger place would.
            self.rows.reserve_exact((SLOTS / 2 * width).saturating_sub(self.rows.len()));
            self.rows.resize(to, 0.0);
        }
        &mut self.rows[from..to]
    }

    /// The entry of a patch, and whether it is new: then its row must be written.
    pub(super) fn entry(&mut self, patch: [u64; WORDS]) -> (u16, bool) {
        if self.slots.len() < 2 * (self.len() + 1) {
            self.slots = vec![NONE; (2 * self.slots.len()).max(SLOTS)];
            for entry in 0..self.len() {
                let slot = self.slot(&self.patches[entry]);
                self.slots[slot] = entry as u16;
            }
        }
        let slot = self.slot(&patch);
        let is_new = self.slots[slot] == NONE;
        if is_new {
            self.slots[slot] = self.len() as u16;
            self.patches.push(patch);
        }
        (self.slots[slot], is_new)
    }

    /// The slot of a patch, or the free one where it belongs.
    #[inline]
    fn slot(&self, patch: &[u64; WORDS]) -> usize {
        let mask = self.slots.len() - 1;
        let mixed =
            patch.iter().fold(0_u64, |mixed, word| (mixed.rotate_left(23) ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let mut slot = (mixed >> 32) as usize & mask;
        while self.slots[slot] != NONE && self.patches[self.slots[slot] as usize] != *patch {
            slot = (slot + 1) & mask;
        }
        slot
    }

    /// Forgets everything, but keeps the memory.
    pub(super) fn clear(&mut self) {
        self.slots.fill(NONE);
        self.patches.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_patch_is_found_again_and_nothing_of_what_was_forgotten() {
        let mut table = Patches::<2>::default();
        let patches: Vec<[u64; 2]> = (1..=30_000_u64).map(|i| [i % 7, i.wrapping_mul(0x0101_0005)]).collect();
        for is_new in [true, false] {
            for (entry, patch) in patches.iter().enumerate() {
                assert_eq!(table.entry(*patch), (entry as u16, is_new));
            }
        }
        assert!(2 * table.len() < table.slots.len());
        assert_eq!(table.last(2), &patches[29_998..]);
        table.clear();
        assert_eq!(table.entry(patches[77]), (0, true), "begun anew");
    }

    #[test]
    fn rows_stay_where_entries_are_added() {
        let mut table = Patches::<1>::default();
        for i in 0..3_u16 {
            table.entry([u64::from(i)]);
            table.last_rows(1, 4).fill(f32::from(i));
        }
        assert_eq!(table.rows()[..12], [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
    }
}
