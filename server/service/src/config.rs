//! Settings: flags over environment over TOML file over defaults.
//!
//! Every setting has one name, its path in the TOML file (`limits.max_sessions`); the environment
//! variable is derived from it (`TYNDALL_LIMITS_MAX_SESSIONS`). Lists are separated by commas in
//! flags and environment. Unknown names in the file or in flags are errors.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// Prefix of environment variables.
const ENVIRONMENT_PREFIX: &str = "TYNDALL_";
/// Port where nothing else is said.
const DEFAULT_PORT: u16 = 8080;

/// Settings of the service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Address to listen on; loopback unless asked otherwise.
    pub listen: SocketAddr,
    /// Directory that keeps datasets; made if absent.
    pub data: PathBuf,
    /// Origins (`https://example.org`) besides the service's own whose pages may use it. On a
    /// loopback address, their hosts are also accepted as `Host`, as a reverse proxy needs.
    pub allowed_origins: Vec<String>,
    /// Refuses to start on a software device.
    pub hardware_only: bool,
    /// A session without viewers leaves memory after this time, seconds; it comes back from disk when
    /// it is asked for.
    pub session_idle_seconds: u64,
    /// A session that nobody uses is deleted after this time, days.
    pub session_keep_days: u64,
    /// A viewer whose connection was lost finds its picture again within this time, seconds.
    pub viewer_keep_seconds: u64,
    /// A resumable upload that receives nothing is removed after this time, and so is what is known
    /// of one that ended, seconds.
    pub upload_idle_seconds: u64,
    /// An export is kept for this time after it is done, seconds.
    pub export_keep_seconds: u64,
    /// Longest wait for viewers and requests when the service stops, seconds.
    pub shutdown_seconds: u64,
    /// Precomputed light under way is written to disk about this often, seconds; after a crash it goes on
    /// from there.
    pub bake_checkpoint_seconds: u64,
    /// What one service instance takes on.
    pub limits: Limits,
}

/// Bounds on everything a stranger can make grow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Largest upload, bytes, all its files together.
    pub max_upload_bytes: u64,
    /// Most files of one upload.
    pub max_upload_files: usize,
    /// Most uploads being received or read at once; the others get 503.
    pub max_uploads: usize,
    /// Most resumable uploads that are not finished; beyond it 503.
    pub max_unfinished_uploads: usize,
    /// Most bytes of all resumable uploads that are not finished, as long as they will be; beyond it
    /// 507. They count as stored bytes, too.
    pub max_unfinished_bytes: u64,
    /// Largest JSON body, bytes.
    pub max_json_bytes: usize,
    /// Most stored datasets.
    pub max_datasets: usize,
    /// Most uploaded environments; beyond it 507.
    pub max_environments: usize,
    /// Largest uploaded environment, bytes.
    pub max_environment_bytes: usize,
    /// Most bytes of all stored datasets; beyond it uploads get 507.
    pub max_storage_bytes: u64,
    /// Most bytes of all stored precomputed light; what was not used for longest is removed. 0: none is
    /// stored.
    pub max_bake_bytes: u64,
    /// Largest volume in memory, bytes of its voxels.
    pub max_voxel_bytes: u64,
    /// Largest computed volume, voxels; computing one takes the processors for seconds.
    pub max_builtin_voxels: u64,
    /// Memory for volumes of all sessions, bytes of their voxels; beyond it loading gets 503.
    pub max_volume_memory_bytes: u64,
    /// Largest volume on the GPU, bytes of its texels. Larger ones are shown at a coarser level; so
    /// are those that the device has no room for, whatever is allowed here.
    pub max_texture_bytes: u64,
    /// Memory of the GPU for all sessions together, bytes: volumes, pictures and what is kept to draw
    /// them sooner. Beyond it what was not used for longest is dropped and made again when it is
    /// needed, volumes are shown coarser, and what cannot fit gets 503.
    pub max_gpu_bytes: u64,
    /// Most volumes being loaded at once.
    pub max_loads: usize,
    /// Most sessions in memory; where all of them have viewers, 503.
    pub max_sessions: usize,
    /// Most sessions on disk besides; the least recently used is deleted.
    pub max_stored_sessions: usize,
    /// Most viewers of all sessions.
    pub max_viewers: usize,
    /// Largest message of a viewer, bytes.
    pub max_message_bytes: usize,
    /// Most requests being answered at once; the others get 503.
    pub max_requests: usize,
    /// Most stills waiting to be drawn; beyond it 503.
    pub max_waiting_stills: usize,
    /// Longest time a still may take, waiting included, seconds; beyond it 504.
    pub still_seconds: u64,
    /// Most exports, under way and done; beyond it 503.
    pub max_exports: usize,
    /// Most bytes of the files of all exports; one that would exceed it fails.
    pub max_export_bytes: u64,
    /// Longest time an export may be drawn, waiting for its turn not counted, seconds.
    pub export_seconds: u64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, DEFAULT_PORT)),
            data: PathBuf::from("data"),
            allowed_origins: Vec::new(),
            hardware_only: false,
            session_idle_seconds: 30 * 60,
            session_keep_days: 30,
            viewer_keep_seconds: 120,
            upload_idle_seconds: 24 * 60 * 60,
            export_keep_seconds: 60 * 60,
            shutdown_seconds: 5,
            bake_checkpoint_seconds: 10,
            limits: Limits::default(),
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_upload_bytes: 2 << 30,
            max_upload_files: 4096,
            max_uploads: 4,
            max_unfinished_uploads: 64,
            max_unfinished_bytes: 16 << 30,
            max_json_bytes: 1 << 20,
            max_datasets: 1000,
            max_environments: 200,
            max_environment_bytes: 256 << 20,
            max_storage_bytes: 64 << 30,
            max_bake_bytes: render::DEFAULT_BAKE_BYTES,
            max_voxel_bytes: 4 << 30,
            max_builtin_voxels: 1 << 27,
            max_volume_memory_bytes: 8 << 30,
            max_texture_bytes: render::fit::DEFAULT_MAX_TEXTURE_BYTES,
            max_gpu_bytes: render::DEFAULT_GPU_BYTES,
            max_loads: 2,
            max_sessions: 64,
            max_stored_sessions: 1000,
            max_viewers: 64,
            max_message_bytes: 1 << 20,
            max_requests: 256,
            max_waiting_stills: 32,
            still_seconds: 120,
            max_exports: 16,
            max_export_bytes: 4 << 30,
            export_seconds: 4 * 60 * 60,
        }
    }
}

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the settings file {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not TOML.
    #[error("the settings file {path} is not TOML: {message}")]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where and why.
        message: String,
    },
    /// A setting has a wrong name or value.
    #[error("setting `{setting}`: {message}")]
    Setting {
        /// Path of the setting.
        setting: String,
        /// What is wrong.
        message: String,
    },
}

impl Config {
    /// Settings from a TOML file, the environment and flags, the later ones winning.
    ///
    /// `flags` are pairs of a setting's path and its value, `("limits.max_sessions", "8")`.
    ///
    /// # Errors
    /// A file that cannot be read, an unknown name, a value of the wrong type or out of range.
    pub fn load(
        file: Option<&Path>,
        environment: impl IntoIterator<Item = (String, String)>,
        flags: &[(String, String)],
    ) -> Result<Self, ConfigError> {
        let mut settings = file.map_or_else(|| Ok(Table::new()), read_table)?;
        let known = leaves();
        for (name, text) in environment {
            let setting = known.iter().find(|(path, _)| environment_name(path) == name);
            if let Some((path, example)) = setting {
                set(&mut settings, path, parse(path, example, &text)?);
            }
        }
        for (path, text) in flags {
            let Some((path, example)) = known.iter().find(|(known, _)| known == path) else {
                return Err(ConfigError::Setting {
                    setting: path.clone(),
                    message: "there is no such setting".into(),
                });
            };
            set(&mut settings, path, parse(path, example, text)?);
        }
        let config: Self = serde_path_to_error::deserialize(Value::Table(settings)).map_err(|error| {
            ConfigError::Setting {
                setting: error.path().to_string(),
                message: error.inner().to_string().trim().to_owned(),
            }
        })?;
        config.check()?;
        Ok(config)
    }

    /// Path and environment variable of every setting, with its default, for `--help` and docs.
    pub fn settings() -> Vec<(String, String, String)> {
        let describe = |(path, default): (String, Value)| {
            let variable = environment_name(&path);
            (path, variable, default.to_string())
        };
        leaves().into_iter().map(describe).collect()
    }

    /// Longest wait when the service stops.
    pub fn shutdown_bound(&self) -> Duration {
        Duration::from_secs(self.shutdown_seconds)
    }

    fn check(&self) -> Result<(), ConfigError> {
        let wrong =
            |setting: &str, message: String| Err(ConfigError::Setting { setting: setting.into(), message });
        for origin in &self.allowed_origins {
            if crate::origin::host_of_origin(origin).is_none() {
                return wrong(
                    "allowed_origins",
                    format!("`{origin}` is not an origin such as https://example.org"),
                );
            }
        }
        let limits = &self.limits;
        let counts = [
            ("limits.max_uploads", limits.max_uploads),
            ("limits.max_loads", limits.max_loads),
            ("limits.max_requests", limits.max_requests),
            ("limits.max_upload_files", limits.max_upload_files),
        ];
        for (setting, count) in counts {
            if count == 0 || count > MAX_COUNT {
                return wrong(setting, format!("must be from 1 to {MAX_COUNT}"));
            }
        }
        if !(1..=MAX_IDLE_SECONDS).contains(&self.upload_idle_seconds) {
            return wrong("upload_idle_seconds", format!("must be from 1 to {MAX_IDLE_SECONDS}"));
        }
        if limits.max_viewers > MAX_COUNT {
            return wrong("limits.max_viewers", format!("must be at most {MAX_COUNT}"));
        }
        Ok(())
    }
}

/// Longest life of an unfinished upload, seconds: a year.
const MAX_IDLE_SECONDS: u64 = 365 * 24 * 60 * 60;
/// Largest count of anything that runs at once.
const MAX_COUNT: usize = 65_536;

fn read_table(path: &Path) -> Result<Table, ConfigError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
    text.parse().map_err(|error| ConfigError::Syntax { path: path.into(), message: format!("{error}") })
}

/// Every setting's path with its default value.
fn leaves() -> Vec<(String, Value)> {
    fn walk(prefix: &str, table: &Table, found: &mut Vec<(String, Value)>) {
        for (key, value) in table {
            let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            match value {
                Value::Table(inner) => walk(&path, inner, found),
                leaf => found.push((path, leaf.clone())),
            }
        }
    }
    let mut found = Vec::new();
    if let Ok(defaults) = Table::try_from(Config::default()) {
        walk("", &defaults, &mut found);
    }
    found
}

fn environment_name(path: &str) -> String {
    format!("{ENVIRONMENT_PREFIX}{}", path.replace('.', "_").to_uppercase())
}

/// The text of a flag or variable, as the type the setting's default has.
fn parse(path: &str, example: &Value, text: &str) -> Result<Value, ConfigError> {
    let wrong = |expected: &str| ConfigError::Setting {
        setting: path.into(),
        message: format!("must be {expected}, got `{text}`"),
    };
    Ok(match example {
        Value::Integer(_) => Value::Integer(text.parse().map_err(|_| wrong("a whole number"))?),
        Value::Boolean(_) => Value::Boolean(text.parse().map_err(|_| wrong("true or false"))?),
        Value::Array(_) => Value::Array(
            text.split(',')
                .map(str::trim)
                .filter(|item| !item.is_empty())
                .map(|item| Value::String(item.into()))
                .collect(),
        ),
        _ => Value::String(text.into()),
    })
}

/// Puts a value at a dotted path; tables on the way are made.
fn set(table: &mut Table, path: &str, value: Value) {
    match path.split_once('.') {
        None => {
            table.insert(path.into(), value);
        }
        Some((head, rest)) => {
            let inner = table.entry(head).or_insert_with(|| Value::Table(Table::new()));
            if let Value::Table(inner) = inner {
                set(inner, rest, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(name: &str, value: &str) -> (String, String) {
        (name.into(), value.into())
    }

    fn load(toml: &str, environment: &[(&str, &str)], flags: &[(&str, &str)]) -> Result<Config, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tyndall.toml");
        std::fs::write(&path, toml).unwrap();
        let flags: Vec<_> = flags.iter().map(|(n, v)| pair(n, v)).collect();
        let environment = environment.iter().map(|(n, v)| pair(n, v));
        Config::load(Some(&path), environment, &flags).map_err(|error| error.to_string())
    }

    #[test]
    fn flags_beat_environment_beats_file_beats_defaults() {
        let toml = "listen = \"127.0.0.1:1\"\n[limits]\nmax_sessions = 1\nmax_viewers = 1\n";
        let config = load(
            toml,
            &[
                ("TYNDALL_LIMITS_MAX_SESSIONS", "2"),
                ("TYNDALL_LISTEN", "127.0.0.1:2"),
                ("TYNDALL_TEST_DATA", "x"),
            ],
            &[("listen", "127.0.0.1:3")],
        )
        .unwrap();
        assert_eq!(config.listen.port(), 3);
        assert_eq!(config.limits.max_sessions, 2);
        assert_eq!(config.limits.max_viewers, 1);
        assert_eq!(config.limits.max_datasets, Limits::default().max_datasets);
    }

    #[test]
    fn lists_and_switches_come_from_text() {
        let config = load(
            "",
            &[("TYNDALL_ALLOWED_ORIGINS", "https://a.org, http://b.org:81")],
            &[("hardware_only", "true")],
        )
        .unwrap();
        assert_eq!(config.allowed_origins, ["https://a.org", "http://b.org:81"]);
        assert!(config.hardware_only);
    }

    #[test]
    fn wrong_settings_are_named() {
        for (toml, flags, expected) in [
            ("colour = 1", vec![], "colour"),
            ("[limits]\nmax_cows = 1", vec![], "limits.max_cows"),
            ("[limits]\nmax_sessions = -1", vec![], "limits.max_sessions"),
            ("", vec![("limits.max_sessions", "many")], "limits.max_sessions"),
            ("", vec![("cows", "1")], "cows"),
            ("", vec![("listen", "nowhere")], "listen"),
            ("", vec![("allowed_origins", "example.org")], "allowed_origins"),
            ("", vec![("limits.max_uploads", "0")], "limits.max_uploads"),
            ("", vec![("upload_idle_seconds", "0")], "upload_idle_seconds"),
            ("listen = ", vec![], "not TOML"),
        ] {
            let error = load(toml, &[], &flags).unwrap_err();
            assert!(error.contains(expected), "`{toml}` {flags:?}: {error}");
        }
    }

    #[test]
    fn every_setting_has_one_variable() {
        let mut names: Vec<_> = Config::settings().into_iter().map(|(_, name, _)| name).collect();
        assert!(names.contains(&"TYNDALL_LIMITS_MAX_JSON_BYTES".to_owned()));
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
