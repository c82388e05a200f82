//! The properties of the core's tests, with their generators.

#[path = "../../crates/core/tests/properties/curves.rs"]
pub mod curves;
#[path = "../../crates/core/tests/properties/drives.rs"]
pub mod drives;
#[path = "../../crates/core/tests/properties/judged.rs"]
pub mod judged;
#[path = "../../crates/core/benches/network/mod.rs"]
mod network;
#[path = "../../crates/core/tests/properties/roads.rs"]
pub mod roads;
#[path = "../../crates/core/tests/properties/shapes.rs"]
pub mod shapes;
#[path = "../../crates/core/tests/properties/source.rs"]
pub mod source;
#[path = "../../crates/core/tests/properties/traffic.rs"]
mod traffic;
