//! Blosc 1 (github.com/Blosc/c-blosc, README_CHUNK_FORMAT): a header of 16 bytes, a table of
//! blocks, and per block one or several compressed streams, bytes or bits shuffled.

use super::codec::{Codec, damaged, unpack};

const HEADER_BYTES: usize = 16;
/// Blocks smaller than so many values are never split into streams.
const MIN_SPLIT_VALUES: usize = 128;
/// Largest value that is split into streams, bytes.
const MAX_SPLIT_BYTES: usize = 16;

/// Decodes a Blosc buffer that must hold `expected` bytes.
pub(super) fn decode(packed: &[u8], expected: u64) -> Result<Vec<u8>, String> {
    let cut = || damaged("blosc", "cut short");
    let header = packed.first_chunk::<HEADER_BYTES>().ok_or_else(cut)?;
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let (flags, type_bytes) = (header[2], usize::from(header[3]));
    let (bytes, block_bytes) = (u64::from(word(4)), word(8) as usize);
    if bytes != expected {
        return Err(damaged("blosc", format!("{bytes} bytes announced, {expected} expected")));
    }
    let bytes = bytes as usize;
    if flags & 0x02 != 0 {
        // Stored as it is.
        let plain = packed.get(HEADER_BYTES..HEADER_BYTES + bytes).ok_or_else(cut)?;
        return Ok(plain.to_vec());
    }
    if block_bytes == 0 || type_bytes == 0 {
        return Err(damaged("blosc", "blocks or values of no bytes"));
    }
    let codec = match flags >> 5 {
        1 => Codec::Lz4,
        3 => Codec::Zlib,
        4 => Codec::Zstd,
        0 => return Err("blosc with blosclz is not supported; write with lz4 or zstd".to_owned()),
        2 => return Err("blosc with snappy is not supported; write with lz4 or zstd".to_owned()),
        other => return Err(damaged("blosc", format!("compressor {other}"))),
    };
    let (by_bytes, never_split, by_bits) = (flags & 0x01 != 0, flags & 0x10 != 0, flags & 0x04 != 0);
    let mut out = Vec::new();
    for block in 0..bytes.div_ceil(block_bytes) {
        let at = HEADER_BYTES + 4 * block;
        let start = packed.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_le_bytes);
        let mut rest = packed.get(start.ok_or_else(cut)? as usize..).ok_or_else(cut)?;
        let size = block_bytes.min(bytes - block * block_bytes);
        let is_last_part = size < block_bytes;
        let is_split = !never_split
            && !is_last_part
            && type_bytes <= MAX_SPLIT_BYTES
            && block_bytes / type_bytes >= MIN_SPLIT_VALUES
            && block_bytes.is_multiple_of(type_bytes);
        let streams = if is_split { type_bytes } else { 1 };
        let stream_bytes = size / streams;
        let mut plain = Vec::new();
        for _ in 0..streams {
            let (length, after) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
            let length = u32::from_le_bytes(*length) as usize;
            let stream = after.get(..length).ok_or_else(cut)?;
            rest = &after[length..];
            match length == stream_bytes {
                true => plain.extend_from_slice(stream),
                false => plain.extend(unpack(codec, stream, stream_bytes as u64)?),
            }
        }
        if by_bytes && type_bytes > 1 {
            unshuffle_bytes(&plain, type_bytes, &mut out);
        } else if by_bits {
            unshuffle_bits(&plain, type_bytes, &mut out);
        } else {
            out.extend(plain);
        }
    }
    Ok(out)
}

/// First bytes of all values, second bytes of all values, ..., and what is left over as it is.
fn unshuffle_bytes(shuffled: &[u8], type_bytes: usize, out: &mut Vec<u8>) {
    let values = shuffled.len() / type_bytes;
    for value in 0..values {
        out.extend((0..type_bytes).map(|byte| shuffled[byte * values + value]));
    }
    out.extend_from_slice(&shuffled[values * type_bytes..]);
}

/// First bits of all values, ...; a block whose values are no multiple of eight is stored as it is.
fn unshuffle_bits(shuffled: &[u8], type_bytes: usize, out: &mut Vec<u8>) {
    let values = shuffled.len() / type_bytes;
    if !values.is_multiple_of(8) {
        out.extend_from_slice(shuffled);
        return;
    }
    let row = values / 8;
    let start = out.len();
    out.resize(start + values * type_bytes, 0);
    let plain = &mut out[start..];
    for byte in 0..type_bytes {
        for bit in 0..8 {
            let bits = &shuffled[(byte * 8 + bit) * row..][..row];
            for (group, bits) in bits.iter().enumerate() {
                for k in 0..8 {
                    plain[(group * 8 + k) * type_bytes + byte] |= (bits >> k & 1) << bit;
                }
            }
        }
    }
    out.extend_from_slice(&shuffled[values * type_bytes..]);
}
