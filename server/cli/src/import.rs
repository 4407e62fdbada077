//! `tyndall import`.

use std::path::{Path, PathBuf};

use formats::{ReadOptions, describe, read_volume, write_nrrd};
use proto::scene_file::{Builtin, limits};

use crate::Refused;

#[derive(clap::Args)]
pub struct Arguments {
    /// Volume file, folder of slices or OME-Zarr, folder or zip of DICOM; raw files need a JSON
    /// sidecar. `builtin:NAME` or `builtin:NAME:EDGE` is a built-in volume.
    file: PathBuf,
    /// Converts to NRRD.
    #[arg(short, long, value_name = "OUT.nrrd")]
    out: Option<PathBuf>,
    /// Which volume or component of a file that holds several.
    #[arg(long)]
    index: Option<u32>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(name) = arguments.file.to_str().and_then(|file| file.strip_prefix("builtin:")) {
        return export_builtin(name, arguments.out.as_deref());
    }
    let options = ReadOptions { index: arguments.index, siblings_only: false, ..ReadOptions::default() };
    let imported = read_volume(&arguments.file, &options).map_err(|error| Refused(error.to_string()))?;
    println!("{}", serde_json::to_string_pretty(&describe(&imported))?);
    if let Some(out) = &arguments.out {
        write_nrrd(out, &imported.volume)?;
    }
    Ok(())
}

/// Edge of a built-in volume where none is given, voxels.
const BUILTIN_EDGE: usize = 128;

/// Writes a built-in volume, so that other programs can be given the same voxels.
fn export_builtin(name: &str, out: Option<&Path>) -> anyhow::Result<()> {
    let (name, edge) = match name.split_once(':') {
        Some((name, edge)) => {
            let most = limits::MAX_VOLUME_EDGE as usize;
            let edge = edge.parse().ok().filter(|edge| (1..=most).contains(edge));
            (
                name,
                edge.ok_or_else(|| Refused(format!("builtin:{name}: the edge must be 1 to {most} voxels")))?,
            )
        }
        None => (name, BUILTIN_EDGE),
    };
    let kind = Builtin::ALL.into_iter().find(|kind| kind.name() == name);
    let kind = kind.ok_or_else(|| {
        Refused(format!("builtin:{name}: known are {}", Builtin::ALL.map(Builtin::name).join(", ")))
    })?;
    let volume = scene::builtin::build(kind, [edge; 3], &|_| {});
    println!("{}", serde_json::json!({"builtin": name, "dims": volume.dims}));
    if let Some(out) = out {
        write_nrrd(out, &volume)?;
    }
    Ok(())
}
