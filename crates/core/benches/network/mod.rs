//! A network as wide as the one that is shipped.

use interdrive_core::predict::neural::{MODE_OUTPUTS, N_AGENT, N_KNOTS, N_NEIGHBOUR, N_PATH, Network, Tensor};

/// Weights of no meaning.
pub fn network() -> Network {
    let mut tensors = vec![];
    let mut add = |name: String, shape: Vec<usize>, value: &dyn Fn(usize) -> f32| {
        let values = (0..shape.iter().product()).map(value).collect();
        tensors.push(Tensor { name, shape, values });
    };
    for (name, n_in, n_out) in [
        ("agent.0", N_AGENT, 64),
        ("agent.1", 64, 64),
        ("neighbour.0", N_NEIGHBOUR, 32),
        ("neighbour.1", 32, 32),
        ("path.0", N_PATH + 96, 64),
        ("path.1", 64, 64),
        ("head.0", 128, 64),
        ("head.1", 64, 2 * MODE_OUTPUTS),
    ] {
        add(format!("{name}.weight"), vec![n_out, n_in], &|k| ((k * 37 % 101) as f32 - 50.0) * 2e-3);
        add(format!("{name}.bias"), vec![n_out], &|k| ((k * 31 % 17) as f32 - 8.0) * 1e-2);
    }
    add("calibration.s".to_string(), vec![N_KNOTS], &|_| 1.0);
    add("calibration.d".to_string(), vec![N_KNOTS], &|_| 1.0);
    Network::new(tensors).expect("a network")
}
