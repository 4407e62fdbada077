//! See `cases::dicom`.
#![no_main]

use formats_fuzz::{cases, run};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| run(cases::dicom, bytes));
