//! Predictions of vehicles that have to wait: each mode is driven as expected, but not past a line before a time.

use crate::geometry::{Point, Pose};
use crate::trajectory::{Predictions, State};

/// A vehicle brakes for a line with this deceleration, or as hard as it has to, and starts again so fast [m/s²].
const BRAKING: f64 = 1.5;
const STARTING: f64 = 1.5;
/// Modes that pass the line further aside take another way [m].
const ASIDE: f64 = 3.0;
/// A vehicle that keeps to its order has a standard deviation along its way of at most this [m], plus this share of the
/// distance from its front to the line, plus this for each second after its release [m/s].
const SPREAD: f64 = 0.2;
const SPREAD_SHARE: f64 = 0.5;
const SPREAD_RATE: f64 = 1.0;

/// Where and for how long a vehicle waits.
#[derive(Debug, Clone, Copy)]
pub struct Waiting {
    /// The front does not pass this point in the direction of the pose ...
    pub line: Pose,
    /// ... before this time has passed [s]; infinite: not within the prediction.
    pub release: f64,
    /// From the centre of the vehicle to its front [m].
    pub to_front: f64,
}

/// Lets the modes of a row wait. What is expected at a place stays expected there, at a later time; but before
/// the release its spread hardly reaches beyond the line.
pub fn wait(table: &mut Predictions, row: usize, state: &State, waiting: &Waiting, dt: f64) {
    let mut drive = Vec::with_capacity(table.n_steps + 1);
    for mode in 0..table.n_modes {
        let start = table.offset(row, mode);
        if table.probability[row * table.n_modes + mode] <= 0.0 {
            continue;
        }
        drive.clear();
        drive.push(Sample { pose: state.pose(), travelled: 0.0, covariance: (0.0, 0.0, 0.0) });
        for i in (start..start + table.n_steps).take_while(|i| table.valid[*i]) {
            let position = Point { x: table.x[i], y: table.y[i] };
            let last = drive.last().expect("it begins now");
            drive.push(Sample {
                pose: Pose { position, orientation: table.orientation[i] },
                travelled: last.travelled + (position - last.pose.position).norm(),
                covariance: (table.covariance_xx[i], table.covariance_xy[i], table.covariance_yy[i]),
            });
        }
        if drive.len() < 2 {
            continue;
        }
        // The spread now is not known; that of the first step is as near.
        drive[0].covariance = drive[1].covariance;
        if let Some(stop) = stop(&drive, waiting) {
            let delayed = delayed(&drive, (state.velocity.max(0.0), stop), waiting.release, dt);
            for (k, (sample, velocity)) in delayed.into_iter().enumerate() {
                let spread = spread(waiting, &sample, (k + 1) as f64 * dt);
                super::write(table, start + k, sample.pose, velocity, sample.narrowed(spread));
            }
        } else {
            for (k, sample) in drive.iter().enumerate().skip(1) {
                let spread = spread(waiting, sample, k as f64 * dt);
                let i = start + k - 1;
                (table.covariance_xx[i], table.covariance_xy[i], table.covariance_yy[i]) = sample.narrowed(spread);
            }
        }
    }
}

/// A place on the way of a mode.
#[derive(Debug, Clone, Copy)]
struct Sample {
    pose: Pose,
    /// Way from now on [m].
    travelled: f64,
    covariance: (f64, f64, f64),
}

impl Sample {
    /// Its covariance with a standard deviation along its heading of at most this [m].
    fn narrowed(&self, spread: f64) -> (f64, f64, f64) {
        narrowed(self.covariance, self.pose.orientation, spread)
    }

    fn between(a: &Self, b: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        let turn = crate::geometry::wrap_angle(b.pose.orientation - a.pose.orientation);
        Self {
            pose: Pose {
                position: a.pose.position.lerp(b.pose.position, share),
                orientation: a.pose.orientation + share * turn,
            },
            travelled: mix(a.travelled, b.travelled),
            covariance: (
                mix(a.covariance.0, b.covariance.0),
                mix(a.covariance.1, b.covariance.1),
                mix(a.covariance.2, b.covariance.2),
            ),
        }
    }
}

impl Waiting {
    /// How far the front is beyond the line, and aside of its middle [m].
    fn beyond(&self, sample: &Sample) -> (f64, f64) {
        let axis = Point::from_angle(self.line.orientation);
        let front = sample.pose.position + Point::from_angle(sample.pose.orientation) * self.to_front;
        let from_line = front - self.line.position;
        (from_line.dot(axis), from_line.cross(axis).abs())
    }
}

/// A covariance with a standard deviation along a heading [rad] of at most this [m].
pub(super) fn narrowed(covariance: (f64, f64, f64), heading: f64, spread: f64) -> (f64, f64, f64) {
    let (xx, xy, yy) = covariance;
    let Point { x, y } = Point::from_angle(heading);
    let along = x * x * xx + 2.0 * x * y * xy + y * y * yy;
    if along <= spread * spread {
        return covariance;
    }
    // Squeezed by the factor along the heading: T C T with T = 1 + (factor - 1) u u'.
    let less = spread / along.sqrt() - 1.0;
    let (a, b, c) = (1.0 + less * x * x, less * x * y, 1.0 + less * y * y);
    (
        a * a * xx + 2.0 * a * b * xy + b * b * yy,
        a * b * xx + (a * c + b * b) * xy + b * c * yy,
        b * b * xx + 2.0 * b * c * xy + c * c * yy,
    )
}

/// The largest spread along its way of a vehicle that is expected somewhere after a time [s]; infinite aside of the line.
fn spread(waiting: &Waiting, sample: &Sample, time: f64) -> f64 {
    let (beyond, aside) = waiting.beyond(sample);
    if aside >= ASIDE {
        return f64::INFINITY;
    }
    SPREAD + SPREAD_SHARE * (-beyond).max(0.0) + SPREAD_RATE * (time - waiting.release).max(0.0)
}

/// The way after which the front is at the line [m]; `None` if the mode does not pass it.
fn stop(drive: &[Sample], waiting: &Waiting) -> Option<f64> {
    let beyond = |sample: &Sample| waiting.beyond(sample);
    let mut last = beyond(&drive[0]);
    if last.0 > 0.0 {
        return (last.0 < waiting.to_front && last.1 < ASIDE).then_some(0.0);
    }
    for pair in drive.windows(2) {
        let here = beyond(&pair[1]);
        if here.0 > 0.0 && here.1 < ASIDE {
            let share = last.0 / (last.0 - here.0);
            return Some(pair[0].travelled + share * (pair[1].travelled - pair[0].travelled));
        }
        last = here;
    }
    None
}

/// The steps of a mode that stops after a way [m] until its release, with speeds.
fn delayed(drive: &[Sample], (velocity, stop): (f64, f64), release: f64, dt: f64) -> Vec<(Sample, f64)> {
    let braking = BRAKING.max(0.5 * velocity * velocity / stop.max(0.1));
    let (mut travelled, mut velocity, mut next) = (0.0, f64::INFINITY, 1);
    let mut found = Vec::with_capacity(drive.len() - 1);
    for k in 1..drive.len() {
        while next + 1 < drive.len() && drive[next].travelled <= travelled {
            next += 1;
        }
        let expected = (drive[next].travelled - drive[next - 1].travelled) / dt;
        // Once it has slowed down it takes time to be as fast as expected.
        let free = expected.min(velocity + STARTING * dt);
        let left = (stop - travelled).max(0.0);
        let bearable = (2.0 * braking * left).sqrt();
        let in_time = free * (release - (k - 1) as f64 * dt) <= left;
        if k as f64 * dt <= release && bearable <= free && !in_time {
            travelled += if bearable > braking * dt { (bearable - 0.5 * braking * dt) * dt } else { left };
            velocity = (bearable - braking * dt).max(0.0);
        } else {
            travelled += free * dt;
            velocity = free;
        }
        let place = drive.partition_point(|sample| sample.travelled < travelled).clamp(1, drive.len() - 1);
        let (a, b) = (&drive[place - 1], &drive[place]);
        let length = b.travelled - a.travelled;
        let share = if length > 0.0 { ((travelled - a.travelled) / length).clamp(0.0, 1.0) } else { 0.0 };
        found.push((Sample::between(a, b, share), velocity));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.1;
    const TO_FRONT: f64 = 2.25;
    /// The line [m]: the centre stands 2.25 m before it.
    const LINE: f64 = 20.0;

    /// Straight on along x with a speed and a lateral offset, for 8 s.
    fn expected(velocity: f64, y: f64) -> (Predictions, State) {
        let mut table = Predictions::empty(0, vec![7], 1, 80);
        table.probability[0] = 1.0;
        for k in 0..80 {
            let position = Point::new(velocity * (k + 1) as f64 * DT, y);
            crate::predict::write(&mut table, k, Pose { position, orientation: 0.0 }, velocity, (0.1, 0.0, 0.1));
        }
        (table, State { y, velocity, ..State::default() })
    }

    fn waiting(release: f64) -> Waiting {
        Waiting { line: Pose { position: Point::new(LINE, 0.0), orientation: 0.0 }, release, to_front: TO_FRONT }
    }

    /// The strongest deceleration over half a second [m/s²].
    fn hardest(velocities: &[f64]) -> f64 {
        velocities.windows(6).map(|some| (some[0] - some[5]) / (5.0 * DT)).fold(0.0, f64::max)
    }

    #[test]
    fn a_vehicle_that_waits_stops_before_the_line() {
        let (mut table, state) = expected(7.0, 0.0);
        wait(&mut table, 0, &state, &waiting(f64::INFINITY), DT);
        assert!((table.x[79] + TO_FRONT - LINE).abs() < 0.3, "{}", table.x[79]);
        assert!(table.x.iter().all(|x| x + TO_FRONT <= LINE + 1e-9));
        assert!(table.velocity[79] < 0.3);
        // 7² / (2 · 17.75 m) = 1.38 m/s²: 1.5 m/s² are enough.
        assert!(hardest(&table.velocity) < 1.9);
    }

    #[test]
    fn who_comes_too_fast_brakes_as_hard_as_it_has_to() {
        let (mut table, state) = expected(12.0, 0.0);
        wait(&mut table, 0, &state, &waiting(f64::INFINITY), DT);
        // 12² / (2 · 17.75 m) = 4.06 m/s²
        let hardest = hardest(&table.velocity);
        assert!((3.9..4.6).contains(&hardest), "{hardest}");
        assert!(table.x.iter().all(|x| x + TO_FRONT <= LINE + 1e-9));
    }

    #[test]
    fn after_its_release_it_starts_with_a_comfortable_acceleration() {
        let (mut table, state) = expected(7.0, 0.0);
        wait(&mut table, 0, &state, &waiting(6.0), DT);
        assert!(table.x[59] + TO_FRONT <= LINE + 1e-9, "{} m at 6 s", table.x[59]);
        assert!(table.x[79] + TO_FRONT > LINE + 1.0, "{} m at 8 s", table.x[79]);
        assert!(table.velocity.windows(2).all(|pair| pair[1] - pair[0] <= 1.5 * DT + 1e-9));
        assert!(table.velocity[79] <= 7.0);
    }

    #[test]
    fn the_spread_of_a_vehicle_that_waits_hardly_reaches_beyond_the_line() {
        // It stands 0.75 m before the line, or drives straight at an angle of 0.3 rad to the axes.
        for (velocity, angle) in [(0.0, 0.0), (5.0, 0.3_f64)] {
            let axis = Point::from_angle(angle);
            let (mut table, mut state) = expected(0.0, 0.0);
            for k in 0..80 {
                let travelled = velocity * (k + 1) as f64 * DT;
                let pose = Pose { position: axis * travelled, orientation: angle };
                // 2.5 m along the way, 0.4 m across.
                let (along, across) = (6.25, 0.16);
                let covariance = (
                    along * axis.x * axis.x + across * axis.y * axis.y,
                    (along - across) * axis.x * axis.y,
                    along * axis.y * axis.y + across * axis.x * axis.x,
                );
                crate::predict::write(&mut table, k, pose, velocity, covariance);
            }
            (state.velocity, state.orientation) = (velocity, angle);
            let to_line = if velocity > 0.0 { LINE } else { 3.0 };
            let line = Pose { position: axis * to_line, orientation: angle };
            wait(&mut table, 0, &state, &Waiting { line, release: 6.0, to_front: TO_FRONT }, DT);
            let (mut reach, mut late) = (0.0_f64, 0.0_f64);
            for k in 0..80 {
                let (xx, xy, yy) = (table.covariance_xx[k], table.covariance_xy[k], table.covariance_yy[k]);
                let spread = |u: Point| (u.x * u.x * xx + 2.0 * u.x * u.y * xy + u.y * u.y * yy).sqrt();
                let front = Point::new(table.x[k], table.y[k]).dot(axis) + TO_FRONT;
                assert!((spread(Point::new(-axis.y, axis.x)) - 0.4).abs() < 1e-9, "across it stays");
                if k < 60 {
                    reach = reach.max(front + 2.0 * spread(axis) - to_line);
                } else {
                    late = spread(axis);
                }
            }
            assert!((0.3..0.41).contains(&reach), "{reach} m: twice 0.2 m");
            assert!(late > 2.0, "2 s after its release: {late} m");
        }
    }

    #[test]
    fn a_mode_that_takes_another_way_stays_as_it_was() {
        let (table, state) = expected(7.0, 5.0);
        let mut waits = table.clone();
        wait(&mut waits, 0, &state, &waiting(f64::INFINITY), DT);
        assert_eq!(waits, table);
    }
}
