//! Which participants may drive on a lanelet.

use crate::vehicle::ParticipantKind;

/// Kinds of participants for which a lanelet is a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Users(u32);

impl Users {
    /// A lane for all kinds.
    pub const ALL: Self = Self(u32::MAX);

    /// From one bit per kind, that of code 0 lowest.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// It is a lane for this kind.
    pub fn admits(self, kind: ParticipantKind) -> bool {
        self.0 & (1 << kind as u32) != 0
    }

    /// It is a lane for all kinds that `other` admits.
    pub fn covers(self, other: Self) -> bool {
        other.0 & !self.0 == 0
    }
}
