//! `tyndall bench`: suites of measurements, each written as CSV, JSON and a plot.

mod report;
mod skip;
mod steps;
mod stream;

use std::path::PathBuf;

use proto::scene_file::Builtin;

use crate::Refused;

/// Measurements that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Suite {
    /// Samples and time with and without empty-space skipping.
    Skip,
    /// Error against the step length, for smooth and sharp transfer functions.
    Steps,
    /// Frames per second, latency and bytes of a streamed session.
    Stream,
}

#[derive(clap::Args)]
pub struct Arguments {
    /// Suite to run; default: all.
    suite: Option<Suite>,
    /// Built-in scenes to use where a suite has a choice, separated by commas; default: all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Where reports go.
    #[arg(long, value_name = "DIR", default_value = "bench-out")]
    out: PathBuf,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let scenes = chosen_scenes(&arguments.scenes)?;
    std::fs::create_dir_all(&arguments.out)?;
    let wanted = |suite| arguments.suite.is_none_or(|chosen| chosen == suite);
    if wanted(Suite::Skip) {
        skip::run(&scenes, &arguments.out)?;
    }
    if wanted(Suite::Steps) {
        steps::run(&scenes, &arguments.out)?;
    }
    if wanted(Suite::Stream) {
        stream::run(&arguments.out)?;
    }
    Ok(())
}

fn chosen_scenes(names: &[String]) -> Result<Vec<Builtin>, Refused> {
    if names.is_empty() {
        // The homogeneous cube has nothing to skip and nothing to see.
        return Ok(Builtin::ALL.into_iter().filter(|&kind| kind != Builtin::Homogeneous).collect());
    }
    let known = || Builtin::ALL.map(Builtin::name).join(", ");
    let find = |name: &String| {
        let kind = Builtin::ALL.into_iter().find(|kind| kind.name() == name);
        kind.ok_or_else(|| Refused(format!("--scenes: unknown scene `{name}`; known: {}", known())))
    };
    names.iter().map(find).collect()
}
