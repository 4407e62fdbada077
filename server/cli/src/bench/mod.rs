//! `tyndall bench`: suites of measurements, each written as CSV, JSON and a plot.

mod accuracy;
mod bases;
mod bone;
mod compression;
mod display;
mod drawing;
mod edits;
mod flip;
mod load;
mod methods;
mod papers;
mod references;
mod report;
mod scenes;
mod served;
mod skip;
mod stability;
mod steps;
mod stream;

use std::path::PathBuf;

use clap::ValueEnum as _;
use proto::scene_file::Builtin;

use crate::Refused;

/// Measurements that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Suite {
    /// Run time against error, for every method and setting.
    Accuracy,
    /// Numbers that hurt: no NaN, no panic, bounded time, a known error.
    Stability,
    /// Work and time with and without what is not needed, and that the picture is the same.
    Skip,
    /// What an edit of a photon map saves by following only stale photons.
    Edits,
    /// What compressing a bake of light leaves out, costs and saves.
    Compression,
    /// Error against the step length, for smooth and sharp transfer functions.
    Steps,
    /// Light from infinity in few functions: error, projection and evaluation of each basis.
    Bases,
    /// Tables of the papers of `convection_diffusion` and `image_based`, taken anew.
    Papers,
    /// Frames per second, latency and bytes of a streamed session.
    Stream,
    /// Many viewers at once: what each gets, how evenly, and what a long job beside them costs.
    Load,
}

#[derive(clap::Args)]
pub struct Arguments {
    /// Suite to run; default: all.
    suite: Option<Suite>,
    /// Scenes to use where a suite has a choice, separated by commas; default: all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Methods that `stability` measures, separated by commas; default: all.
    #[arg(long, value_delimiter = ',')]
    methods: Vec<String>,
    /// Tables of `papers`, separated by commas: light grid, lights, transport, heat flow, error by grid, records, bands,
    /// exchange; default: all.
    #[arg(long, value_delimiter = ',')]
    tables: Vec<String>,
    /// Where reports go.
    #[arg(long, value_name = "DIR", default_value = "bench-out")]
    out: PathBuf,
    /// How large scenes and pictures of `accuracy` are.
    #[arg(long, value_enum, default_value_t = SceneSize::Small)]
    size: SceneSize,
    /// The short form of `accuracy`, `stability` and `skip`: fails where work or error is more than
    /// what was accepted. That of `edits` has fewer photons, that of `papers` fewer rows.
    #[arg(long)]
    quick: bool,
    /// Where reference pictures are kept from run to run; default: `references` in the reports' folder.
    #[arg(long, value_name = "DIR")]
    references: Option<PathBuf>,
}

/// Sizes that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum SceneSize {
    /// For a machine without a GPU.
    Small,
    /// For a GPU.
    Large,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    std::fs::create_dir_all(&arguments.out)?;
    let suites = match arguments.suite {
        Some(suite) => vec![suite],
        None => Suite::value_variants().to_vec(),
    };
    // Names are checked before anything is measured.
    for suite in &suites {
        match suite {
            Suite::Accuracy => drop(accuracy::chosen(&arguments.scenes, arguments.quick)?),
            Suite::Skip | Suite::Steps => drop(chosen_scenes(&arguments.scenes)?),
            Suite::Stability => drop(chosen_methods(&arguments.methods)?),
            Suite::Edits
            | Suite::Compression
            | Suite::Bases
            | Suite::Papers
            | Suite::Stream
            | Suite::Load => {}
        }
    }
    suites.into_iter().try_for_each(|suite| run_suite(suite, arguments))
}

fn run_suite(suite: Suite, arguments: &Arguments) -> anyhow::Result<()> {
    let out = &arguments.out;
    match suite {
        Suite::Accuracy => {
            let size = match arguments.size {
                _ if arguments.quick => scenes::Size::Quick,
                SceneSize::Small => scenes::Size::Small,
                SceneSize::Large => scenes::Size::Large,
            };
            let references = arguments.references.clone().unwrap_or_else(|| out.join("references"));
            let plan = accuracy::Plan { scenes: &arguments.scenes, size, out, references: &references };
            accuracy::run(&plan)
        }
        Suite::Stability => stability::run(&chosen_methods(&arguments.methods)?, arguments.quick, out),
        Suite::Skip => skip::run(&chosen_scenes(&arguments.scenes)?, arguments.quick, out),
        Suite::Steps => steps::run(&chosen_scenes(&arguments.scenes)?, out),
        Suite::Edits => edits::run(arguments.quick, out),
        Suite::Compression => compression::run(out),
        Suite::Bases => bases::run(out),
        Suite::Papers => papers::run(&arguments.tables, arguments.quick, out),
        Suite::Stream => stream::run(out),
        Suite::Load => load::run(out),
    }
}

fn chosen_methods(names: &[String]) -> Result<Vec<&'static methods::Entry>, Refused> {
    methods::chosen(names).map_err(Refused)
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
