//! Arrays as VTK writes them in binary: a count of bytes and the bytes, or a table of blocks and
//! the compressed blocks.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;

use crate::error::FormatError;

/// Largest block that is decoded at once, bytes; VTK writes 32 KiB.
const MAX_BLOCK_BYTES: u64 = 64 << 20;

/// How blocks are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
}

/// Integers of the tables before the voxels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Integers {
    pub(super) is_wide: bool,
    pub(super) is_big: bool,
}

impl Integers {
    fn read(self, from: &mut impl Read) -> io::Result<u64> {
        let mut bytes = [0; 8];
        let used = if self.is_wide { &mut bytes[..] } else { &mut bytes[..4] };
        from.read_exact(used)?;
        if self.is_big {
            used.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}

/// Opens an array whose voxels must be `expected` bytes.
pub(super) fn open<'a>(
    file: &str,
    mut source: Box<dyn Read + 'a>,
    integers: Integers,
    compressor: Option<Compressor>,
    expected: u64,
) -> Result<Box<dyn Read + 'a>, FormatError> {
    let cut = |error: io::Error| {
        FormatError::corrupt(file, format!("the table before the voxels cannot be read ({error})"))
    };
    let wrong = |got: String| FormatError::field(file, "bytes of the array", got, expected.to_string());
    let Some(compressor) = compressor else {
        let bytes = integers.read(&mut source).map_err(cut)?;
        return match bytes == expected {
            true => Ok(Box::new(source.take(expected))),
            false => Err(wrong(bytes.to_string())),
        };
    };
    let mut next = || integers.read(&mut source).map_err(cut);
    let (count, block_bytes, last_bytes) = (next()?, next()?, next()?);
    let full_blocks = count.saturating_sub(u64::from(last_bytes > 0));
    let total = u128::from(full_blocks) * u128::from(block_bytes) + u128::from(last_bytes);
    if total != u128::from(expected) || count > expected {
        return Err(wrong(format!("{count} blocks, {total} bytes")));
    }
    if block_bytes.max(last_bytes) > MAX_BLOCK_BYTES {
        let what = "bytes of a compressed block";
        let got = block_bytes.max(last_bytes).to_string();
        return Err(FormatError::TooLarge { file: file.to_owned(), what, got, limit: MAX_BLOCK_BYTES });
    }
    // The table grows as its entries come, so a count alone costs nothing.
    let mut packed_bytes = Vec::new();
    for _ in 0..count {
        packed_bytes.push(next()?);
    }
    let sizes = packed_bytes
        .into_iter()
        .enumerate()
        .map(move |(i, packed)| (packed, if (i as u64) < full_blocks { block_bytes } else { last_bytes }));
    let blocks = Blocks {
        source,
        sizes: sizes.collect::<Vec<_>>().into_iter(),
        compressor,
        block: Vec::new(),
        given: 0,
    };
    Ok(Box::new(blocks))
}

struct Blocks<'a> {
    source: Box<dyn Read + 'a>,
    /// Compressed and plain bytes of the blocks to come.
    sizes: std::vec::IntoIter<(u64, u64)>,
    compressor: Compressor,
    block: Vec<u8>,
    /// Bytes of `block` that have been handed out.
    given: usize,
}

impl Blocks<'_> {
    fn decode(&mut self, packed_bytes: u64, bytes: u64) -> io::Result<()> {
        let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
        self.block.clear();
        self.given = 0;
        let mut packed = (&mut self.source).take(packed_bytes);
        match self.compressor {
            Compressor::Zlib => {
                // One byte more than there should be, to see that there is none.
                ZlibDecoder::new(&mut packed).take(bytes + 1).read_to_end(&mut self.block)?;
                io::copy(&mut packed, &mut io::sink())?;
            }
            Compressor::Lz4 => {
                let mut input = Vec::new();
                packed.read_to_end(&mut input)?;
                self.block.resize(bytes as usize, 0);
                let got = lz4_flex::block::decompress_into(&input, &mut self.block);
                let got = got.map_err(|error| invalid(&format!("lz4: {error}")))?;
                self.block.truncate(got);
            }
        }
        match self.block.len() as u64 == bytes {
            true => Ok(()),
            false => Err(invalid("a block holds another number of bytes than its table says")),
        }
    }
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.block.len() {
            let Some((packed_bytes, bytes)) = self.sizes.next() else { return Ok(0) };
            self.decode(packed_bytes, bytes)?;
        }
        let step = buffer.len().min(self.block.len() - self.given);
        buffer[..step].copy_from_slice(&self.block[self.given..self.given + step]);
        self.given += step;
        Ok(step)
    }
}
