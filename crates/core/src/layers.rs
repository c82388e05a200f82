//! Layers of networks in single precision, summed in a fixed order.

pub(crate) mod linear;
mod product;
