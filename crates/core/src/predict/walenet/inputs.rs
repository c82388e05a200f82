//! What the network is told: where everybody was, seen from the predicted vehicle.

use super::network::{CELLS_ACROSS, CELLS_ALONG, History, N_CELLS, N_HISTORY};
use super::{Anchor, STEP, WalenetSettings};
use crate::geometry::{Point, Pose};
use crate::predict::standing::Stillness;
use crate::scene::Scene;

/// Half the size of the field of cells, across and along [m].
const FIELD: (f64, f64) = (9.0, 39.0);
/// Instants closer than this [s] are the same.
const SAME_TIME: f64 = 1e-6;

/// Where a participant was, every 0.1 s.
#[derive(Debug, Clone)]
pub(super) struct Track {
    /// Its pose at the last instant.
    pub pose: Pose,
    /// Positions in the world, oldest first; `None`: not known.
    positions: [Option<Point>; N_HISTORY],
}

impl Track {
    /// The track of a row that is present; `None` if its state now is not a number.
    pub(super) fn of(scene: &Scene, row: usize, settings: &WalenetSettings) -> Option<Self> {
        let now = scene.state(row);
        let velocity = scene.observed_velocity(row);
        if !now.pose().position.is_finite() || !now.orientation.is_finite() || !velocity.is_finite() {
            return None;
        }
        // (age [s], position), newest first; gaps are bridged by straight lines.
        let mut known: Vec<(f64, Point)> = Vec::with_capacity(N_HISTORY + 2);
        let (mut pose, mut age_now) = (now.pose(), 0.0);
        if settings.anchor == Anchor::Next {
            let step = Point::from_angle(now.orientation) * (velocity * scene.dt);
            let turn = if now.yaw_rate.is_finite() { now.yaw_rate * scene.dt } else { 0.0 };
            pose = Pose { position: pose.position + step, orientation: pose.orientation + turn };
            known.push((0.0, pose.position));
            age_now = scene.dt;
        }
        let mut oldest = now;
        for back in 0..scene.past.n_steps {
            let age = back as f64 * scene.dt + age_now;
            if let Some(state) =
                scene.past.get(row, scene.time_step - back as i64).filter(|s| s.pose().position.is_finite())
            {
                known.push((age, state.pose().position));
                oldest = state;
            }
            if age >= (N_HISTORY - 1) as f64 * STEP {
                break;
            }
        }
        // Where positions contradict the stated speeds, the positions are right.
        let is_stated = velocity == now.velocity && oldest.velocity.is_finite() && oldest.orientation.is_finite();
        let before = if is_stated { oldest } else { crate::trajectory::State { velocity, ..now } };
        let drift = settings.backfill.then(|| Point::from_angle(before.orientation) * before.velocity);
        let mut positions = [None; N_HISTORY];
        let mut next = 0;
        for (back, position) in positions.iter_mut().rev().enumerate() {
            let age = back as f64 * STEP;
            while next < known.len() && known[next].0 < age - SAME_TIME {
                next += 1;
            }
            *position = match known.get(next) {
                Some((at, point)) if next == 0 || at - age <= SAME_TIME => Some(*point),
                Some((at, point)) => {
                    let (newer, from) = known[next - 1];
                    Some(from.lerp(*point, (age - newer) / (at - newer)))
                }
                None => {
                    let (last, from) = known[known.len() - 1];
                    drift.map(|drift| from - drift * (age - last))
                }
            };
        }
        Some(Self { pose, positions })
    }

    /// The track as seen from a pose; where nothing is known it is at the origin.
    pub(super) fn seen_from(&self, pose: Pose) -> History {
        let frame = Frame::of(pose);
        self.positions.map(|position| {
            position.map_or([0.0; 2], |position| {
                let local = frame.local(position);
                [local.x as f32, local.y as f32]
            })
        })
    }
}

/// Frame of a vehicle with x to the right and y forward.
struct Frame {
    origin: Point,
    forward: Point,
}

impl Frame {
    fn of(pose: Pose) -> Self {
        Self { origin: pose.position, forward: Point::from_angle(pose.orientation) }
    }

    fn local(&self, point: Point) -> Point {
        let offset = point - self.origin;
        Point::new(-self.forward.cross(offset), self.forward.dot(offset))
    }
}

/// (cell, index of the track) of the occupied cells around a track, by cell. Of several in a cell the nearest counts, so
/// the vehicle itself is always in its own.
pub(super) fn occupied(own: usize, tracks: &[Track]) -> Vec<(usize, usize)> {
    let frame = Frame::of(tracks[own].pose);
    let mut nearest = [(f64::INFINITY, 0_usize); N_CELLS];
    for (i, track) in tracks.iter().enumerate() {
        let local = frame.local(track.pose.position);
        if !(local.x.abs() < FIELD.0 && local.y.abs() < FIELD.1) {
            continue;
        }
        let across = (CELLS_ACROSS as f64 * (local.x + FIELD.0) / (2.0 * FIELD.0)) as usize;
        let along = (CELLS_ALONG as f64 * (FIELD.1 - local.y) / (2.0 * FIELD.1)) as usize;
        let cell = &mut nearest[across.min(CELLS_ACROSS - 1) * CELLS_ALONG + along.min(CELLS_ALONG - 1)];
        if i == own || local.norm_squared() < cell.0 {
            *cell = (if i == own { -1.0 } else { local.norm_squared() }, i);
        }
    }
    nearest
        .iter()
        .enumerate()
        .filter(|(_, found)| found.0 < f64::INFINITY)
        .map(|(cell, found)| (cell, found.1))
        .collect()
}

/// Whether somebody stands.
pub(super) fn stands(scene: &Scene, row: usize) -> bool {
    const SPAN: f64 = 1.0;
    Stillness::of(scene, row, SPAN).is_standing(scene.observed_velocity(row))
}
