//! Multi-agent driving simulation without input, output or Python. Modules in layer order, bottom first: each may use
//! those above it in this list.

pub mod simd;
pub mod error;
pub mod settings;
pub mod limits;
pub mod conduct;
pub mod draws;
pub mod geometry;
pub mod columns;
pub mod turn;
pub mod trajectory;
pub mod vehicle;
pub mod road;
pub mod control;
pub mod junctions;
pub mod route;
pub mod scenario;
pub mod start;
pub mod recording;
pub mod collision;
pub mod reference_drivers;
pub mod criticality;
pub mod scene;
pub mod barrier;
pub mod rules;
pub mod right_of_way;
pub mod layers;
pub mod predict;
pub mod v2x;
pub mod observation;
pub mod plan;
pub mod world;
pub mod worlds;
