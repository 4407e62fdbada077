//! Writes the web client's types; run from the repository's root.

fn main() -> std::io::Result<()> {
    let path = std::path::Path::new(proto::typescript::GENERATED_FILE);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, proto::typescript::typescript())?;
    println!("wrote {}", path.display());
    Ok(())
}
