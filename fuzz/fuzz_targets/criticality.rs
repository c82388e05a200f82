#![no_main]

use interdrive_core_fuzz::{judged, source::Source};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| judged::check(&mut Source::new(bytes)));
