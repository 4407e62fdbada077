//! From pixels to frames (stills are `render::still`). Everything here computes; call it where blocking is allowed.

use image::{ExtendedColorType, ImageEncoder};
use proto::frame::{FRAME_HEADER_BYTES, FrameFormat};
use render::Picture;
use turbojpeg::{Compressor, Image, PixelFormat, Subsamp};

use crate::render_thread::{Encoding, FinishedFrame};

/// JPEG quality of refining pictures.
const REFINING_QUALITY: u8 = 92;
/// Bytes of a picture's pixel.
const RGBA_BYTES: usize = 4;

/// Encoding failed; with the sizes checked before, only for lack of memory.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// JPEG.
    #[error("JPEG: {0}")]
    Jpeg(#[from] turbojpeg::Error),
    /// The other formats.
    #[error("{0}")]
    Image(#[from] image::ImageError),
}

/// A frame as it travels: header, then payload.
///
/// # Errors
/// The encoder's.
pub fn frame(finished: &FinishedFrame) -> Result<Vec<u8>, EncodeError> {
    let began = std::time::Instant::now();
    let picture = &finished.picture;
    let (format, quality, payload) = match finished.encoding {
        Encoding::Moving(quality) => (FrameFormat::Jpeg, quality, jpeg(picture, quality, Subsamp::Sub2x2)?),
        Encoding::Refining => {
            (FrameFormat::Jpeg, REFINING_QUALITY, jpeg(picture, REFINING_QUALITY, Subsamp::None)?)
        }
        Encoding::Lossless => (FrameFormat::WebpLossless, 0, webp(picture)?),
    };
    let mut header = finished.header;
    header.format = format as u8;
    header.quality = u32::from(quality);
    header.encode_micros = u32::try_from(began.elapsed().as_micros()).unwrap_or(u32::MAX);
    header.payload_bytes = u32::try_from(payload.len()).unwrap_or(u32::MAX);
    let mut bytes = Vec::with_capacity(FRAME_HEADER_BYTES + payload.len());
    bytes.extend_from_slice(&header.encode());
    bytes.extend_from_slice(&payload);
    Ok(bytes)
}

fn jpeg(picture: &Picture, quality: u8, subsampling: Subsamp) -> Result<Vec<u8>, EncodeError> {
    let mut compressor = Compressor::new()?;
    compressor.set_quality(i32::from(quality))?;
    compressor.set_subsamp(subsampling)?;
    let image = Image {
        pixels: picture.rgba.as_slice(),
        width: picture.width as usize,
        pitch: picture.width as usize * RGBA_BYTES,
        height: picture.height as usize,
        format: PixelFormat::RGBX,
    };
    Ok(compressor.compress_to_vec(image)?)
}

fn webp(picture: &Picture) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    image::codecs::webp::WebPEncoder::new_lossless(&mut bytes).write_image(
        &picture.rgb(),
        picture.width,
        picture.height,
        ExtendedColorType::Rgb8,
    )?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::frame::{FRAME_MAGIC, FrameHeader};

    /// A noisy picture with odd edges: the hardest case for a lossless claim.
    fn picture() -> Picture {
        let mut state = 7u32;
        let mut byte = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let rgba = (0..37 * 23).flat_map(|_| [byte(), byte(), byte(), 255]).collect();
        Picture { width: 37, height: 23, rgba }
    }

    fn finished(encoding: Encoding) -> FinishedFrame {
        let header = FrameHeader {
            magic: FRAME_MAGIC,
            header_bytes: FRAME_HEADER_BYTES as u16,
            format: 0,
            flags: 0,
            frame: 1,
            seq: 1,
            snapshot_epoch: 1,
            illumination_epoch: 1,
            illumination_completeness: 1.0,
            samples_per_pixel: 1,
            error_estimate: 0.0,
            width: 37,
            height: 23,
            viewport_width: 37,
            viewport_height: 23,
            quality: 0,
            queue_micros: 0,
            render_micros: 0,
            encode_micros: 0,
            payload_bytes: 0,
        };
        FinishedFrame { picture: picture(), encoding, header, report: Default::default() }
    }

    fn decoded(encoding: Encoding) -> (FrameHeader, Vec<u8>) {
        let bytes = frame(&finished(encoding)).unwrap();
        let header = FrameHeader::decode(&bytes).unwrap();
        assert_eq!(bytes.len(), FRAME_HEADER_BYTES + header.payload_bytes as usize);
        let image = image::load_from_memory(&bytes[FRAME_HEADER_BYTES..]).unwrap().to_rgb8();
        assert_eq!((image.width(), image.height()), (37, 23));
        (header, image.into_raw())
    }

    #[test]
    fn the_lossless_frame_and_png_are_exact_and_jpeg_is_not() {
        let exact = picture().rgb();
        let (header, pixels) = decoded(Encoding::Lossless);
        assert_eq!((header.format, header.quality), (FrameFormat::WebpLossless as u8, 0));
        assert_eq!(pixels, exact);
        let png =
            image::load_from_memory(&render::still::png(&picture()).unwrap()).unwrap().to_rgb8().into_raw();
        assert_eq!(png, exact);
        let (header, pixels) = decoded(Encoding::Moving(60));
        assert_eq!((header.format, header.quality), (FrameFormat::Jpeg as u8, 60));
        assert_ne!(pixels, exact, "the comparison can fail");
    }

    #[test]
    fn refining_frames_keep_color_resolution() {
        // One-pixel stripes of saturated colours: 4:2:0 smears them, 4:4:4 does not.
        let rgba =
            (0..64 * 64).flat_map(|i| if i % 2 == 0 { [200, 40, 40, 255] } else { [40, 40, 200, 255] });
        let stripes = Picture { width: 64, height: 64, rgba: rgba.collect() };
        let worst = |encoding| {
            let mut frame_of = finished(encoding);
            frame_of.picture = stripes.clone();
            let bytes = frame(&frame_of).unwrap();
            let image = image::load_from_memory(&bytes[FRAME_HEADER_BYTES..]).unwrap().to_rgb8();
            let pairs = image.into_raw().into_iter().zip(stripes.rgb());
            pairs.map(|(a, b)| a.abs_diff(b)).max().unwrap()
        };
        assert!(worst(Encoding::Refining) < 25, "{}", worst(Encoding::Refining));
        assert!(worst(Encoding::Moving(85)) > 50);
    }
}
