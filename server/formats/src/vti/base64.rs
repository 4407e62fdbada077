//! Base64 in a file, as a reader.

use std::io::{self, Read};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// Characters decoded in one step; a multiple of four.
const STEP_CHARS: usize = 64 << 10;

/// Decodes base64 text. White space is passed over, and text that ends with padding may be
/// followed by more: VTK writes the sizes of blocks as a text of their own. A tag ends the text.
pub(super) struct Base64Reader<R> {
    text: R,
    /// Whether the text has ended: at the end of the file or at a tag.
    is_over: bool,
    /// Characters that wait for the rest of their group of four.
    waiting: Vec<u8>,
    decoded: Vec<u8>,
    /// Bytes of `decoded` that have been handed out.
    given: usize,
}

impl<R: Read> Base64Reader<R> {
    pub(super) fn new(text: R) -> Self {
        Self { text, is_over: false, waiting: Vec::new(), decoded: Vec::new(), given: 0 }
    }

    /// Decodes the next piece of text; false at the end.
    fn step(&mut self) -> io::Result<bool> {
        let mut raw = vec![0; STEP_CHARS];
        let mut got = if self.is_over { 0 } else { self.text.read(&mut raw)? };
        if let Some(end) = raw[..got].iter().position(|byte| *byte == b'<') {
            (got, self.is_over) = (end, true);
        }
        self.waiting.extend(raw[..got].iter().filter(|byte| !byte.is_ascii_whitespace()));
        self.decoded.clear();
        self.given = 0;
        if got == 0 {
            self.is_over = true;
            return match self.waiting.is_empty() {
                true => Ok(false),
                false => Err(invalid("base64 text ends inside a group of four characters")),
            };
        }
        let whole = self.waiting.len() / 4 * 4;
        let mut rest = &self.waiting[..whole];
        while !rest.is_empty() {
            // Up to the group that ends with padding, if there is one.
            let padded = rest.iter().position(|byte| *byte == b'=').map(|at| at / 4 * 4 + 4);
            let (text, after) = rest.split_at(padded.unwrap_or(rest.len()));
            STANDARD
                .decode_vec(text, &mut self.decoded)
                .map_err(|error| invalid(&format!("not base64: {error}")))?;
            rest = after;
        }
        self.waiting.drain(..whole);
        Ok(true)
    }
}

impl<R: Read> Read for Base64Reader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.decoded.len() {
            if !self.step()? {
                return Ok(0);
            }
        }
        let step = buffer.len().min(self.decoded.len() - self.given);
        buffer[..step].copy_from_slice(&self.decoded[self.given..self.given + step]);
        self.given += step;
        Ok(step)
    }
}

fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(text: &str) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64Reader::new(text.as_bytes()).read_to_end(&mut bytes).map(|_| bytes)
    }

    #[test]
    fn texts_follow_each_other() {
        let (a, b) = (STANDARD.encode(b"abcd"), STANDARD.encode(b"efghi"));
        assert_eq!(decode(&format!(" {a}\n{b} ")).unwrap(), b"abcdefghi");
        assert_eq!(decode(&format!("{b}\n </AppendedData>")).unwrap(), b"efghi");
        assert_eq!(decode("").unwrap(), b"");
        let long = vec![7; 3 * STEP_CHARS + 1];
        assert_eq!(decode(&STANDARD.encode(&long)).unwrap(), long);
        for wrong in ["abc", "ab!d", "=abc", "a==="] {
            assert!(decode(wrong).is_err(), "{wrong}");
        }
    }
}
