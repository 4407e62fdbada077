//! What the fuzz targets share. The cases themselves are in [`cases`], which the tests of
//! `formats` run over the seeds, too.

pub mod cases;

use std::panic::{AssertUnwindSafe, catch_unwind, set_hook};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use cases::Case;

/// Message of the last panic.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// The folder of this process that the cases write into.
fn scratch() -> &'static Path {
    static SCRATCH: OnceLock<PathBuf> = OnceLock::new();
    SCRATCH.get_or_init(|| {
        // A panic that a reader catches itself is no crash: libFuzzer's hook would make it one.
        set_hook(Box::new(|info| {
            *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = info.to_string();
        }));
        let folder = std::env::temp_dir().join(format!("tyndall-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        folder
    })
}

/// Runs a case; a panic that leaves it ends the process, which libFuzzer reports as a crash.
pub fn run(case: Case, bytes: &[u8]) {
    let folder = scratch();
    if catch_unwind(AssertUnwindSafe(|| case(folder, bytes))).is_err() {
        eprintln!("{}", LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        std::process::abort();
    }
}
