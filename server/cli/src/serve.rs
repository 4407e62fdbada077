//! `tyndall serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use service::Config;

#[derive(clap::Args)]
pub struct Arguments {
    /// Address to listen on; default 127.0.0.1:8080.
    #[arg(long, value_name = "ADDR")]
    listen: Option<SocketAddr>,
    /// Data directory; default `data`.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Memory of the GPU for all sessions, for example 6G; `limits.max_gpu_bytes`.
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    gpu_memory: Option<u64>,
    /// Memory for the voxels of all sessions, for example 12G; `limits.max_volume_memory_bytes`.
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    memory: Option<u64>,
    /// Disk for precomputed light, for example 20G; 0 stores none; `limits.max_bake_bytes`.
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    bake_storage: Option<u64>,
    /// Settings file (TOML).
    #[arg(long, value_name = "FILE", env = "TYNDALL_CONFIG")]
    config: Option<PathBuf>,
    /// Any setting by its path in the settings file, for example limits.max_sessions=8; may be repeated.
    #[arg(long = "setting", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    /// Refuse to run on a software device.
    #[arg(long)]
    hardware_only: bool,
    /// Print every setting with its environment variable and default, and end.
    #[arg(long)]
    list_settings: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if arguments.list_settings {
        for (path, variable, default) in Config::settings() {
            println!("{path:<34} {variable:<42} {default}");
        }
        return Ok(());
    }
    let mut flags = Vec::new();
    for assignment in &arguments.settings {
        let (path, value) = assignment
            .split_once('=')
            .ok_or_else(|| crate::Refused(format!("--setting {assignment}: expected PATH=VALUE")))?;
        flags.push((path.to_owned(), value.to_owned()));
    }
    if let Some(listen) = arguments.listen {
        flags.push(("listen".into(), listen.to_string()));
    }
    if let Some(data) = &arguments.data {
        flags.push(("data".into(), data.display().to_string()));
    }
    let sizes = [
        ("limits.max_gpu_bytes", arguments.gpu_memory),
        ("limits.max_volume_memory_bytes", arguments.memory),
        ("limits.max_bake_bytes", arguments.bake_storage),
    ];
    flags.extend(sizes.into_iter().filter_map(|(path, bytes)| Some((path.to_owned(), bytes?.to_string()))));
    if arguments.hardware_only {
        flags.push(("hardware_only".into(), "true".into()));
    }
    let config = Config::load(arguments.config.as_deref(), std::env::vars(), &flags)
        .map_err(|error| crate::Refused(error.to_string()))?;
    println!("Tyndall starts at http://{}/ (data in {})", config.listen, config.data.display());
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    Ok(runtime.block_on(service::serve(config))?)
}

/// A number of bytes, with K, M, G or T for powers of 1024.
fn parse_bytes(text: &str) -> Result<u64, String> {
    let (digits, shift) = match text.char_indices().next_back() {
        Some((at, unit)) if unit.is_ascii_alphabetic() => {
            let power = "KMGT".find(unit.to_ascii_uppercase()).ok_or("the unit must be K, M, G or T")?;
            (&text[..at], 10 * (power as u32 + 1))
        }
        _ => (text, 0),
    };
    let number: u64 = digits.parse().map_err(|_| "must be a whole number, with K, M, G or T after it")?;
    number.checked_mul(1 << shift).ok_or_else(|| "is too large".into())
}

#[cfg(test)]
mod tests {
    use super::parse_bytes;

    #[test]
    fn bytes_are_read_with_their_unit() {
        assert_eq!(parse_bytes("4096"), Ok(4096));
        assert_eq!(parse_bytes("6G"), Ok(6 << 30));
        assert_eq!(parse_bytes("10k"), Ok(10 << 10));
        for wrong in ["", "G", "1.5G", "6GB", "-1", "99999999999T", "6x", "6\u{e9}"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
