//! `tyndall serve`.

use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Arguments {
    /// Address to listen on.
    #[arg(long, value_name = "ADDR")]
    listen: Option<std::net::SocketAddr>,
    /// Data directory.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

pub fn run(_: &Arguments) -> anyhow::Result<()> {
    anyhow::bail!("under construction")
}
