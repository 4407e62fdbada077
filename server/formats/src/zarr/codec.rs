//! What turns stored bytes into a chunk: gzip, zlib, zstd, LZ4, Blosc, checksums.

use std::io::Read;

use flate2::read::{MultiGzDecoder, ZlibDecoder};
use ruzstd::decoding::StreamingDecoder;

use super::blosc;

/// Bytes by which an outer layer may be larger than the chunk itself.
const LAYER_SLACK_BYTES: u64 = 1 << 20;
/// Smallest window that zstd is allowed, bytes; it otherwise gets that of the chunk.
const MIN_ZSTD_WINDOW: u64 = 8 << 20;

/// One step from bytes to bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Codec {
    Gzip,
    Zlib,
    Zstd,
    /// A bare LZ4 block, as within Blosc.
    Lz4,
    /// An LZ4 block after its length in four bytes, as in the Python package numcodecs.
    SizedLz4,
    Blosc,
    /// A CRC-32C after the bytes.
    Crc32c,
}

/// Undoes codecs, the last one first. The result has `expected` bytes.
pub(super) fn decode(codecs: &[Codec], stored: Vec<u8>, expected: u64) -> Result<Vec<u8>, String> {
    let mut bytes = stored;
    for (layer, codec) in codecs.iter().enumerate().rev() {
        bytes = match codec {
            Codec::Crc32c => {
                let Some((body, sum)) = bytes.split_last_chunk::<4>() else {
                    return Err(damaged("crc32c", "cut short"));
                };
                if crc32c(body) != u32::from_le_bytes(*sum) {
                    return Err(damaged("crc32c", "the checksum does not hold"));
                }
                body.to_vec()
            }
            Codec::Blosc if layer == 0 => blosc::decode(&bytes, expected)?,
            Codec::Blosc => return Err("blosc over another codec is not supported".to_owned()),
            codec if layer == 0 => unpack(*codec, &bytes, expected)?,
            codec => unpack_at_most(*codec, &bytes, expected.saturating_add(LAYER_SLACK_BYTES))?,
        };
    }
    match bytes.len() as u64 == expected {
        true => Ok(bytes),
        false => Err(damaged("chunk", format!("{} bytes, {expected} expected", bytes.len()))),
    }
}

/// Decompresses to exactly `expected` bytes.
pub(super) fn unpack(codec: Codec, packed: &[u8], expected: u64) -> Result<Vec<u8>, String> {
    let bytes = unpack_at_most(codec, packed, expected)?;
    match bytes.len() as u64 == expected {
        true => Ok(bytes),
        false => Err(damaged("compressed data", format!("{} bytes, {expected} expected", bytes.len()))),
    }
}

fn unpack_at_most(codec: Codec, packed: &[u8], most: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    // One byte more than there may be, to see that there is none.
    let room = most.saturating_add(1);
    let read = match codec {
        Codec::Gzip => MultiGzDecoder::new(packed).take(room).read_to_end(&mut bytes),
        Codec::Zlib => ZlibDecoder::new(packed).take(room).read_to_end(&mut bytes),
        Codec::Zstd => {
            let window = most.max(MIN_ZSTD_WINDOW);
            let decoder = StreamingDecoder::new_with_max_window_size(packed, window);
            let decoder = decoder.map_err(|error| damaged("zstd", error))?;
            decoder.take(room).read_to_end(&mut bytes)
        }
        Codec::Lz4 => {
            // No LZ4 byte stands for more than 255.
            let room = most.min(packed.len() as u64 * 255);
            bytes.resize(room as usize, 0);
            let got = lz4_flex::block::decompress_into(packed, &mut bytes);
            let got = got.map_err(|error| damaged("lz4", error))?;
            bytes.truncate(got);
            Ok(got)
        }
        Codec::SizedLz4 => {
            let (size, block) = packed.split_first_chunk::<4>().ok_or_else(|| damaged("lz4", "cut short"))?;
            let size = u64::from(u32::from_le_bytes(*size));
            if size > most {
                return Err(damaged("lz4", format!("{size} bytes announced, at most {most} expected")));
            }
            return unpack(Codec::Lz4, block, size);
        }
        Codec::Blosc | Codec::Crc32c => return Err(damaged("codec", "used where it cannot be")),
    };
    read.map_err(|error| damaged("compressed data", error))?;
    match bytes.len() as u64 <= most {
        true => Ok(bytes),
        false => Err(damaged("compressed data", format!("more than {most} bytes"))),
    }
}

pub(super) fn damaged(what: &str, why: impl std::fmt::Display) -> String {
    format!("{what}: {why}")
}

/// CRC-32C (Castagnoli), reflected, as in RFC 3720.
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut i = 0;
        while i < 256 {
            let mut value = i as u32;
            let mut bit = 0;
            while bit < 8 {
                value = if value & 1 == 1 { value >> 1 ^ 0x82f6_3b78 } else { value >> 1 };
                bit += 1;
            }
            table[i] = value;
            i += 1;
        }
        table
    };
    !bytes.iter().fold(!0_u32, |sum, byte| sum >> 8 ^ TABLE[((sum ^ u32::from(*byte)) & 255) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_of_the_standard() {
        // RFC 3720, appendix B.4
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(&[0xff; 32]), 0x62a8_ab43);
    }

    #[test]
    fn more_bytes_than_expected_are_refused() {
        use std::io::Write;
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&[7; 1000]).unwrap();
        let packed = encoder.finish().unwrap();
        assert_eq!(decode(&[Codec::Zlib], packed.clone(), 1000).unwrap(), [7; 1000]);
        assert!(decode(&[Codec::Zlib], packed.clone(), 999).is_err());
        assert!(decode(&[Codec::Zlib], packed, 1001).is_err());
    }
}
