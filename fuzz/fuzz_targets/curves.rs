#![no_main]

use interdrive_core_fuzz::{curves, shapes, source::Source};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    curves::check(&mut Source::new(bytes));
    shapes::check(&mut Source::new(bytes));
});
