//! Compressed frames to samples. RLE is ours (PS3.5, annex G: PackBits by byte planes); JPEG,
//! JPEG-LS and JPEG 2000 come from crates.
//!
//! A codestream states its own size. It is held against rows and columns before anything is
//! decoded, so that it cannot ask for more memory than the data set was allowed.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::header::Codec;

/// Decoded bytes per compressed byte that are believed; blank images compress best, below this.
const MAX_RATIO: u64 = 1000;
/// Decoded bytes of a frame that are believed in any case.
const ALWAYS_BELIEVED_BYTES: u64 = 16 << 20;
/// Bytes of an RLE frame's header: the number of segments and where each of fifteen begins.
const RLE_HEADER_BYTES: usize = 64;
const START_OF_CODESTREAM: [u8; 4] = [0xFF, 0x4F, 0xFF, 0x51];
/// Where a JPEG 2000 codestream states its number of components, and then the first one's depth
/// less one, with the highest bit set for signed samples (ISO/IEC 15444-1, A.5.1).
const COMPONENTS_AT: usize = 40;
const DEPTH_AT: usize = 42;

/// What a frame must decode to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) bits_allocated: u32,
}

impl Shape {
    fn samples(&self) -> usize {
        self.rows * self.columns
    }

    fn sample_bytes(&self) -> usize {
        self.bits_allocated as usize / 8
    }
}

/// Decodes a frame to one raw sample per pixel, of which the low bits count.
///
/// # Errors
/// In words: what is wrong with the frame.
pub(super) fn decode(codec: Codec, compressed: &[u8], shape: Shape) -> Result<Vec<u32>, String> {
    let decoded_bytes = (shape.samples() * shape.sample_bytes()) as u64;
    let believed = (compressed.len() as u64).saturating_mul(MAX_RATIO).max(ALWAYS_BELIEVED_BYTES);
    if decoded_bytes > believed {
        return Err(format!("{} bytes cannot hold {} pixels", compressed.len(), shape.samples()));
    }
    let decode = || match codec {
        Codec::Native => Err("it is not compressed".to_owned()),
        Codec::Rle => rle(compressed, shape),
        Codec::Jpeg => jpeg(compressed, shape),
        Codec::JpegLs => jpeg_ls(compressed, shape),
        Codec::Jpeg2000 => jpeg_2000(compressed, shape),
    };
    // The decoders of others index by what they have read; some damaged streams end in a panic
    // there. It stays with this frame: the decoders keep nothing between calls.
    let samples = catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err("the decoder gave up on damaged data".to_owned()))?;
    match samples.len() == shape.samples() {
        true => Ok(samples),
        false => Err(format!("it has {} pixels, not {}", samples.len(), shape.samples())),
    }
}

fn same_size(width: usize, height: usize, shape: Shape) -> Result<(), String> {
    match (width, height) == (shape.columns, shape.rows) {
        true => Ok(()),
        false => Err(format!("it is {width} x {height}, not {} x {}", shape.columns, shape.rows)),
    }
}

fn one_component(count: usize) -> Result<(), String> {
    if count == 1 { Ok(()) } else { Err(format!("it has {count} components, not 1")) }
}

/// Bytes of one or two per sample, the lower byte first.
fn from_bytes(bytes: &[u8], per_sample: usize) -> Vec<u32> {
    match per_sample {
        1 => bytes.iter().map(|byte| u32::from(*byte)).collect(),
        _ => bytes.as_chunks::<2>().0.iter().map(|pair| u32::from(u16::from_le_bytes(*pair))).collect(),
    }
}

fn rle(compressed: &[u8], shape: Shape) -> Result<Vec<u32>, String> {
    let header = compressed.get(..RLE_HEADER_BYTES).ok_or("its RLE header is cut short")?;
    let (words, _) = header.as_chunks::<4>();
    let segments = words.first().map_or(0, |word| u32::from_le_bytes(*word) as usize);
    if segments != shape.sample_bytes() {
        return Err(format!("it has {segments} RLE segments, not {}", shape.sample_bytes()));
    }
    let begin = |segment: usize| words.get(segment + 1).map(|word| u32::from_le_bytes(*word) as usize);
    let mut samples = vec![0_u32; shape.samples()];
    for segment in 0..segments {
        let end = if segment + 1 < segments { begin(segment + 1) } else { Some(compressed.len()) };
        let bytes = begin(segment)
            .zip(end)
            .filter(|(begin, _)| *begin >= RLE_HEADER_BYTES)
            .and_then(|(begin, end)| compressed.get(begin..end))
            .ok_or("an RLE segment lies outside of the frame")?;
        // The most significant byte of all samples comes first.
        let shift = 8 * (segments - 1 - segment);
        unpack(bytes, &mut samples, shift)?;
    }
    Ok(samples)
}

/// PackBits: a count and that many bytes, or one byte to be repeated.
fn unpack(mut bytes: &[u8], samples: &mut [u32], shift: usize) -> Result<(), String> {
    let mut at = 0;
    while at < samples.len() {
        let Some((&control, rest)) = bytes.split_first() else {
            return Err("an RLE segment ends too early".to_owned());
        };
        let literal = usize::from(control) + 1;
        let repeated = 257 - usize::from(control);
        bytes = match control {
            0..=127 => {
                let (run, rest) = rest.split_at_checked(literal).ok_or("an RLE segment ends too early")?;
                for (sample, byte) in samples[at..].iter_mut().zip(run) {
                    *sample |= u32::from(*byte) << shift;
                }
                at += literal;
                rest
            }
            128 => rest,
            129..=255 => {
                let (byte, rest) = rest.split_first().ok_or("an RLE segment ends too early")?;
                for sample in samples[at..].iter_mut().take(repeated) {
                    *sample |= u32::from(*byte) << shift;
                }
                at += repeated;
                rest
            }
        };
    }
    Ok(())
}

fn jpeg(compressed: &[u8], shape: Shape) -> Result<Vec<u32>, String> {
    let in_words = |error: jpeg_decoder::Error| error.to_string();
    let mut decoder = jpeg_decoder::Decoder::new(compressed);
    decoder.set_max_decoding_buffer_size(shape.samples() * 2);
    decoder.read_info().map_err(in_words)?;
    let info = decoder.info().ok_or("it has no JPEG header")?;
    same_size(usize::from(info.width), usize::from(info.height), shape)?;
    let per_sample = match info.pixel_format {
        jpeg_decoder::PixelFormat::L8 => 1,
        jpeg_decoder::PixelFormat::L16 => 2,
        _ => return Err("it is a colour JPEG".to_owned()),
    };
    let bytes = decoder.decode().map_err(in_words)?;
    match per_sample {
        1 => Ok(from_bytes(&bytes, 1)),
        // This decoder gives 16-bit samples in the machine's order.
        _ => Ok(bytes.as_chunks::<2>().0.iter().map(|pair| u32::from(u16::from_ne_bytes(*pair))).collect()),
    }
}

fn jpeg_ls(compressed: &[u8], shape: Shape) -> Result<Vec<u32>, String> {
    let in_words = |error: charls::Error| error.to_string();
    let info = charls::CharLS::default().get_frame_info(compressed).map_err(in_words)?;
    same_size(info.width as usize, info.height as usize, shape)?;
    one_component(info.component_count as usize)?;
    let bytes = charls::CharLS::default().decode(compressed).map_err(in_words)?;
    Ok(from_bytes(&bytes, if info.bits_per_sample <= 8 { 1 } else { 2 }))
}

fn jpeg_2000(compressed: &[u8], shape: Shape) -> Result<Vec<u32>, String> {
    // Some writers wrap the codestream in a file of its own.
    let begin = compressed.windows(4).position(|bytes| bytes == START_OF_CODESTREAM);
    let stream = &compressed[begin.ok_or("it has no JPEG 2000 codestream")?..];
    let components = stream.get(COMPONENTS_AT..DEPTH_AT).ok_or("it has no JPEG 2000 header")?;
    one_component(usize::from(components[0]) << 8 | usize::from(components[1]))?;
    let depth = *stream.get(DEPTH_AT).ok_or("it has no JPEG 2000 header")?;
    let settings =
        hayro_jpeg2000::DecodeSettings { strict: true, ..hayro_jpeg2000::DecodeSettings::default() };
    let in_words = |error: hayro_jpeg2000::DecodeError| error.to_string();
    let image = hayro_jpeg2000::Image::new(stream, &settings).map_err(in_words)?;
    same_size(image.width() as usize, image.height() as usize, shape)?;
    let mut context = hayro_jpeg2000::DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(in_words)?;
    let component = decoded.components().first().ok_or("it has no component")?;
    // The decoder moves signed samples up by half their range, as it does unsigned ones. Lossy
    // ones can come out a little beyond their range.
    let bits = u32::from(depth & 0x7F) + 1;
    let half = if depth & 0x80 != 0 { 1_i64 << (bits - 1) } else { 0 };
    let highest = (1_i64 << bits) - 1;
    let sample = |value: &f32| ((value.round() as i64).clamp(0, highest) - half) as u32;
    Ok(component.samples().iter().map(sample).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(segments: &[&[u8]]) -> Vec<u8> {
        let mut bytes = (segments.len() as u32).to_le_bytes().to_vec();
        let mut at = RLE_HEADER_BYTES as u32;
        for segment in segments {
            bytes.extend(at.to_le_bytes());
            at += segment.len() as u32;
        }
        bytes.resize(RLE_HEADER_BYTES, 0);
        segments.iter().for_each(|segment| bytes.extend(*segment));
        bytes
    }

    #[test]
    fn run_lengths_of_both_kinds_are_unpacked() {
        let shape = Shape { rows: 1, columns: 5, bits_allocated: 16 };
        // 1 1 1 2 3 as high bytes, 9 five times as low bytes
        let bytes = frame(&[&[254, 1, 1, 2, 3], &[128, 252, 9]]);
        assert_eq!(decode(Codec::Rle, &bytes, shape).unwrap(), [0x109, 0x109, 0x109, 0x209, 0x309]);
        assert!(decode(Codec::Rle, &bytes[..60], shape).is_err());
        assert!(decode(Codec::Rle, &frame(&[&[254, 1]]), shape).is_err());
        assert!(decode(Codec::Rle, &frame(&[&[254, 1], &[252, 9]]), shape).unwrap_err().contains("early"));
        let mut outside = bytes.clone();
        outside[8] = 200;
        assert!(decode(Codec::Rle, &outside, shape).unwrap_err().contains("outside"));
    }

    #[test]
    fn noise_is_refused_by_every_decoder() {
        let shape = Shape { rows: 4, columns: 4, bits_allocated: 16 };
        let noise: Vec<u8> = (0..200_u32).map(|i| (i * 71 % 251) as u8).collect();
        for codec in [Codec::Rle, Codec::Jpeg, Codec::JpegLs, Codec::Jpeg2000] {
            assert!(decode(codec, &noise, shape).is_err(), "{codec:?}");
        }
        let huge = Shape { rows: 60_000, columns: 60_000, bits_allocated: 16 };
        assert!(decode(Codec::Jpeg2000, &noise, huge).unwrap_err().contains("cannot hold"));
    }
}
