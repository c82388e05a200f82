//! Turns to the left and to the right.

/// A way across a junction, or the side that blinkers show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Turn {
    /// To the left.
    Left = 0,
    /// Straight on.
    Straight = 1,
    /// To the right.
    Right = 2,
}

impl Turn {
    /// All turns; the position is the code that crosses the Python boundary.
    pub const ALL: [Self; 3] = [Self::Left, Self::Straight, Self::Right];

    /// Of a way with this change of heading [rad], left positive: from 25 degrees on it turns.
    pub fn of_angle(angle: f64) -> Self {
        /// [rad]; lanes that only bend change their heading by less.
        const TURN: f64 = 25.0 / 180.0 * std::f64::consts::PI;
        match angle {
            _ if angle > TURN => Self::Left,
            _ if angle < -TURN => Self::Right,
            _ => Self::Straight,
        }
    }
}
