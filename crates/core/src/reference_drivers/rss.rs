//! Safe distances of Responsibility-Sensitive Safety (arXiv 1708.06374, definitions 1, 2 and 6; with the fluctuation margin
//! and the parameters of `ad-rss`, the library that Intel published).

/// Along a lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Longitudinal {
    /// Response time r [s].
    pub response: f64,
    /// Largest acceleration during the response [m/s²].
    pub acceleration: f64,
    /// Least braking after the response, of the one that has to brake [m/s²].
    pub braking_min: f64,
    /// Hardest braking of a vehicle ahead [m/s²].
    pub braking_max: f64,
    /// Least braking of oncoming traffic that is in its own lane [m/s²].
    pub braking_correct: f64,
}

/// Across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lateral {
    /// Response time r [s].
    pub response: f64,
    /// Largest acceleration during the response [m/s²].
    pub acceleration: f64,
    /// Least braking after the response [m/s²].
    pub braking_min: f64,
    /// Fluctuation of a vehicle that keeps its lane, mu [m].
    pub fluctuation: f64,
}

/// Parameters of JRC's comparison.
pub const JRC: Longitudinal =
    Longitudinal { response: 0.75, acceleration: 3.0, braking_min: 6.0, braking_max: 6.0, braking_correct: 6.0 };
/// The same across the lane.
pub const JRC_LATERAL: Lateral = Lateral { response: 0.75, acceleration: 1.0, braking_min: 1.0, fluctuation: 0.3 };

impl Longitudinal {
    /// Way of a vehicle that accelerates during the response and then brakes [m].
    pub fn braking_way(&self, velocity: f64) -> f64 {
        self.way(velocity, self.braking_min)
    }

    fn way(&self, velocity: f64, braking: f64) -> f64 {
        let r = self.response;
        let faster = velocity + self.acceleration * r;
        velocity * r + self.acceleration * r * r / 2.0 + faster * faster / (2.0 * braking)
    }

    /// Safe distance behind a vehicle, not cut off at 0 [m].
    pub(super) fn same_direction_unbounded(&self, rear: f64, front: f64) -> f64 {
        self.braking_way(rear) - front * front / (2.0 * self.braking_max)
    }

    /// Safe distance of a vehicle behind another one of the same direction, from their speeds [m/s] [m].
    pub fn same_direction(&self, rear: f64, front: f64) -> f64 {
        self.same_direction_unbounded(rear, front).max(0.0)
    }

    /// Safe distance between oncoming vehicles, the first of which is in its lane, from their speeds without sign [m/s]
    /// [m].
    pub fn opposite_direction(&self, in_lane: f64, other: f64) -> f64 {
        self.way(in_lane, self.braking_correct) + self.way(other, self.braking_min)
    }
}

impl Lateral {
    /// Safe distance between a vehicle on the left and one on the right, from their speeds to the right [m/s] [m].
    pub fn distance(&self, left: f64, right: f64) -> f64 {
        let Self { response: r, acceleration: a, braking_min: b, .. } = *self;
        let (faster, slower) = (left + a * r, right - a * r);
        let brakes = |w: f64| w * w / (2.0 * b);
        let leftmost = (left + faster) / 2.0 * r + if faster > 0.0 { brakes(faster) } else { 0.0 };
        let rightmost = (right + slower) / 2.0 * r - if slower < 0.0 { brakes(slower) } else { 0.0 };
        (self.fluctuation + leftmost - rightmost).max(0.0)
    }

    /// Distance at which a vehicle that comes sideways at a speed [m/s] is too near for one that keeps its lane [m].
    pub(super) fn sideways(&self, toward: f64) -> f64 {
        let Self { response: r, acceleration: a, braking_min: b, .. } = *self;
        let faster = toward + a * r;
        self.fluctuation + (toward + faster) * r / 2.0 + faster * faster / (2.0 * b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTEL: Longitudinal =
        Longitudinal { response: 1.0, acceleration: 3.5, braking_min: 4.0, braking_max: 8.0, braking_correct: 3.0 };
    const INTEL_LATERAL: Lateral = Lateral { response: 1.0, acceleration: 0.2, braking_min: 0.8, fluctuation: 0.3 };

    #[test]
    fn distances_are_those_of_the_definitions() {
        // 1.75 + 3.5²/8; less 5²/16; 5 + 1.75 + 8.5²/8 - 5²/16
        for (rear, front, expected) in
            [(0.0, 0.0, 3.28125), (0.0, 5.0, 1.71875), (5.0, 5.0, 14.21875), (0.0, 33.3, 0.0)]
        {
            assert!((INTEL.same_direction(rear, front) - expected).abs() < 1e-12, "{rear} {front}");
        }
        // 5 + 1.75 + 8.5²/6, and 5 + 1.75 + 8.5²/8
        let expected = 13.5 + 72.25 / 6.0 + 72.25 / 8.0;
        assert!((INTEL.opposite_direction(5.0, 5.0) - expected).abs() < 1e-12);
        // 0.3 + 2 (0.1 + 0.04/1.6), and apart as they drive away from each other
        for (left, right, expected) in [(0.0, 0.0, 0.55), (1.0, -1.0, 4.3), (-1.0, 1.0, 0.0), (0.3, 0.3, 0.65625)] {
            assert!((INTEL_LATERAL.distance(left, right) - expected).abs() < 1e-12, "{left} {right}");
        }
        // 0.3 + 0.28125 + 0.75²/2
        assert!((JRC_LATERAL.sideways(0.0) - 0.8625).abs() < 1e-12);
    }
}
