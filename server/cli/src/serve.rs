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
    if arguments.hardware_only {
        flags.push(("hardware_only".into(), "true".into()));
    }
    let config = Config::load(arguments.config.as_deref(), std::env::vars(), &flags)
        .map_err(|error| crate::Refused(error.to_string()))?;
    println!("Tyndall starts at http://{}/ (data in {})", config.listen, config.data.display());
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    Ok(runtime.block_on(service::serve(config))?)
}
