#![no_main]

use interdrive_core_fuzz::drives;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| drives::check(bytes));
