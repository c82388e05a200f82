//! The measures, their names and their more critical directions.

/// A measure; its position is the index in [`super::Criticality::series`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Measure {
    /// Headway [m].
    Hw = 0,
    /// Time headway [s].
    Thw = 1,
    /// Time to collision [s].
    Ttc = 2,
    /// Share of time exposed to a small time to collision, from here on.
    Tet = 3,
    /// Time-integrated time to collision [s²], from here on.
    Tit = 4,
    /// Distance of closest encounter [m].
    Dce = 5,
    /// Time to closest encounter [s].
    Ttce = 6,
    /// Encroachment time [s].
    Et = 7,
    /// Post-encroachment time [s].
    Pet = 8,
    /// Required longitudinal acceleration [m/s²].
    ALongReq = 9,
    /// Brake threat number.
    Btn = 10,
    /// Required lateral acceleration [m/s²].
    ALatReq = 11,
    /// Steer threat number.
    Stn = 12,
    /// Proportion of stopping distance.
    Psd = 13,
    /// Minimal stopping distance [m].
    Msd = 14,
}

impl Measure {
    /// All, in order, with the names used outside.
    pub const ALL: [(Self, &'static str); 15] = [
        (Self::Hw, "hw"),
        (Self::Thw, "thw"),
        (Self::Ttc, "ttc"),
        (Self::Tet, "tet"),
        (Self::Tit, "tit"),
        (Self::Dce, "dce"),
        (Self::Ttce, "ttce"),
        (Self::Et, "et"),
        (Self::Pet, "pet"),
        (Self::ALongReq, "a_long_req"),
        (Self::Btn, "btn"),
        (Self::ALatReq, "a_lat_req"),
        (Self::Stn, "stn"),
        (Self::Psd, "psd"),
        (Self::Msd, "msd"),
    ];

    /// Measures of the vehicle ahead on the paths.
    pub const FOLLOWING: [Self; 7] =
        [Self::Hw, Self::Thw, Self::Ttc, Self::ALongReq, Self::Btn, Self::ALatReq, Self::Stn];

    /// Larger values are more critical.
    pub fn grows(self) -> bool {
        use Measure::{ALatReq, Btn, Msd, Stn, Tet, Tit};
        matches!(self, Btn | ALatReq | Stn | Msd | Tet | Tit)
    }
}
