//! 16-bit floats, which become 32-bit ones on the way in.

use std::io::{self, Read};

use half::f16;
use proto::scene_file::Endian;

use crate::stream::{AsReader, Stream};

/// Bytes of 16-bit floats read in one step.
const STEP_BYTES: usize = 64 << 10;

/// What the user is told.
pub(crate) const NOTICE: &str = "16-bit floats are read as 32-bit ones, without loss";

/// Turns a stream of 16-bit floats into one of little-endian 32-bit floats.
pub(crate) fn widen(stream: Stream<'_>, endian: Endian) -> Stream<'_> {
    let file = stream.file.clone();
    let at_most = stream.at_most().saturating_mul(2);
    let reader = Widen { stream: AsReader(stream), endian, wide: Vec::new(), given: 0 };
    Stream::decoded(file, Box::new(reader), at_most)
}

struct Widen<'a> {
    stream: AsReader<'a>,
    endian: Endian,
    /// Converted bytes, of which the first `given` have been handed out.
    wide: Vec<u8>,
    given: usize,
}

impl Read for Widen<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.given == self.wide.len() {
            let mut narrow = Vec::with_capacity(STEP_BYTES);
            (&mut self.stream).take(STEP_BYTES as u64).read_to_end(&mut narrow)?;
            let (pairs, rest) = narrow.as_chunks::<2>();
            if !rest.is_empty() {
                return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "half a 16-bit float"));
            }
            self.given = 0;
            self.wide.clear();
            self.wide.extend(pairs.iter().flat_map(|pair| {
                let value = match self.endian {
                    Endian::Little => f16::from_le_bytes(*pair),
                    Endian::Big => f16::from_be_bytes(*pair),
                };
                value.to_f32().to_le_bytes()
            }));
        }
        let step = buffer.len().min(self.wide.len() - self.given);
        buffer[..step].copy_from_slice(&self.wide[self.given..self.given + step]);
        self.given += step;
        Ok(step)
    }
}
