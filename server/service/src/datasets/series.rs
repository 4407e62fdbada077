//! DICOM uploads: the volumes are kept, the files are not.
//!
//! DICOM files name their patient. What the viewer shows needs voxels, spacing and orientation
//! only, so each volume of the upload is written as NRRD and the uploaded files go away with
//! their folder. Of their texts, modality and series description are kept, as names to choose by.

use std::path::Path;
use std::sync::Arc;

use formats::{FormatError, Imported};
use proto::rest::Dataset;
use proto::scene_file::VoxelType;
use scene::{PreparedVolume, Volume};

use super::receive::Folder;
use super::storage::{Manifest, StoredVolume, random_hex};
use super::volumes;
use crate::App;
use crate::problem::{Answer, Fault};

/// Most volumes of an upload that are kept.
const MAX_VOLUMES: u32 = 32;

/// Stores the volumes of a DICOM upload, of which `first` has been read. Blocks.
///
/// # Errors
/// No room, or the file system refuses.
pub(super) fn import(
    app: &Arc<App>,
    path: &Path,
    content: &str,
    upload_bytes: u64,
    first: Imported,
) -> Answer<(Dataset, bool)> {
    let failed = |error| Fault::disk("storing a series", &error);
    let folder = Folder(app.catalog().storage().incoming().join(random_hex(16).map_err(failed)?));
    std::fs::create_dir(&folder.0).map_err(failed)?;
    let mut notices = first.notices;
    let mut names = vec![first.choice_names.first().cloned().unwrap_or_default()];
    let mut stored = vec![store_volume(&folder.0, 0, &first.volume)?];
    let count = u32::try_from(first.choice_names.len()).unwrap_or(u32::MAX);
    for index in 1..count.min(MAX_VOLUMES) {
        let name = first.choice_names.get(index as usize).cloned().unwrap_or_default();
        match volumes::read(path, Some(index), &app.config().limits, &|_| {}) {
            Ok(read) => {
                stored.push(store_volume(&folder.0, stored.len(), &read.volume)?);
                names.push(name);
            }
            // The reader's words may quote file names, which may name patients.
            Err(_) => notices.push(format!("{name} cannot be read and is left out")),
        }
    }
    if count > MAX_VOLUMES {
        notices.push(format!("of {count} volumes the first {MAX_VOLUMES} are kept"));
    }
    // The volumes may take more room than the upload, which is set aside already.
    let bytes = folder_bytes(&folder.0).map_err(failed)?;
    let mut reservation = app.catalog().reserve();
    reservation.grow(bytes.saturating_sub(upload_bytes))?;

    let prepared = PreparedVolume::new(first.volume, &|_| {});
    let title = names[0].rsplit_once(" (").map_or("DICOM", |(title, _)| title).to_owned();
    let mut dataset = super::describe(&prepared, "", &title, first.format.name());
    dataset.voxel_type = if is_scaled(&prepared.volume) { VoxelType::Float32 } else { dataset.voxel_type };
    dataset.bytes = bytes;
    dataset.notices = notices;
    dataset.choices = if names.len() > 1 { names } else { Vec::new() };
    dataset.created_unix_millis = crate::unix_millis();
    let main_file = stored[0].file.clone();
    let mut manifest = Manifest::new(content.to_owned(), main_file, dataset);
    manifest.volumes = stored;
    let (dataset, new) = app.catalog().store(&folder.0, manifest)?;
    app.volumes().offer(volumes::Key::dataset(&dataset.id), prepared);
    Ok((dataset, new))
}

fn store_volume(folder: &Path, index: usize, volume: &Volume) -> Answer<StoredVolume> {
    let file = format!("{index}.nrrd");
    formats::write_nrrd(&folder.join(&file), volume).map_err(|error| match error {
        FormatError::Io { source, .. } => Fault::disk("storing a series", &source),
        other => Fault::internal("storing a series", &other),
    })?;
    // Scaled values are written as 32-bit floats.
    let voxel_bytes = if is_scaled(volume) { 4 } else { volume.voxels.bytes() / volume.voxels.len().max(1) };
    Ok(StoredVolume { file, memory_bytes: (volume.voxels.len() * voxel_bytes) as u64 })
}

fn is_scaled(volume: &Volume) -> bool {
    volume.slope != 1.0 || volume.intercept != 0.0
}

fn folder_bytes(folder: &Path) -> std::io::Result<u64> {
    std::fs::read_dir(folder)?.map(|entry| Ok(entry?.metadata()?.len())).sum()
}
