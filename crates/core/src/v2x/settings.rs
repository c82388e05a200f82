//! Settings of cooperation.

use crate::error::{Error, Result};
use crate::settings::{between, positive, settings};

settings! {
    /// Cooperation of agents by V2X messages.
    pub struct V2xSettings as V2xSettings {
        /// Share of agents equipped with V2X; 0: no cooperation.
        penetration: f64 = 0.0, between(0.0, 1.0);
        /// Equipped agents send their state (cooperative awareness).
        cam: bool = true;
        /// Equipped agents send their plan (maneuver coordination).
        mcm: bool = true;
        /// Equipped agents send the objects that they see (collective perception).
        cpm: bool = false;
        /// Constant part of the delay.
        delay: f64 ["s"] = 0.0, between(0.0, 10.0);
        /// Largest random part of the delay, drawn uniformly from 0.
        jitter: f64 ["s"] = 0.0, between(0.0, 10.0);
        /// Probability that a receiver within range loses a message.
        loss: f64 = 0.0, between(0.0, 1.0);
        /// Range of the radio.
        range: f64 ["m"] = 300.0, positive(1e6);
        /// Reception fades with distance (Nakagami, m = 3) instead of ending at the range.
        fading: bool = false;
        /// Agents whose paths cross agree which of them goes first.
        negotiate: bool = false;
        /// Distance that a yielding agent keeps to the conflict zone.
        hold_margin: f64 ["m"] = 1.0, between(0.3, 5.0);
        /// Time between messages with the plan, unless the plan changes.
        mcm_interval: f64 ["s"] = 0.1, positive(10.0);
        /// Largest message; plans and object lists are truncated to fit.
        max_bytes: usize ["B"] = 1100, between(300.0, 65_535.0);
        /// Age above which messages are discarded.
        age_max: f64 ["s"] = 1.5, positive(60.0);
        /// Time between the points of a sent plan.
        plan_spacing: f64 ["s"] = 0.2, between(0.01, 10.0);
        /// Duration of the part of a plan that is sent.
        plan_horizon: f64 ["s"] = 3.0, between(1.0, 60.0);
        /// Length of the reference path ahead that an agent sends.
        way_ahead: f64 ["m"] = 80.0, between(10.0, 1_000.0);
        /// Distance from its sent plan beyond which an agent is no longer expected to follow it.
        deviation: f64 ["m"] = 1.0, positive(100.0);
        /// Standard deviation of the positions of a sent plan.
        plan_sigma: f64 ["m"] = 0.1, positive(10.0);
        /// Growth of that standard deviation along the heading.
        plan_along: f64 ["m/s"] = 0.3, between(0.0, 10.0);
        /// Growth of that standard deviation across the heading.
        plan_across: f64 ["m/s"] = 0.05, between(0.0, 10.0);
    }, demands
}

fn demands(settings: &V2xSettings) -> Result<()> {
    if settings.penetration > 0.0 && !(settings.cam || settings.mcm || settings.cpm) {
        let message = "is above 0, but none of cam, mcm and cpm is sent".into();
        return Err(Error::Setting { name: "penetration".into(), message });
    }
    if settings.negotiate && !settings.mcm {
        return Err(Error::Setting { name: "negotiate".into(), message: "needs v2x.mcm".into() });
    }
    Ok(())
}
