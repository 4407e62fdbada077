//! Binary frames: a fixed little-endian header, then the encoded picture.
//!
//! The layout is stated once, in [`header!`]; the Rust codec, the byte offsets and the web
//! client's decoder are all derived from it.

/// First four bytes of a frame, `TYF1` in little-endian order.
pub const FRAME_MAGIC: u32 = u32::from_le_bytes(*b"TYF1");

/// Encoding of the payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum FrameFormat {
    /// JPEG, while moving or refining.
    Jpeg = 1,
    /// Lossless WebP, at rest.
    WebpLossless = 2,
}

/// Flag: input is still arriving; the picture is reduced in resolution or quality.
pub const FLAG_MOVING: u8 = 1;
/// Flag: the final picture of its snapshot: full resolution, all samples, lossless.
pub const FLAG_FINAL: u8 = 2;

/// Size of a header field type in bytes.
macro_rules! field_bytes {
    (u8) => {
        1
    };
    (u16) => {
        2
    };
    (u32) => {
        4
    };
    (f32) => {
        4
    };
}

macro_rules! header {
    ($($(#[$doc:meta])* $name:ident: $kind:tt),+ $(,)?) => {
        /// Header of a frame. Fields stand in this order, little-endian, without padding.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[allow(missing_docs)]
        pub struct FrameHeader { $($(#[$doc])* pub $name: $kind),+ }

        /// Bytes before the payload.
        pub const FRAME_HEADER_BYTES: usize = 0 $(+ field_bytes!($kind))+;

        /// Name, type and size in bytes of each field, in order.
        pub const FRAME_FIELDS: &[(&str, &str, usize)] =
            &[$((stringify!($name), stringify!($kind), field_bytes!($kind))),+];

        impl FrameHeader {
            /// The header's bytes.
            pub fn encode(&self) -> [u8; FRAME_HEADER_BYTES] {
                let mut bytes = Vec::with_capacity(FRAME_HEADER_BYTES);
                $(bytes.extend_from_slice(&self.$name.to_le_bytes());)+
                let mut array = [0; FRAME_HEADER_BYTES];
                array.copy_from_slice(&bytes);
                array
            }

            /// Reads a header; `None` if the bytes are too few or not a frame.
            pub fn decode(bytes: &[u8]) -> Option<Self> {
                let mut rest = bytes.get(..FRAME_HEADER_BYTES)?;
                $(
                    let (head, tail) = rest.split_at(field_bytes!($kind));
                    let $name = <$kind>::from_le_bytes(head.try_into().ok()?);
                    rest = tail;
                )+
                let _ = rest;
                let header = Self { $($name),+ };
                (header.magic == FRAME_MAGIC && usize::from(header.header_bytes) == FRAME_HEADER_BYTES)
                    .then_some(header)
            }
        }
    };
}

header! {
    /// [`FRAME_MAGIC`].
    magic: u32,
    /// [`FRAME_HEADER_BYTES`].
    header_bytes: u16,
    /// A [`FrameFormat`].
    format: u8,
    /// [`FLAG_MOVING`], [`FLAG_FINAL`].
    flags: u8,
    /// Number of this frame within its connection, ascending from 1.
    frame: u32,
    /// Newest input of this viewer that the picture shows.
    seq: u32,
    /// Epoch of the snapshot shown.
    snapshot_epoch: u32,
    /// Epoch the lighting was computed for.
    illumination_epoch: u32,
    /// Share of the lighting that is up to date, 0..1.
    illumination_completeness: f32,
    /// Accumulated samples per pixel.
    samples_per_pixel: u32,
    /// Estimated relative error of the picture; NaN where unknown.
    error_estimate: f32,
    /// Pixels of the payload.
    width: u16,
    /// Pixels of the payload.
    height: u16,
    /// Pixels of the viewport the payload is to be stretched to.
    viewport_width: u16,
    /// Pixels of the viewport the payload is to be stretched to.
    viewport_height: u16,
    /// JPEG quality 1..100; 0 for lossless.
    quality: u32,
    /// From the arrival of the newest shown input to the start of its rendering, microseconds.
    queue_micros: u32,
    /// Rendering, read-back included, microseconds.
    render_micros: u32,
    /// Encoding, microseconds.
    encode_micros: u32,
    /// Bytes that follow the header.
    payload_bytes: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trips_and_refuses_foreign_bytes() {
        let header = FrameHeader {
            magic: FRAME_MAGIC,
            header_bytes: FRAME_HEADER_BYTES as u16,
            format: FrameFormat::Jpeg as u8,
            flags: FLAG_MOVING,
            frame: 7,
            seq: 9,
            snapshot_epoch: 3,
            illumination_epoch: 2,
            illumination_completeness: 0.5,
            samples_per_pixel: 4,
            error_estimate: 0.01,
            width: 640,
            height: 360,
            viewport_width: 1280,
            viewport_height: 720,
            quality: 85,
            queue_micros: 1,
            render_micros: 2,
            encode_micros: 3,
            payload_bytes: 1000,
        };
        let bytes = header.encode();
        assert_eq!(FrameHeader::decode(&bytes), Some(header));
        assert_eq!(FrameHeader::decode(&bytes[1..]), None, "too few bytes");
        let mut foreign = bytes;
        foreign[0] ^= 1;
        assert_eq!(FrameHeader::decode(&foreign), None, "wrong magic");
    }
}
