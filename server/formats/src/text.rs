//! Voxels written as text: numbers (NRRD `ascii`) or hexadecimal bytes (NRRD `hex`).

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

use proto::scene_file::VoxelType;

/// Longest number in a text file, characters. A 64-bit float needs 24.
const MAX_TOKEN_CHARS: usize = 64;

/// How the text is to be read.
#[derive(Debug, Clone, Copy)]
pub(crate) enum TextKind {
    /// Numbers parted by white space or commas; come out as little-endian bytes of this type.
    Numbers(VoxelType),
    /// Two hexadecimal digits per byte; white space is ignored.
    Hex,
}

/// Turns text into the bytes a binary file would hold.
pub(crate) struct TextReader<R = BufReader<File>> {
    reader: R,
    kind: TextKind,
    /// Bytes of the last number that the caller's buffer had no room for.
    pending: Vec<u8>,
}

impl<R: BufRead> TextReader<R> {
    pub(crate) fn new(reader: R, kind: TextKind) -> Self {
        Self { reader, kind, pending: Vec::with_capacity(8) }
    }

    /// Next byte that is not white space; `None` at the end.
    fn next_digit(&mut self) -> io::Result<Option<u8>> {
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                return Ok(None);
            }
            let blank = buffer.iter().take_while(|b| b.is_ascii_whitespace()).count();
            let found = buffer.get(blank).copied();
            self.reader.consume(blank + usize::from(found.is_some()));
            if found.is_some() {
                return Ok(found);
            }
        }
    }

    /// Next number as text; empty at the end.
    fn next_token(&mut self) -> io::Result<Vec<u8>> {
        let is_separator = |b: &u8| b.is_ascii_whitespace() || *b == b',';
        let mut token = Vec::new();
        loop {
            let buffer = self.reader.fill_buf()?;
            if buffer.is_empty() {
                return Ok(token);
            }
            let blank = match token.is_empty() {
                true => buffer.iter().take_while(|b| is_separator(b)).count(),
                false => 0,
            };
            let rest = &buffer[blank..];
            let length = rest.iter().position(is_separator);
            let taken = &rest[..length.unwrap_or(rest.len())];
            if token.len() + taken.len() > MAX_TOKEN_CHARS {
                return Err(invalid(format!("a number of more than {MAX_TOKEN_CHARS} characters")));
            }
            token.extend_from_slice(taken);
            let used = blank + taken.len();
            self.reader.consume(used);
            if length.is_some() && !token.is_empty() {
                return Ok(token);
            }
        }
    }

    /// Puts the bytes of the next value into `pending`; false at the end.
    fn next_value(&mut self) -> io::Result<bool> {
        match self.kind {
            TextKind::Hex => {
                let Some(high) = self.next_digit()? else {
                    return Ok(false);
                };
                let low = self.next_digit()?.ok_or_else(|| invalid("half a byte of hex".into()))?;
                self.pending.push(16 * hex_value(high)? + hex_value(low)?);
            }
            TextKind::Numbers(voxel_type) => {
                let token = self.next_token()?;
                if token.is_empty() {
                    return Ok(false);
                }
                push_number(&token, voxel_type, &mut self.pending)?;
            }
        }
        Ok(true)
    }
}

impl<R: BufRead> Read for TextReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.pending.is_empty() && !self.next_value()? {
                break;
            }
            let step = self.pending.len().min(buffer.len() - filled);
            buffer[filled..filled + step].copy_from_slice(&self.pending[..step]);
            self.pending.drain(..step);
            filled += step;
        }
        Ok(filled)
    }
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

fn hex_value(digit: u8) -> io::Result<u8> {
    char::from(digit)
        .to_digit(16)
        .and_then(|value| u8::try_from(value).ok())
        .ok_or_else(|| invalid(format!("{:?} is not a hexadecimal digit", char::from(digit))))
}

/// Parses one number and appends its little-endian bytes.
fn push_number(token: &[u8], voxel_type: VoxelType, bytes: &mut Vec<u8>) -> io::Result<()> {
    let text = String::from_utf8_lossy(token);
    macro_rules! push {
        ($type:ty) => {
            match text.parse::<$type>() {
                Ok(value) => bytes.extend_from_slice(&value.to_le_bytes()),
                Err(_) => {
                    let name = stringify!($type);
                    return Err(invalid(format!("{text:?} is not a number of type {name}")));
                }
            }
        };
    }
    match voxel_type {
        VoxelType::Uint8 => push!(u8),
        VoxelType::Int8 => push!(i8),
        VoxelType::Uint16 => push!(u16),
        VoxelType::Int16 => push!(i16),
        VoxelType::Uint32 => push!(u32),
        VoxelType::Int32 => push!(i32),
        VoxelType::Uint64 => push!(u64),
        VoxelType::Int64 => push!(i64),
        VoxelType::Float32 => push!(f32),
        VoxelType::Float64 => push!(f64),
    }
    Ok(())
}
