//! One longitudinal profile: arc length as a function of time.

use super::super::polynomial::{Braking, Polynomial};
use super::feasibility::Rejection;

/// Arc length and its derivatives by time at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ProfilePoint {
    pub(super) s: f64,
    pub(super) s_dot: f64,
    pub(super) s_ddot: f64,
}

/// The same at all points of a profile, with padding.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProfilePoints<'a> {
    pub(super) s: &'a [f64],
    pub(super) s_dot: &'a [f64],
    pub(super) s_ddot: &'a [f64],
}

impl ProfilePoints<'_> {
    /// One point.
    #[inline]
    pub(super) fn at(&self, point: usize) -> ProfilePoint {
        ProfilePoint { s: self.s[point], s_dot: self.s_dot[point], s_ddot: self.s_ddot[point] }
    }
}

/// How a profile moves along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ProfileCurve {
    /// A polynomial up to the end time, then constant speed.
    Polynomial(Polynomial),
    Braking(Braking),
}

/// One motion along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LongitudinalProfile {
    pub(super) curve: ProfileCurve,
    /// When the motion ends [s]; from then on the speed is constant.
    pub(super) end_time: f64,
    /// Speed at the end, along the path [m/s].
    pub(super) end_velocity: f64,
    /// Root of the integral of the squared jerk over the horizon.
    pub(super) jerk: f64,
    /// Its lateral polynomials are of arc length, its own; otherwise of time, shared by all profiles of an end time.
    pub(super) is_over_arc: bool,
    /// Table of the lateral polynomials; those of arc length are made when they are needed.
    pub(super) table: Option<usize>,
    /// Why all its samples are rejected.
    pub(super) rejection: Rejection,
    /// Its family and, once it is written, the place of its motion; one of both is always there.
    pub(super) family: Option<usize>,
    pub(super) motion: Option<usize>,
    /// Place of its path points, once they are looked up.
    pub(super) path: Option<usize>,
}

/// What the path is at all points of a profile, with padding.
#[derive(Debug, Clone, Copy)]
pub(super) struct PathPoints<'a> {
    pub(super) x: &'a [f64],
    pub(super) y: &'a [f64],
    pub(super) theta: &'a [f64],
    pub(super) cos: &'a [f64],
    pub(super) sin: &'a [f64],
    pub(super) curvature: &'a [f64],
    pub(super) curvature_rate: &'a [f64],
}
