//! What a frame did and did not do, for `--explain`, `--stats` and the statistics panel.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use ts_rs::TS;
use utoipa::ToSchema;

/// One pass of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
pub struct PassReport {
    /// Name of the pass, equal to the shader file where there is one.
    pub pass: String,
    /// Whether it runs.
    pub runs: bool,
    /// Why it runs, or why it does not.
    pub reason: String,
    /// Amount of work, in `unit`.
    #[ts(type = "number")]
    pub work: u64,
    /// Unit of `work`: `voxels`, `cells`, `pixels`, `points`, `lights`.
    pub unit: String,
}

/// Time of one stage of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall time, handing work over and waiting included, milliseconds.
    pub millis: f64,
    /// Time of the device at work, by its own clock, milliseconds; absent where it has none, and for
    /// stages that are not its work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_millis: Option<f64>,
}

impl StageTime {
    /// Adds it to what is known of its stage. The device's time is known where it is of both.
    pub fn add_to(self, stages: &mut Vec<Self>) {
        match stages.iter_mut().find(|known| known.stage == self.stage) {
            Some(known) => {
                known.millis += self.millis;
                known.device_millis = known.device_millis.zip(self.device_millis).map(|(a, b)| a + b);
            }
            None => stages.push(self),
        }
    }
}

/// What an edit of each scalar bin would make stale of what is kept now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
pub struct StaleShares {
    /// What is counted: `photons` or `tiles`.
    pub what: String,
    /// How many were counted: all of them, or of many the first ones of each light.
    #[ts(type = "number")]
    pub counted: u64,
    /// Of each of the 64 bins, in the order of their values, the share that relied on it, 0..1.
    pub of_bins: Vec<f32>,
}

/// The plan of a frame and what it cost.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, TS, ToSchema)]
#[ts(optional_fields)]
pub struct FrameReport {
    /// What changed since the picture before, in words; empty if nothing.
    pub changes: Vec<String>,
    /// Every pass, run or skipped.
    pub plan: Vec<PassReport>,
    /// Stage times in order.
    pub stages: Vec<StageTime>,
    /// Exact work counters, for example `samples_taken`, `samples_skipped`.
    #[ts(type = "Record<string, number>")]
    pub counters: BTreeMap<String, u64>,
    /// GPU memory in use, bytes, by owner.
    #[ts(type = "Record<string, number>")]
    pub gpu_bytes: BTreeMap<String, u64>,
    /// What edits would make stale; with final pictures of methods that keep it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stale_shares: Option<StaleShares>,
}
