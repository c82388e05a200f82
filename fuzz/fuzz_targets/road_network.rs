#![no_main]

use interdrive_core_fuzz::{roads, source::Source};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| roads::check(&mut Source::new(bytes)));
