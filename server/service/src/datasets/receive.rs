//! Receiving an upload: bytes to a temporary folder, bounded and hashed as they come.
//!
//! Whatever goes wrong (the client hangs up, a limit is met, no reader accepts the file), the
//! folder goes away with its [`Incoming`]. Resumable uploads ([`super::uploads`]) come here when they
//! are complete.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::Multipart;
use axum::extract::multipart::MultipartError;
use futures_util::{Stream, StreamExt};
use proto::rest::Dataset;
use tokio::io::AsyncWriteExt;

use super::storage::{Manifest, random_hex};
use super::{Reservation, series, volumes};
use crate::App;
use crate::problem::{Answer, Fault};

/// Longest pause between two pieces of an upload.
pub(super) const MAX_PAUSE: Duration = Duration::from_secs(30);
/// An upload slower than this on average, after its first minute, holds its place for nothing.
const MIN_BYTES_PER_SECOND: f64 = 1024.0;
const GRACE: Duration = Duration::from_secs(60);
/// Bytes gathered before they are handed to the file system.
pub(super) const WRITE_BYTES: usize = 1 << 20;
/// Most volumes of a file without names for them that can be chosen on the page.
const MAX_LISTED_CHOICES: u64 = 512;
/// Endings of slices that come in one file each.
const SLICE_ENDINGS: [&str; 3] = [".tif", ".tiff", ".png"];
/// Longest file name kept, characters.
const MAX_NAME_CHARS: usize = 100;

/// An upload under way: its folder, what it holds and the room set aside for it.
pub struct Incoming<'a> {
    app: &'a Arc<App>,
    folder: Folder,
    /// Name and BLAKE3 of each file.
    files: BTreeMap<String, blake3::Hash>,
    bytes: u64,
    reservation: Reservation,
    began: Instant,
}

/// Whether `bytes` since `began` are too few for the upload to keep its place.
pub(super) fn check_pace(bytes: u64, began: Instant) -> Answer<()> {
    let elapsed = began.elapsed();
    if elapsed > GRACE && (bytes as f64) < MIN_BYTES_PER_SECOND * elapsed.as_secs_f64() {
        return Err(Fault::timed_out("The upload is too slow; try again on a better link."));
    }
    Ok(())
}

/// What arrives next of a body; `None` at its end.
///
/// # Errors
/// Nothing came for [`MAX_PAUSE`], or the body broke off.
pub(super) async fn next_piece<E: std::fmt::Display>(
    pieces: &mut (impl Stream<Item = Result<Bytes, E>> + Unpin),
) -> Answer<Option<Bytes>> {
    let piece = tokio::time::timeout(MAX_PAUSE, pieces.next())
        .await
        .map_err(|_| Fault::timed_out(format!("Nothing arrived for {} seconds.", MAX_PAUSE.as_secs())))?;
    piece.transpose().map_err(|error| Fault::bad_request(format!("The upload broke off: {error}.")))
}

/// A temporary folder; removed with everything in it when dropped.
pub(super) struct Folder(pub(super) PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let path = std::mem::take(&mut self.0);
        let remove = move || match std::fs::remove_dir_all(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                tracing::error!(%error, "an unfinished upload stays until the next start");
            }
            _ => {}
        };
        match tokio::runtime::Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn_blocking(remove)),
            Err(_) => remove(),
        }
    }
}

impl<'a> Incoming<'a> {
    /// An empty upload.
    ///
    /// # Errors
    /// Too many datasets, or the file system refuses.
    pub async fn new(app: &'a Arc<App>) -> Answer<Self> {
        Self::with_room(app, app.catalog().reserve()).await
    }

    /// An empty upload for which room has been set aside.
    ///
    /// # Errors
    /// See [`Incoming::new`].
    pub async fn with_room(app: &'a Arc<App>, reservation: Reservation) -> Answer<Self> {
        app.catalog().check_count()?;
        let storage_failed = |error| Fault::disk("preparing an upload", &error);
        let name = random_hex(16).map_err(storage_failed)?;
        let path = app.catalog().storage().incoming().join(name);
        tokio::fs::create_dir(&path).await.map_err(storage_failed)?;
        Ok(Self {
            app,
            folder: Folder(path),
            files: BTreeMap::new(),
            bytes: 0,
            reservation,
            began: Instant::now(),
        })
    }

    /// Receives one file.
    ///
    /// # Errors
    /// A second file of the same name, a limit, a client that stops sending.
    pub async fn file<E: std::fmt::Display>(
        &mut self,
        name: &str,
        mut pieces: impl Stream<Item = Result<Bytes, E>> + Unpin,
    ) -> Answer<()> {
        let name = self.new_name(name)?;
        let disk_failed = |error: std::io::Error| Fault::disk("writing an upload", &error);
        let file = tokio::fs::File::create_new(self.folder.0.join(&name)).await.map_err(disk_failed)?;
        let mut file = tokio::io::BufWriter::with_capacity(WRITE_BYTES, file);
        let mut hasher = blake3::Hasher::new();
        while let Some(piece) = next_piece(&mut pieces).await? {
            self.count(piece.len() as u64)?;
            hasher.update(&piece);
            file.write_all(&piece).await.map_err(disk_failed)?;
        }
        file.flush().await.map_err(disk_failed)?;
        file.into_inner().sync_all().await.map_err(disk_failed)?;
        self.files.insert(name, hasher.finalize());
        Ok(())
    }

    /// Receives the parts of a form, each a file named `file`.
    ///
    /// # Errors
    /// A form that cannot be read, another part, and those of [`Incoming::file`].
    pub async fn form(&mut self, mut form: Multipart) -> Answer<()> {
        let broken = |error: MultipartError| {
            Fault::bad_request(format!("The form cannot be read: {}.", error.body_text()))
        };
        while let Some(field) = form.next_field().await.map_err(broken)? {
            let name = field.name().unwrap_or_default().to_owned();
            if name != "file" {
                return Err(Fault::invalid(
                    plain_name(&name),
                    "is not a part of an upload; parts are named `file`",
                ));
            }
            let file_name = field.file_name().unwrap_or_default().to_owned();
            self.file(&file_name, field).await?;
        }
        Ok(())
    }

    /// Takes a synced file of the data directory as one of the upload's; the file stays where it is,
    /// too.
    ///
    /// # Errors
    /// See [`Incoming::file`].
    pub async fn adopt(&mut self, name: &str, path: &Path) -> Answer<()> {
        let name = self.new_name(name)?;
        let (source, target) = (path.to_owned(), self.folder.0.join(&name));
        let adopting = move || {
            // File systems without hard links, and folders on different ones, copy.
            if std::fs::hard_link(&source, &target).is_err() {
                std::fs::copy(&source, &target)?;
                std::fs::File::open(&target)?.sync_all()?;
            }
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(std::fs::File::open(&target)?)?;
            Ok((hasher.finalize(), hasher.count()))
        };
        let (hash, bytes) = crate::blocking("reading an upload", adopting)
            .await?
            .map_err(|error| Fault::disk("reading an upload", &error))?;
        self.count(bytes)?;
        self.files.insert(name, hash);
        Ok(())
    }

    /// A client's name for one more file as a plain name.
    fn new_name(&self, name: &str) -> Answer<String> {
        let name = plain_name(name);
        let most_files = self.app.config().limits.max_upload_files;
        if self.files.len() >= most_files {
            return Err(Fault::too_large(format!(
                "An upload may have {most_files} files (`limits.max_upload_files`)."
            )));
        }
        if self.files.contains_key(&name) {
            return Err(Fault::invalid("file", format!("The upload has two files named `{name}`.")));
        }
        Ok(name)
    }

    fn count(&mut self, bytes: u64) -> Answer<()> {
        self.bytes += bytes;
        let most = self.app.config().limits.max_upload_bytes;
        if self.bytes > most {
            return Err(Fault::too_large(format!(
                "An upload may have {most} bytes (`limits.max_upload_bytes`)."
            )));
        }
        check_pace(self.bytes, self.began)?;
        self.reservation.cover(self.bytes)
    }

    /// Reads the received files as a volume and stores them. `true` if the dataset is new.
    ///
    /// # Errors
    /// No file, or none that a reader accepts (422, with the reader's words); no room.
    pub async fn finish(self) -> Answer<(Dataset, bool)> {
        let Some(main_file) = main_file(self.files.keys()) else {
            return Err(Fault::invalid("file", "The upload has no volume file."));
        };
        let content = content_hash(&self.files).to_hex().to_string();
        if let Some(existing) = self.app.catalog().with_content(&content) {
            return Ok((existing.dataset, false));
        }
        let Self { app, folder, bytes, reservation, .. } = self;
        let limits = app.config().limits.clone();
        let job = {
            let app = app.clone();
            move || import(&app, &folder.0, &content, &main_file, bytes, &limits)
        };
        let stored = tokio::task::spawn_blocking(job)
            .await
            .map_err(|error| Fault::internal("reading an upload", &error))?;
        // The catalog counts the dataset from here on.
        drop(reservation);
        stored
    }
}

/// Reads the received folder and stores it. Blocks.
fn import(
    app: &Arc<App>,
    folder: &Path,
    content: &str,
    main_file: &str,
    bytes: u64,
    limits: &crate::config::Limits,
) -> Answer<(Dataset, bool)> {
    let files = files_of(folder);
    let slices = are_slices(&files);
    let is_folder = slices || is_series(&files);
    let path = if is_folder { folder.to_owned() } else { folder.join(main_file) };
    let read = volumes::read(&path, None, limits, &|_| {}).map_err(|error| {
        // The folder's name means nothing to the client.
        let own_name = folder.file_name().unwrap_or_default().to_string_lossy();
        Fault::unreadable_file(error.to_string().replace(own_name.as_ref(), "The upload"))
    })?;
    if read.format == formats::Format::Dicom {
        return series::import(app, &path, content, bytes, read);
    }
    let prepared = scene::PreparedVolume::new(read.volume, &|_| {});
    let name = if slices { slices_name(main_file) } else { display_name(main_file) };
    let mut dataset = super::describe(&prepared, "", name, read.format.name());
    dataset.voxel_type = read.file_type;
    dataset.bytes = bytes;
    dataset.notices = read.notices;
    dataset.choices = choices(read.choices, read.choice_names);
    dataset.created_unix_millis = crate::unix_millis();
    let mut manifest = Manifest::new(content.to_owned(), main_file.to_owned(), dataset);
    manifest.slices = slices;
    let (dataset, new) = app.catalog().store(folder, manifest)?;
    app.volumes().offer(volumes::Key::dataset(&dataset.id), prepared);
    Ok((dataset, new))
}

fn files_of(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder)
        .map(|entries| entries.filter_map(|entry| Some(entry.ok()?.path())).collect())
        .unwrap_or_default()
}

/// Whether several files were received of which one is DICOM.
fn is_series(files: &[PathBuf]) -> bool {
    files.len() > 1 && files.iter().any(|path| formats::is_dicom(path))
}

/// Whether several files were received, all of them pictures by their names: slices of one volume.
fn are_slices(files: &[PathBuf]) -> bool {
    let is_picture = |path: &PathBuf| {
        let name = path.to_string_lossy().to_lowercase();
        SLICE_ENDINGS.iter().any(|end| name.ends_with(end))
    };
    files.len() > 1 && files.iter().all(is_picture)
}

/// Names of the volumes to choose from; numbers where the file has no names for them.
fn choices(count: u64, names: Vec<String>) -> Vec<String> {
    match count {
        0..=1 => Vec::new(),
        _ if !names.is_empty() => names,
        _ => (1..=count.min(MAX_LISTED_CHOICES)).map(|number| format!("{number} of {count}")).collect(),
    }
}

/// BLAKE3 of an upload: of its only file, or of the names and hashes of its files.
fn content_hash(files: &BTreeMap<String, blake3::Hash>) -> blake3::Hash {
    if files.len() == 1
        && let Some(hash) = files.values().next()
    {
        return *hash;
    }
    let mut hasher = blake3::Hasher::new();
    for (name, hash) in files {
        hasher.update(&(name.len() as u64).to_le_bytes());
        hasher.update(name.as_bytes());
        hasher.update(hash.as_bytes());
    }
    hasher.finalize()
}

/// A client's file name as a plain name: the last component, without control characters, leading
/// dots or anything a shell, URL or file system could take for more than a name.
pub fn plain_name(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let safe = |c: char| {
        if c.is_alphanumeric() || "._-+() ".contains(c) { c } else { '_' }
    };
    let name: String = last.trim().trim_start_matches('.').chars().map(safe).collect();
    // The end is kept: readers look at it.
    let surplus = name.chars().count().saturating_sub(MAX_NAME_CHARS);
    let name: String = name.chars().skip(surplus).collect();
    let name = name.trim_start_matches(['.', ' ']);
    if name.is_empty() { "upload".into() } else { name.into() }
}

/// The file a reader opens: a header before attached files before raw data; JSON describes.
fn main_file<'n>(names: impl Iterator<Item = &'n String>) -> Option<String> {
    let rank = |name: &&String| {
        let lower = name.to_lowercase();
        const FIRST: [&str; 8] = [".nhdr", ".hdr", ".mhd", ".mha", ".nrrd", ".nii", ".nii.gz", ""];
        FIRST.iter().position(|end| lower.ends_with(end))
    };
    let mut names: Vec<&String> = names.filter(|name| !name.to_lowercase().ends_with(".json")).collect();
    names.sort_by_key(rank);
    names.first().map(|&name| name.clone())
}

/// A file name without its endings.
fn display_name(file: &str) -> &str {
    let stem = [".gz", ".zip", ".zarr"].iter().fold(file, |stem, end| stem.strip_suffix(end).unwrap_or(stem));
    match stem.rsplit_once('.') {
        Some((name, _)) if !name.is_empty() => name,
        _ => stem,
    }
}

/// What the names of slices begin with, or the first slice's name where they only count.
fn slices_name(first: &str) -> &str {
    let name = display_name(first);
    let common =
        name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches(['_', '-', '.', ' ', '(']);
    if common.is_empty() { name } else { common }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_plain() {
        for (given, expected) in [
            ("engine.nrrd", "engine.nrrd"),
            ("../../etc/passwd", "passwd"),
            ("C:\\scans\\head (1).nii.gz", "head (1).nii.gz"),
            ("..", "upload"),
            ("", "upload"),
            (".hidden", "hidden"),
            ("a\0b\n;c.raw", "a_b__c.raw"),
            ("Schädel.nrrd", "Schädel.nrrd"),
        ] {
            assert_eq!(plain_name(given), expected, "{given:?}");
        }
        let long = format!("{}.nrrd", "x".repeat(500));
        assert_eq!(plain_name(&long).chars().count(), MAX_NAME_CHARS);
        assert!(plain_name(&long).ends_with(".nrrd"));
    }

    #[test]
    fn the_header_is_the_main_file() {
        let names = |list: &[&str]| list.iter().map(|&n| n.to_owned()).collect::<Vec<_>>();
        let main = |list: &[&str]| main_file(names(list).iter());
        assert_eq!(main(&["a.raw", "a.nhdr"]).unwrap(), "a.nhdr");
        assert_eq!(main(&["a.img", "a.hdr"]).unwrap(), "a.hdr");
        assert_eq!(main(&["a.raw", "b.mhd"]).unwrap(), "b.mhd");
        assert_eq!(main(&["a.json", "a.raw"]).unwrap(), "a.raw");
        assert_eq!(main(&["a.json"]), None);
        assert_eq!(main(&[]), None);
    }

    #[test]
    fn equal_uploads_have_equal_hashes() {
        let files = |list: &[(&str, &str)]| {
            list.iter()
                .map(|(n, c)| ((*n).to_owned(), blake3::hash(c.as_bytes())))
                .collect::<BTreeMap<_, _>>()
        };
        let one = content_hash(&files(&[("a.nrrd", "1")]));
        assert_eq!(one, content_hash(&files(&[("b.nrrd", "1")])), "the name of a single file says nothing");
        assert_ne!(one, content_hash(&files(&[("a.nrrd", "1"), ("b.raw", "2")])));
        assert_ne!(
            content_hash(&files(&[("a", "1"), ("b", "2")])),
            content_hash(&files(&[("a", "2"), ("b", "1")]))
        );
    }

    #[test]
    fn names_for_people_have_no_endings() {
        assert_eq!(display_name("head.nii.gz"), "head");
        assert_eq!(display_name("head.v2.nrrd"), "head.v2");
        assert_eq!(display_name("head.ome.zarr.zip"), "head");
        assert_eq!(display_name("head"), "head");
        assert_eq!(slices_name("head_0001.tif"), "head");
        assert_eq!(slices_name("0001.tif"), "0001");
    }
}
