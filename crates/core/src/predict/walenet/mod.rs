//! WALENET: a published network that expects one path with a covariance per step from the positions of the last 3 s and
//! a picture of the road (Geisslinger, Karle, Betz, Lienkamp, "Watch-and-Learn-Net", IEEE SMC 2021; after Deo and
//! Trivedi, "Convolutional social pooling", CVPRW 2018). The published weights come from outside.

mod activation;
mod forecast;
mod inputs;
mod layer;
mod network;
mod patches;
mod picture;
mod recurrent;
mod stack;
#[cfg(test)]
mod tests;

pub use network::{History, N_CELLS, N_HISTORY, N_OUTPUT, Network, Output, Tensor};

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::{Spread, go_straight, stand};
use crate::error::{Error, Result};
use crate::geometry::Pose;
use crate::road::RoadNetwork;
use crate::scene::Scene;
use crate::trajectory::{Predictions, State};
use forecast::write_forecast;
use inputs::{Track, occupied, stands};
use picture::{Borders, Picture, Tracing};

/// Time between the network's steps, past and future [s].
const STEP: f64 = 0.1;

/// Which state the network takes for the present one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Anchor {
    /// The present one, as in training.
    #[default]
    Now,
    /// The next one, and its answer is taken one step early, as the published framework does. What it reads there from
    /// the recording is not known here: the next state is the present one moved on by its velocity and yaw rate.
    Next,
}

/// Settings; the defaults correct what the published framework does wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WalenetSettings {
    /// Which state the network takes for the present one.
    pub anchor: Anchor,
    /// Who has not moved for half a second stays; the network expects it to drive off.
    pub standing_guard: bool,
    /// What is not known of the past is filled in at the speed first seen; otherwise it counts as standing here.
    pub backfill: bool,
}

impl Default for WalenetSettings {
    fn default() -> Self {
        Self { anchor: Anchor::Now, standing_guard: true, backfill: true }
    }
}

/// The predictor for one road network.
#[derive(Debug)]
pub struct Walenet {
    network: Arc<Network>,
    settings: WalenetSettings,
    road: Arc<RoadNetwork>,
    borders: Borders,
    /// What the network made of the pictures of the last call: (id, pose, vector), ascending ids. Who stands is not drawn
    /// again; nothing else comes out.
    seen: Mutex<Vec<(i64, Pose, [f32; layer::CHANNELS])>>,
    /// Memory of threads that do not compute now.
    scratches: Mutex<Vec<Scratch>>,
}

/// Memory of one thread.
#[derive(Debug, Default)]
struct Scratch {
    network: network::Scratch,
    picture: Picture,
    tracing: Tracing,
}

/// What was found for a vehicle.
struct Found {
    output: Output,
    image: [f32; layer::CHANNELS],
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is inside is replaced as a whole and right at any time.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Walenet {
    /// For a road network, whose borders are collected once.
    pub fn new(network: Arc<Network>, settings: WalenetSettings, road: Arc<RoadNetwork>) -> Self {
        let borders = Borders::of(&road);
        Self { network, settings, road, borders, seen: Mutex::default(), scratches: Mutex::default() }
    }

    /// Grey values (0, 127, 255) of the picture around a pose of a road, (256, 256) row-major: rows grow forward, columns
    /// to the right, half a metre per pixel.
    pub fn picture(road: &RoadNetwork, pose: Pose) -> Vec<u8> {
        let mut picture = Picture::default();
        Borders::of(road).draw(pose, &mut picture, &mut Tracing::default());
        picture.codes().iter().map(|code| picture::GREY[*code as usize] as u8).collect()
    }

    /// Expectations for everybody present: vehicles by the network; others go straight on, or stay if they stand.
    ///
    /// Runs on the threads of the rayon pool in which it is called; the bits do not depend on their number.
    ///
    /// # Errors
    /// `InvalidInput` if it was made for another road network.
    pub(super) fn predict(&self, scene: &Scene, road: &RoadNetwork, out: &mut Predictions) -> Result<()> {
        if !std::ptr::eq(road, &*self.road) {
            return Err(Error::invalid("this walenet was made for another road network: make one for this scenario"));
        }
        let participants = &scene.participants;
        let mut tracks: Vec<Track> = Vec::with_capacity(scene.present.len());
        // (row of `out`, index of the track) of those whom the network is asked about.
        let mut asked = Vec::new();
        for (i, row) in scene.present.iter().copied().enumerate() {
            let state = State { velocity: scene.observed_velocity(row), ..scene.state(row) };
            let track = if participants.is_static[row] { None } else { Track::of(scene, row, &self.settings) };
            let is_asked = participants.kind[row].is_vehicle() && !(self.settings.standing_guard && stands(scene, row));
            match track {
                Some(track) => {
                    if is_asked {
                        asked.push((i, tracks.len()));
                    } else if participants.kind[row].is_vehicle() || state.velocity.abs() < super::STATIONARY_SPEED {
                        stand(out, i, &state);
                    } else {
                        go_straight(out, i, &state, &Spread::default(), scene.dt);
                    }
                    tracks.push(track);
                }
                None if participants.is_static[row] => stand(out, i, &state),
                // A state that is not a number has no future.
                None => {}
            }
        }
        let ids: Vec<i64> = asked.iter().map(|(i, _)| out.ids[*i]).collect();
        let found = self.ask(&tracks, &asked, &ids);
        for ((i, track), found) in asked.iter().zip(&found) {
            write_forecast(out, *i, &found.output, tracks[*track].pose, scene.dt);
        }
        *locked(&self.seen) = asked
            .iter()
            .zip(&found)
            .map(|((i, track), found)| (out.ids[*i], tracks[*track].pose, found.image))
            .collect();
        Ok(())
    }

    /// The network's answers about some tracks, shared among threads.
    fn ask(&self, tracks: &[Track], asked: &[(usize, usize)], ids: &[i64]) -> Vec<Found> {
        let seen = std::mem::take(&mut *locked(&self.seen));
        let share = asked.len().div_ceil(rayon::current_num_threads()).max(1);
        asked
            .par_chunks(share)
            .zip(ids.par_chunks(share))
            .flat_map_iter(|(asked, ids)| {
                let mut scratch = locked(&self.scratches).pop().unwrap_or_default();
                let found: Vec<Found> = asked
                    .iter()
                    .zip(ids)
                    .map(|((_, own), id)| {
                        let pose = tracks[*own].pose;
                        let known = seen.binary_search_by_key(id, |entry| entry.0).ok().map(|entry| &seen[entry]);
                        let image = match known {
                            Some((_, at, image)) if *at == pose => *image,
                            _ => self.image(pose, &mut scratch),
                        };
                        Found { output: self.ask_one(*own, tracks, &image, &mut scratch), image }
                    })
                    .collect();
                locked(&self.scratches).push(scratch);
                found
            })
            .collect()
    }

    fn image(&self, pose: Pose, scratch: &mut Scratch) -> [f32; layer::CHANNELS] {
        scratch.picture.clear();
        self.borders.draw(pose, &mut scratch.picture, &mut scratch.tracing);
        self.network.image(&scratch.picture, &mut scratch.network)
    }

    fn ask_one(&self, own: usize, tracks: &[Track], image: &[f32; layer::CHANNELS], scratch: &mut Scratch) -> Output {
        let pose = tracks[own].pose;
        let mut cells = occupied(own, tracks);
        let mut histories = vec![tracks[own].seen_from(pose)];
        for (_, track) in &mut cells {
            if *track == own {
                *track = 0;
            } else {
                histories.push(tracks[*track].seen_from(pose));
                *track = histories.len() - 1;
            }
        }
        self.network.forward(&histories, &cells, image, &mut scratch.network)
    }
}
