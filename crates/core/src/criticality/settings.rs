//! What can be chosen about the measures.

use std::f64::consts::PI;

use crate::error::{Error, Result};

/// Which participants count as ahead on a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LeadMembership {
    /// Those whose centre lies on one of its lanelets.
    #[default]
    Center,
    /// Those whose footprint reaches into one of its lanelets.
    Footprint,
}

/// What time headway is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ThwMode {
    /// Headway over speed.
    #[default]
    Normalized,
    /// Time until the recorded vehicle reaches the place where the one ahead is now.
    Recorded,
}

/// Parameters and switches of all measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Others count within this distance, centre to centre [m].
    pub radius: f64,
    /// Time to collision below which a vehicle is exposed [s].
    pub ttc_threshold: f64,
    /// Deceleration that is available [m/s²]; can be given per vehicle.
    pub deceleration: f64,
    /// Lateral acceleration that is available [m/s²].
    pub lateral_acceleration: f64,
    /// Oncoming traffic counts only where the ways meet.
    pub oncoming_filter: bool,
    /// Heading difference beyond which traffic is oncoming [rad].
    pub opposite_angle: f64,
    /// Lanelets are eroded by this much before their overlap is measured [m].
    pub erosion: f64,
    /// Overlaps up to this size do not count [m²].
    pub overlap_min: f64,
    /// Which participants count as ahead.
    pub lead_membership: LeadMembership,
    /// What time headway is.
    pub thw_mode: ThwMode,
    /// A braking leader comes to rest and stays there.
    pub leader_stops: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            radius: 100.0,
            ttc_threshold: 2.0,
            deceleration: 11.5,
            lateral_acceleration: 8.0,
            oncoming_filter: true,
            opposite_angle: 135.0_f64.to_radians(),
            erosion: 0.3,
            overlap_min: 0.1,
            lead_membership: LeadMembership::Center,
            thw_mode: ThwMode::Normalized,
            leader_stops: false,
        }
    }
}

impl Settings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// `InvalidInput` naming the setting.
    pub fn validate(&self) -> Result<()> {
        for (name, value) in [
            ("radius", self.radius),
            ("ttc_threshold", self.ttc_threshold),
            ("deceleration", self.deceleration),
            ("lateral_acceleration", self.lateral_acceleration),
            ("opposite_angle", self.opposite_angle),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::invalid(format!("criticality setting {name} must be positive, not {value}")));
            }
        }
        if self.opposite_angle > PI {
            let value = self.opposite_angle;
            return Err(Error::invalid(format!("criticality setting opposite_angle must be at most pi, not {value}")));
        }
        for (name, value) in [("erosion", self.erosion), ("overlap_min", self.overlap_min)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::invalid(format!("criticality setting {name} must not be negative, is {value}")));
            }
        }
        Ok(())
    }
}
