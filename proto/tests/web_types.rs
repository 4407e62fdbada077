//! The committed web types are the ones this crate generates.

use proto::typescript::{GENERATED_FILE, typescript};

#[test]
fn committed_web_types_are_current() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(GENERATED_FILE);
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == typescript(),
        "{GENERATED_FILE} is stale: run `make web-types` and commit the result"
    );
}
