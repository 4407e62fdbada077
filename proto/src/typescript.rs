//! The web client's types, generated from this crate.
//!
//! `cargo run --release -p proto --example web_types` writes them; a test fails while the
//! committed file differs.

use std::fmt::Write as _;

use ts_rs::{Config, TS};

use crate::{control, frame, plan, rest, scene_file};

/// Where the web client keeps the generated file, relative to the repository's root.
pub const GENERATED_FILE: &str = "web/src/generated/proto.ts";

/// The whole generated file.
pub fn typescript() -> String {
    let config = Config::default();
    let mut text = String::from(
        "// Generated from the Rust crate `proto`; do not edit. `make web-types` rewrites it.\n\n",
    );
    macro_rules! declare {
        ($($kind:ty),+ $(,)?) => {
            $(let _ = writeln!(text, "export {}\n", <$kind as TS>::decl(&config));)+
        };
    }
    declare!(
        scene_file::SceneFile,
        scene_file::VolumeSource,
        scene_file::Filter,
        scene_file::Builtin,
        scene_file::VoxelType,
        scene_file::Endian,
        scene_file::TransferFunction,
        scene_file::TransferFunctionPoint,
        scene_file::Material,
        scene_file::Phase,
        scene_file::HenyeyGreenstein,
        scene_file::Schlick,
        scene_file::Brdf,
        scene_file::Lambert,
        scene_file::BlinnPhong,
        scene_file::AshikhminShirley,
        scene_file::Abc,
        scene_file::Light,
        scene_file::DirectionalLight,
        scene_file::PointLight,
        scene_file::SpotLight,
        scene_file::RectangleLight,
        scene_file::DiskLight,
        scene_file::SphereLight,
        scene_file::EnvironmentLight,
        scene_file::Camera,
        scene_file::Clip,
        scene_file::ClipPlane,
        scene_file::Background,
        scene_file::Scattering,
        scene_file::Orders,
        scene_file::Illumination,
        scene_file::LightGather,
        scene_file::LightTransport,
        scene_file::Diffusion,
        scene_file::Method,
        scene_file::RecordForm,
        scene_file::RecordLookup,
        scene_file::Sampling,
        scene_file::Interpolation,
        scene_file::Rendering,
        scene_file::RenderingMode,
        scene_file::SlicePlane,
        scene_file::Film,
        scene_file::ToneMapping,
        scene_file::ImageSize,
        plan::PassReport,
        plan::StageTime,
        plan::StaleShares,
        plan::FrameReport,
        rest::Problem,
        rest::DeviceInfo,
        rest::Status,
        rest::Dataset,
        rest::Environment,
        rest::UploadState,
        rest::Upload,
        rest::ShownVolume,
        rest::Histogram,
        rest::RegionHistogram,
        rest::PreviewRequest,
        rest::ExportFormat,
        rest::CameraKey,
        rest::ExportRequest,
        rest::ExportState,
        rest::Export,
        rest::CreateSession,
        rest::ProbeRequest,
        rest::Probe,
        rest::ProbeHit,
        rest::Session,
        control::Role,
        control::ClientMessage,
        control::ServerMessage,
    );
    let limits = scene_file_limits();
    let _ = write!(text, "{limits}\n{}", frame_decoder());
    text
}

fn scene_file_limits() -> String {
    use scene_file::limits::*;
    format!(
        "export const PROTOCOL_VERSION = {};\nexport const SCENE_VERSION = {};\n\
         export const MAX_TRANSFER_FUNCTION_POINTS = {MAX_TRANSFER_FUNCTION_POINTS};\n\
         export const MAX_LIGHTS = {MAX_LIGHTS};\nexport const MAX_CLIP_PLANES = {MAX_CLIP_PLANES};\n\
         export const MAX_OPACITY = {MAX_OPACITY};\nexport const OPACITY_LENGTH = {OPACITY_LENGTH};\n",
        control::PROTOCOL_VERSION,
        scene_file::SCENE_VERSION,
    )
}

fn frame_decoder() -> String {
    let mut fields = String::new();
    let mut reads = String::new();
    let mut offset = 0;
    for (name, kind, bytes) in frame::FRAME_FIELDS {
        let _ = writeln!(fields, "  {name}: number;");
        let getter = match *kind {
            "u8" => "getUint8",
            "u16" => "getUint16",
            "u32" => "getUint32",
            _ => "getFloat32",
        };
        let endian = if *bytes == 1 { "" } else { ", true" };
        let _ = writeln!(reads, "    {name}: view.{getter}({offset}{endian}),");
        offset += bytes;
    }
    format!(
        "export const FRAME_MAGIC = {};\nexport const FRAME_HEADER_BYTES = {};\n\
         export const FLAG_MOVING = {};\nexport const FLAG_FINAL = {};\n\
         export const FORMAT_JPEG = {};\nexport const FORMAT_WEBP_LOSSLESS = {};\n\n\
         export interface FrameHeader {{\n{fields}}}\n\n\
         /** Reads a frame's header; null if the bytes are not a frame. */\n\
         export function decodeFrameHeader(buffer: ArrayBuffer): FrameHeader | null {{\n\
         \x20 if (buffer.byteLength < FRAME_HEADER_BYTES) return null;\n\
         \x20 const view = new DataView(buffer);\n\
         \x20 const header: FrameHeader = {{\n{reads}  }};\n\
         \x20 return header.magic === FRAME_MAGIC && header.header_bytes === FRAME_HEADER_BYTES ? header : null;\n}}\n",
        frame::FRAME_MAGIC,
        frame::FRAME_HEADER_BYTES,
        frame::FLAG_MOVING,
        frame::FLAG_FINAL,
        frame::FrameFormat::Jpeg as u8,
        frame::FrameFormat::WebpLossless as u8,
    )
}
