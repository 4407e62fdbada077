//! The `tyndall` command: `serve`, `render`, `bench`, `import`, `doctor`, `health`.

mod bench;
mod doctor;
mod health;
mod import;
mod render_command;
mod scene_on_disk;
mod serve;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Remote volume rendering under global illumination.
#[derive(Parser)]
#[command(version, about, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs the service, web client included.
    Serve(serve::Arguments),
    /// Draws a scene without a server.
    Render(render_command::Arguments),
    /// Measures and reports.
    Bench(bench::Arguments),
    /// Reads a volume file, says what it found, optionally converts it to NRRD.
    Import(import::Arguments),
    /// Says which GPU is used, its limits, and what will be slow.
    Doctor(doctor::Arguments),
    /// Asks a running service whether it can do its work; for containers and supervisors.
    Health(health::Arguments),
}

/// Exit code for input that was refused; 1 is for everything else that fails.
const REFUSED: u8 = 2;

/// Input that was refused, in words.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Refused(String);

fn main() -> ExitCode {
    let filter = tracing_subscriber::EnvFilter::try_from_env("TYNDALL_LOG");
    tracing_subscriber::fmt()
        .with_env_filter(filter.unwrap_or_else(|_| "warn,tyndall=info,service=info".into()))
        .with_writer(std::io::stderr)
        .init();
    let result = match Arguments::parse().command {
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Render(arguments) => render_command::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Health(arguments) => health::run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tyndall: {error:#}");
            if error.is::<Refused>() { ExitCode::from(REFUSED) } else { ExitCode::FAILURE }
        }
    }
}
