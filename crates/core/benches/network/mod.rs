//! The network that is shipped, for tests and measurements that must not need Python.

use interdrive_core::predict::neural::{Network, Tensor};

const WEIGHTS: &[u8] = include_bytes!("../../../../python/interdrive/predictors/neural.safetensors");

/// Reads what `training/` writes and nothing else: safetensors is the length of a header (64 bits, little-endian), the
/// header in JSON, and the values.
pub fn network() -> Network {
    let (n, rest) = WEIGHTS.split_at(8);
    let (header, values) = rest.split_at(u64::from_le_bytes(n.try_into().expect("8 bytes")) as usize);
    let header = std::str::from_utf8(header).expect("a header");
    // {"name":{"dtype":"F32","shape":[64,62],"data_offsets":[256,16128]}, ...
    let tensors = header.match_indices(":{\"dtype\":\"F32\",").map(|(at, _)| {
        let name = header[..at].trim_end_matches('"').rsplit('"').next().expect("a name").to_string();
        let [start, end] = numbers(&header[at..], "data_offsets")[..] else { panic!("{name} has no place") };
        let values = values[start..end].chunks_exact(4);
        let values = values.map(|bytes| f32::from_le_bytes(bytes.try_into().expect("4 bytes"))).collect();
        Tensor { name, shape: numbers(&header[at..], "shape"), values }
    });
    let network = Network::new(tensors.collect()).expect("a network");
    assert!(network.tail.is_some(), "decodes as the predictor does");
    network
}

/// The first list of a name.
fn numbers(header: &str, name: &str) -> Vec<usize> {
    let list = header.split(&format!("\"{name}\":[")).nth(1).and_then(|rest| rest.split(']').next());
    list.expect(name).split(',').map(|number| number.parse().expect("a number")).collect()
}
