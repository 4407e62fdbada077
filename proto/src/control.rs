//! Control messages: JSON text frames of a viewer's WebSocket (`/api/v1/sessions/{id}/view`).
//!
//! The client numbers its inputs (`seq`, ascending). The server applies the newest state only;
//! a frame's header carries the newest `seq` it shows. Binary messages are frames, see
//! [`crate::frame`].

use serde::{Deserialize, Serialize};
use ts_rs::TS;
use utoipa::ToSchema;

use crate::plan::FrameReport;
use crate::rest::{DeviceInfo, ShownVolume};
use crate::scene_file::{Camera, SceneFile};

/// Version of the control protocol; the first message of either side carries it.
pub const PROTOCOL_VERSION: u32 = 1;

/// What a viewer, or whoever knows an address of a session, may do there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, TS, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Everything.
    Editor,
    /// Look from anywhere; the scene stays as its editors make it.
    Watcher,
}

/// What a viewer sends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum ClientMessage {
    /// First message.
    Hello {
        /// [`PROTOCOL_VERSION`].
        protocol: u32,
        /// `resume` of the connection that was lost: goes on with that viewer, whose picture is kept
        /// for a time.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[ts(optional)]
        resume: Option<String>,
    },
    /// A JSON merge patch (RFC 7396) on the session's scene; arrays are replaced whole.
    Patch {
        /// Number of this input.
        seq: u32,
        /// The patch. `camera` in it moves this viewer's camera and the session's.
        #[ts(type = "Record<string, unknown>")]
        #[schema(value_type = Object)]
        patch: serde_json::Value,
    },
    /// Moves this viewer's camera.
    Camera {
        /// Number of this input.
        seq: u32,
        /// The new view.
        camera: Camera,
    },
    /// Size of the viewport.
    Viewport {
        /// Number of this input.
        seq: u32,
        /// CSS pixels.
        width: u32,
        /// CSS pixels.
        height: u32,
        /// Device pixels per CSS pixel, 0.25..4.
        pixel_ratio: f64,
    },
    /// A frame was decoded and shown (or superseded before it was shown).
    Ack {
        /// Number of the frame, from its header.
        frame: u32,
        /// Time to decode, milliseconds.
        decode_millis: f64,
    },
    /// Whether the page can be seen; a hidden viewer gets no frames.
    Visible {
        /// New state.
        visible: bool,
    },
}

/// What the server sends as text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, TS, ToSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ServerMessage {
    /// Answer to `hello`.
    Welcome {
        /// [`PROTOCOL_VERSION`].
        protocol: u32,
        /// Session identifier.
        session: String,
        /// This viewer's number within the session.
        viewer: u32,
        /// What this viewer may do.
        role: Role,
        /// To be said in the next `hello` should this connection be lost. It takes this viewer over:
        /// nobody else may know it.
        resume: String,
        /// Epoch of the scene that follows.
        epoch: u32,
        /// The session's scene, camera filled in.
        scene: Box<SceneFile>,
        /// What the scene's volume is.
        dataset: Option<Box<crate::rest::Dataset>>,
        /// What is shown of the volume; absent: the whole of it at full resolution.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[ts(optional)]
        shown: Option<Box<ShownVolume>>,
        /// What renders.
        device: DeviceInfo,
    },
    /// The scene changed (by this viewer, another one, or REST).
    Scene {
        /// New epoch.
        epoch: u32,
        /// Newest input of *this* viewer that is part of it.
        seq: u32,
        /// The whole scene.
        scene: Box<SceneFile>,
        /// What is shown of its volume; absent: the whole of it at full resolution.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[ts(optional)]
        shown: Option<Box<ShownVolume>>,
    },
    /// An input was refused; the scene is unchanged.
    Rejected {
        /// The refused input.
        seq: u32,
        /// Field path, empty if the message as a whole is at fault.
        field: String,
        /// In words.
        message: String,
    },
    /// What a frame cost; follows the binary frame of the same number.
    Report {
        /// Number of the frame, or the newest frame where nothing had to be sent.
        frame: u32,
        /// Plan, counters, stage times.
        report: Box<FrameReport>,
    },
    /// Loading or another long step is under way; the last frame stays valid.
    Progress {
        /// What is being done, for people.
        activity: String,
        /// 0..1, negative where unknown.
        fraction: f64,
    },
    /// Something failed on the server while drawing; the connection stays open.
    Failed {
        /// In words, with what to do.
        message: String,
    },
    /// The server is going away.
    Closing {
        /// Why.
        reason: String,
    },
}
