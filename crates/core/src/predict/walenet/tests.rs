//! The network with random weights, and the predictor around it.

use super::picture::{GREY, Ink};
use super::*;
use crate::geometry::Point;
use crate::geometry::shape::Shape;
use crate::predict::{Predictor, predict};
use crate::road::testing::{arc, closed, lane, straight, with_successors};
use crate::scene::Participants;
use crate::trajectory::States;
use crate::vehicle::ParticipantKind;

/// Numbers in (-1, 1), the same at every run.
pub(super) struct Random(pub u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as f32 / (1_u64 << 30) as f32) - 1.0
    }

    fn below(&mut self, n: usize) -> usize {
        (((self.next() + 1.0) * 0.5 * n as f32) as usize).min(n - 1)
    }
}

/// Tensors of the right names and shapes.
fn tensors(seed: u64) -> Vec<Tensor> {
    let mut random = Random(seed);
    let mut tensors = Vec::new();
    let mut add = |name: String, shape: &[usize], scale: f32| {
        let values = (0..shape.iter().product()).map(|_| random.next() * scale).collect();
        tensors.push(Tensor { name, shape: shape.to_vec(), values });
    };
    for (name, inputs, size) in [("enc_lstm", 16, 32), ("dec_lstm", 88, 64)] {
        add(format!("{name}.weight_ih_l0"), &[3 * size, inputs], 0.3);
        add(format!("{name}.weight_hh_l0"), &[3 * size, size], 0.3);
        add(format!("{name}.bias_ih_l0"), &[3 * size], 0.3);
        add(format!("{name}.bias_hh_l0"), &[3 * size], 0.3);
    }
    let layers = [("ip_emb", vec![16, 2]), ("dyn_emb", vec![16, 32]), ("op", vec![5, 64])];
    let convolutions = [("soc_conv", vec![32, 32, 3, 3]), ("conv_3x1", vec![8, 32, 3, 1])];
    for (name, shape) in layers.into_iter().chain(convolutions) {
        add(format!("{name}.bias"), &shape[..1], 0.3);
        add(format!("{name}.weight"), &shape, 0.3);
    }
    for layer in 1..=8 {
        add(format!("sc_conv{layer}.bias"), &[32], 0.5);
        let (inputs, scale) = if layer == 1 { (1, 0.01) } else { (32, 0.1) };
        add(format!("sc_conv{layer}.weight"), &[32, inputs, 3, 3], scale);
    }
    tensors
}

fn network() -> Arc<Network> {
    Arc::new(Network::new(&tensors(5)).expect("all tensors are there"))
}

fn values<'a>(tensors: &'a [Tensor], name: &str) -> &'a [f32] {
    &tensors.iter().find(|tensor| tensor.name == name).expect("there").values
}

/// The image network without any trick, in double precision.
fn dense(tensors: &[Tensor], picture: &Picture) -> Vec<f64> {
    let mut side = picture::SIDE;
    let mut map: Vec<Vec<f64>> = vec![picture.codes().iter().map(|code| f64::from(GREY[*code as usize])).collect()];
    for layer in 1..=8 {
        let weights = values(tensors, &format!("sc_conv{layer}.weight"));
        let bias = values(tensors, &format!("sc_conv{layer}.bias"));
        let at = |channel: &[f64], y: usize, x: usize| {
            // Rows and columns count from 1 here; around them lie zeros.
            if (1..=side).contains(&y) && (1..=side).contains(&x) { channel[(y - 1) * side + x - 1] } else { 0.0 }
        };
        let output = |o: usize, y: usize, x: usize| -> f64 {
            let mut sum = f64::from(bias[o]);
            for (c, channel) in map.iter().enumerate() {
                for tap in 0..9 {
                    sum += f64::from(weights[(o * map.len() + c) * 9 + tap]) * at(channel, y + tap / 3, x + tap % 3);
                }
            }
            sum
        };
        let half = side / 2;
        let pooled = |o: usize, i: usize| {
            let (y, x) = (i / half * 2, i % half * 2);
            output(o, y, x).max(output(o, y, x + 1)).max(output(o, y + 1, x)).max(output(o, y + 1, x + 1))
        };
        let next = (0..32).map(|o| (0..half * half).map(|i| pooled(o, i)).collect()).collect();
        (map, side) = (next, half);
    }
    map.into_iter().map(|channel| channel[0]).collect()
}

/// Crooked lines, specks, and pixels in all corners.
fn picture(seed: u64) -> Picture {
    let mut picture = Picture::default();
    let mut random = Random(seed);
    for line in 0..4 {
        let (start, slope) = (random.below(256) as f32, random.next() * 0.8);
        for row in 0..256 {
            let column = (start + slope * row as f32 + 4.0 * (row as f32 / 30.0).sin()) as usize;
            picture.set(row, column.min(255), if line % 2 == 0 { Ink::Edge } else { Ink::Marking });
        }
    }
    for _ in 0..40 {
        let (row, column) = (random.below(256), random.below(256));
        picture.set(row, column, Ink::Marking);
    }
    for corner in [(0, 0), (0, 255), (255, 0), (255, 255)] {
        picture.set(corner.0, corner.1, Ink::Edge);
    }
    picture
}

#[test]
fn differences_to_the_empty_picture_give_what_all_pixels_give() {
    let tensors = tensors(5);
    let network = Network::new(&tensors).expect("complete");
    let mut scratch = network::Scratch::default();
    for picture in [Picture::default(), picture(1), picture(2)] {
        let expected = dense(&tensors, &picture);
        let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (found, expected) in network.image(&picture, &mut scratch).iter().zip(&expected) {
            assert!((f64::from(*found) - expected).abs() < 1e-5 * largest, "{found} instead of {expected}");
        }
    }
}

#[test]
fn what_was_drawn_before_leaves_no_trace() {
    let network = network();
    let mut used = network::Scratch::default();
    let fresh = |seed| network.image(&picture(seed), &mut network::Scratch::default());
    // Enough pictures for the table of patches to be emptied in between.
    for seed in 0..40 {
        network.image(&picture(seed), &mut used);
    }
    for seed in [3, 100] {
        assert_eq!(network.image(&picture(seed), &mut used), fresh(seed));
    }
}

#[test]
fn a_tensor_that_is_missing_or_has_another_shape_is_named() {
    for change in 0..3 {
        let mut wrong = tensors(5);
        let at = wrong.iter().position(|tensor| tensor.name == "sc_conv3.weight").expect("there");
        match change {
            0 => drop(wrong.remove(at)),
            1 => wrong[at].shape = vec![32, 32, 9],
            _ => wrong[at].values[7] = f32::NAN,
        }
        let error = Network::new(&wrong).expect_err("refused").to_string();
        assert!(error.contains("tensor sc_conv3.weight"), "{error}");
    }
}

/// A road that bends to the left.
fn road() -> Arc<RoadNetwork> {
    Arc::new(closed(vec![
        with_successors(lane(1, &straight((-100.0, 0.0), (60.0, 0.0))), &[2]),
        lane(2, &arc((60.0, 50.0), 50.0, -std::f64::consts::FRAC_PI_2, 0.6)),
    ]))
}

/// Cars that have driven towards +x at constant speed for `n_past` steps; (x, y, speed) now.
fn traffic(cars: &[(f64, f64, f64)], n_past: usize) -> Scene {
    let ids: Vec<i64> = (1..=cars.len() as i64).collect();
    let mut past = States::absent(ids.clone(), 0, n_past + 1);
    for (row, (x, y, velocity)) in cars.iter().enumerate() {
        for column in 0..=n_past {
            let x = x - velocity * 0.1 * (n_past - column) as f64;
            past.set(row, column, &State { x, y: *y, velocity: *velocity, ..State::default() });
        }
    }
    let participants = Participants {
        ids,
        kind: vec![ParticipantKind::Car; cars.len()],
        shape: vec![Shape::rectangle(4.5, 1.8); cars.len()],
        is_static: vec![false; cars.len()],
        is_agent: vec![true; cars.len()],
    };
    let present = (0..cars.len()).collect();
    Scene { time_step: n_past as i64, dt: 0.1, participants: Arc::new(participants), present, past }
}

fn predicted(scene: &Scene, settings: WalenetSettings) -> Predictions {
    let road = road();
    let walenet = Predictor::Walenet(Arc::new(Walenet::new(network(), settings, Arc::clone(&road))));
    let found = predict(&walenet, scene, &road, 30).expect("possible");
    found.validate().expect("numbers");
    found
}

#[test]
fn holes_in_the_past_are_bridged() {
    let whole = traffic(&[(0.0, 0.0, 8.0), (20.0, 0.2, 6.0)], 30);
    let mut holed = whole.clone();
    for column in [3, 4, 11, 29] {
        holed.past.valid[column] = false;
        holed.past.x[column] = f64::NAN;
    }
    holed.past.x[17] = f64::NAN; // said to be valid, but no number
    let (found, expected) =
        (predicted(&holed, WalenetSettings::default()), predicted(&whole, WalenetSettings::default()));
    for (found, expected) in found.x.iter().zip(&expected.x) {
        assert!((found - expected).abs() < 1e-4, "{found} instead of {expected}");
    }
}

#[test]
fn who_is_not_a_number_has_no_future_and_does_not_disturb_the_others() {
    let mut broken = traffic(&[(0.0, 0.0, 8.0), (20.0, 0.2, 6.0)], 30);
    broken.past.x[61] = f64::NAN;
    let found = predicted(&broken, WalenetSettings::default());
    let alone = predicted(&traffic(&[(0.0, 0.0, 8.0)], 30), WalenetSettings::default());
    assert!(found.valid[30..].iter().all(|valid| !valid));
    assert_eq!(found.x[..30], alone.x[..30]);
}

#[test]
fn of_two_in_a_cell_the_nearer_one_counts() {
    let with = |others: &[(f64, f64, f64)]| {
        let cars: Vec<(f64, f64, f64)> = std::iter::once((0.0, 0.0, 8.0)).chain(others.iter().copied()).collect();
        predicted(&traffic(&cars, 30), WalenetSettings::default()).x[..30].to_vec()
    };
    // Cells are 6 m long; the second begins 3 m ahead.
    let near = (4.0, 0.5, 5.0);
    let far = (8.0, 0.5, 2.0);
    assert_eq!(with(&[near, far]), with(&[near]));
    assert_eq!(with(&[far, near]), with(&[near]));
    assert_ne!(with(&[far]), with(&[near]));
    assert_eq!(with(&[near, (45.0, 0.0, 3.0), (0.0, 12.0, 3.0)]), with(&[near]), "outside the field");
}

#[test]
fn a_turned_world_is_predicted_the_same() {
    let scene = traffic(&[(0.0, 0.0, 8.0), (12.0, 0.2, 6.0)], 30);
    let here = predicted(&scene, WalenetSettings::default());
    let mut turned = scene.clone();
    for i in 0..turned.past.x.len() {
        let (x, y) = (scene.past.x[i], scene.past.y[i]);
        (turned.past.x[i], turned.past.y[i]) = (-y + 7e5, x - 5e6);
        turned.past.orientation[i] += std::f64::consts::FRAC_PI_2;
    }
    let turn = |point: &Point| Point::new(-point.y + 7e5, point.x - 5e6);
    let center = |points: Vec<Point>| points.iter().map(turn).collect::<Vec<_>>();
    let road = Arc::new(closed(vec![
        with_successors(lane(1, &center(straight((-100.0, 0.0), (60.0, 0.0)))), &[2]),
        lane(2, &center(arc((60.0, 50.0), 50.0, -std::f64::consts::FRAC_PI_2, 0.6))),
    ]));
    let walenet = Walenet::new(network(), WalenetSettings::default(), Arc::clone(&road));
    let there = predict(&Predictor::Walenet(Arc::new(walenet)), &turned, &road, 30).expect("possible");
    // Large coordinates cost pixels on the edge, nothing else: means are in double precision.
    for i in 0..here.x.len() {
        let expected = turn(&Point::new(here.x[i], here.y[i]));
        assert!(Point::new(there.x[i], there.y[i]).distance(expected) < 0.05, "step {i}");
        assert!((there.covariance_xx[i] / here.covariance_yy[i] - 1.0).abs() < 0.05);
    }
}

#[test]
fn the_number_of_threads_makes_no_difference() {
    let cars: Vec<(f64, f64, f64)> =
        (0..23).map(|i| (7.0 * f64::from(i) - 80.0, f64::from(i % 3), 3.0 + f64::from(i % 5))).collect();
    let scene = traffic(&cars, 12);
    let on = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        pool.install(|| predicted(&scene, WalenetSettings::default()))
    };
    assert_eq!(on(1), on(3));
}
