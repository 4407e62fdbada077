//! `tyndall import`.

use std::path::PathBuf;

use formats::{ReadOptions, describe, read_volume, write_nrrd};

use crate::Refused;

#[derive(clap::Args)]
pub struct Arguments {
    /// Volume file, folder of slices or OME-Zarr, folder or zip of DICOM; raw files need a JSON sidecar.
    file: PathBuf,
    /// Converts to NRRD.
    #[arg(short, long, value_name = "OUT.nrrd")]
    out: Option<PathBuf>,
    /// Which volume or component of a file that holds several.
    #[arg(long)]
    index: Option<u32>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let options = ReadOptions { index: arguments.index, siblings_only: false, ..ReadOptions::default() };
    let imported = read_volume(&arguments.file, &options).map_err(|error| Refused(error.to_string()))?;
    println!("{}", serde_json::to_string_pretty(&describe(&imported))?);
    if let Some(out) = &arguments.out {
        write_nrrd(out, &imported.volume)?;
    }
    Ok(())
}
