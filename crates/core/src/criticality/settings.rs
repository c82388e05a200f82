//! Options of the criticality measures.

use std::f64::consts::PI;

use crate::settings::{NOT_NEGATIVE, choice, positive, settings};

choice! {
    /// Which participants count as ahead on a path.
    pub enum LeadMembership {
        /// Those whose centre lies on one of its lanelets.
        Center = "center",
        /// Those whose footprint reaches into one of its lanelets.
        Footprint = "footprint",
    }
}

choice! {
    /// What time headway is.
    pub enum ThwMode {
        /// Headway over speed.
        Normalized = "normalized",
        /// Time until the recorded vehicle reaches the place where the one ahead is now.
        Recorded = "recorded",
    }
}

settings! {
    /// Parameters and switches of all measures; the defaults are those of docs/reference/criticality.md.
    pub struct Settings as MeasureSettings {
        /// Distance, centre to centre, within which other participants count.
        radius: f64 ["m"] = 100.0, positive(f64::MAX);
        /// Time to collision along lanes up to which a vehicle is exposed.
        ttc_threshold: f64 ["s"] = 2.0, positive(f64::MAX);
        /// Available deceleration; the default is the tyre limit of CommonRoad's vehicle type 2 on a dry road, which is
        /// optimistic.
        deceleration: f64 ["m/s²"] = 11.5, positive(f64::MAX);
        /// Available lateral acceleration.
        lateral_acceleration: f64 ["m/s²"] = 8.0, positive(f64::MAX);
        /// Oncoming traffic counts only where its path meets that of the evaluated vehicle.
        oncoming_filter: bool = true;
        /// Heading difference beyond which traffic is oncoming.
        opposite_angle: f64 ["rad"] = 135.0_f64.to_radians(), positive(PI);
        /// Erosion of lanelets before their overlap is measured.
        erosion: f64 ["m"] = 0.3, NOT_NEGATIVE;
        /// Largest overlap that does not count.
        overlap_min: f64 ["m²"] = 0.1, NOT_NEGATIVE;
        /// Participants that count as ahead: those whose centre lies on the path, or whose footprint reaches into it.
        lead_membership: LeadMembership;
        /// Time headway: normalized is headway divided by speed, recorded is the time until the recording reaches the
        /// present place of the vehicle ahead.
        thw_mode: ThwMode;
        /// The required longitudinal acceleration assumes that a braking vehicle ahead comes to rest and stays there.
        leader_stops: bool = false;
    }
}
