//! Builds this crate again when the web client's build, or the embedded samples, change.

use std::path::Path;

fn main() {
    // Where the client was never built, its sources are watched: building it changes their folder.
    let built = Path::new("../../web/dist");
    let watched = if built.is_dir() { "../../web/dist" } else { "../../web" };
    println!("cargo::rerun-if-changed={watched}");
    println!("cargo::rerun-if-changed=samples");
    println!("cargo::rerun-if-changed=build.rs");
}
