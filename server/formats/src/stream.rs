//! The bytes of a file after decoding, with a bound on how many can come.
//!
//! The bound is what lets readers refuse a lying header before they reserve memory: a plain file
//! yields exactly its length, a gzip stream at most [`MAX_DEFLATE_RATIO`] times its length.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use crate::error::{FormatError, file_name};
use crate::gzip::{GZIP_MAGIC, GzipMembers};
use crate::text::TextReader;

/// Deflate codes at most 258 bytes in 2 bits, so one byte never yields more than 1032.
const MAX_DEFLATE_RATIO: u64 = 1032;
/// Bytes after the last voxel of a gzip stream that are tolerated (writers pad); a stream that
/// goes on beyond is taken for a bomb.
const MAX_TRAILING_BYTES: u64 = 1 << 20;
/// Read buffer of a file, bytes.
const FILE_BUFFER_BYTES: usize = 256 << 10;
/// Step in which unwanted bytes are read and dropped.
const SKIP_BYTES: usize = 64 << 10;

/// Tells the caller how far decoding has come.
pub(crate) struct Progress<'a> {
    callback: &'a (dyn Fn(f32) + Sync),
    total_bytes: u64,
    done_bytes: u64,
}

impl<'a> Progress<'a> {
    pub(crate) fn new(callback: &'a (dyn Fn(f32) + Sync), total_bytes: u64) -> Self {
        Self { callback, total_bytes, done_bytes: 0 }
    }

    pub(crate) fn advance(&mut self, bytes: u64) {
        self.done_bytes = self.done_bytes.saturating_add(bytes);
        let fraction = self.done_bytes as f64 / self.total_bytes.max(1) as f64;
        (self.callback)(fraction.min(1.0) as f32);
    }
}

/// Opens the next data file of a volume that is spread over several.
pub(crate) type OpenPart<'a> = Box<dyn FnMut(usize) -> Result<Stream<'a>, FormatError> + 'a>;

enum Inner<'a> {
    Plain {
        reader: BufReader<File>,
        left: u64,
    },
    Gzip {
        members: Box<GzipMembers>,
        at_most: u64,
    },
    Text {
        reader: Box<TextReader>,
        at_most: u64,
    },
    Decoded {
        reader: Box<dyn Read + 'a>,
        at_most: u64,
    },
    Parts {
        open: OpenPart<'a>,
        next: usize,
        count: usize,
        part_bytes: u64,
        part: Option<(Box<Stream<'a>>, u64)>,
    },
}

/// Decoded bytes of one or more files, read front to back.
pub(crate) struct Stream<'a> {
    /// File name for messages.
    pub(crate) file: String,
    inner: Inner<'a>,
}

impl<'a> Stream<'a> {
    /// Opens a plain file; anything but a regular file (devices, pipes, folders) is refused.
    pub(crate) fn open(path: &Path) -> Result<Self, FormatError> {
        let file = file_name(path);
        let metadata = std::fs::metadata(path).map_err(FormatError::io(&file, "open"))?;
        if !metadata.is_file() {
            return Err(FormatError::corrupt(&file, "not a regular file"));
        }
        let handle = File::open(path).map_err(FormatError::io(&file, "open"))?;
        let reader = BufReader::with_capacity(FILE_BUFFER_BYTES, handle);
        Ok(Self { file, inner: Inner::Plain { reader, left: metadata.len() } })
    }

    /// Opens a file that may be compressed as a whole; gzip is recognised by content.
    pub(crate) fn open_maybe_gzip(path: &Path) -> Result<Self, FormatError> {
        let mut stream = Self::open(path)?;
        let compressed = match &mut stream.inner {
            Inner::Plain { reader, .. } => is_gzip(reader.fill_buf()),
            _ => false,
        };
        if compressed { stream.into_gzip() } else { Ok(stream) }
    }

    /// Several files one after the other, `part_bytes` decoded bytes from each.
    pub(crate) fn parts(file: String, count: usize, part_bytes: u64, open: OpenPart<'a>) -> Self {
        Self { file, inner: Inner::Parts { open, next: 0, count, part_bytes, part: None } }
    }

    /// Inflates what is left of a plain stream.
    pub(crate) fn into_gzip(self) -> Result<Self, FormatError> {
        let (file, mut reader, left) = self.into_plain()?;
        if !is_gzip(reader.fill_buf()) {
            let what = "the data are not gzip, though the header says so";
            return Err(FormatError::corrupt(&file, what));
        }
        let at_most = left.saturating_mul(MAX_DEFLATE_RATIO);
        let members = Box::new(GzipMembers::new(reader));
        Ok(Self { file, inner: Inner::Gzip { members, at_most } })
    }

    /// Parses what is left of a plain stream as text, where two characters at least stand for
    /// `bytes_per_char_pair` bytes.
    pub(crate) fn into_text(
        self,
        wrap: impl FnOnce(BufReader<File>) -> TextReader,
        bytes_per_char_pair: u64,
    ) -> Result<Self, FormatError> {
        let (file, reader, left) = self.into_plain()?;
        let at_most = (left / 2 + 1).saturating_mul(bytes_per_char_pair);
        Ok(Self { file, inner: Inner::Text { reader: Box::new(wrap(reader)), at_most } })
    }

    /// Inflates what is left of a plain stream, zlib or gzip by its first bytes.
    pub(crate) fn into_zlib(self) -> Result<Self, FormatError> {
        let (file, mut reader, left) = self.into_plain()?;
        if is_gzip(reader.fill_buf()) {
            let at_most = left.saturating_mul(MAX_DEFLATE_RATIO);
            let members = Box::new(GzipMembers::new(reader));
            return Ok(Self { file, inner: Inner::Gzip { members, at_most } });
        }
        let decoder = flate2::bufread::ZlibDecoder::new(reader);
        Ok(Self::decoded(file, Box::new(decoder), left.saturating_mul(MAX_DEFLATE_RATIO)))
    }

    /// Bytes from a decoder that yields at most so many.
    pub(crate) fn decoded(file: String, reader: Box<dyn Read + 'a>, at_most: u64) -> Self {
        Self { file, inner: Inner::Decoded { reader, at_most } }
    }

    /// The file's name, its reader and the bytes that are left, of a plain stream.
    pub(crate) fn into_plain(self) -> Result<(String, BufReader<File>, u64), FormatError> {
        match self.inner {
            Inner::Plain { reader, left } => Ok((self.file, reader, left)),
            _ => Err(FormatError::corrupt(&self.file, "encoded twice")),
        }
    }

    /// Most bytes that can still come.
    pub(crate) fn at_most(&self) -> u64 {
        match &self.inner {
            Inner::Plain { left, .. } => *left,
            Inner::Gzip { at_most, .. } | Inner::Text { at_most, .. } | Inner::Decoded { at_most, .. } => {
                *at_most
            }
            Inner::Parts { count, part_bytes, .. } => (*count as u64).saturating_mul(*part_bytes),
        }
    }

    /// Refuses a header that asks for more bytes than can come.
    pub(crate) fn require(&self, needed: u64) -> Result<(), FormatError> {
        if needed <= self.at_most() {
            return Ok(());
        }
        let available = match &self.inner {
            Inner::Plain { left, .. } => format!("{left} are there"),
            _ => format!("at most {} can come out of it", self.at_most()),
        };
        Err(FormatError::Truncated { file: self.file.clone(), needed, available })
    }

    /// Reads some bytes; 0 at the end.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, FormatError> {
        let file = &self.file;
        match &mut self.inner {
            Inner::Plain { reader, left } => {
                let got = reader.read(buffer).map_err(FormatError::io(file, "read"))?;
                *left = left.saturating_sub(got as u64);
                Ok(got)
            }
            Inner::Gzip { members, at_most } => {
                let got = members.read(buffer).map_err(|e| damaged_gzip(file, &e))?;
                *at_most = at_most.saturating_sub(got as u64);
                Ok(got)
            }
            Inner::Text { reader, at_most } => {
                let got = reader.read(buffer).map_err(|e| match e.kind() {
                    io::ErrorKind::InvalidData => FormatError::corrupt(file, e.to_string()),
                    _ => FormatError::io(file, "read")(e),
                })?;
                *at_most = at_most.saturating_sub(got as u64);
                Ok(got)
            }
            Inner::Decoded { reader, at_most } => {
                let got = reader.read(buffer).map_err(|error| damaged(file, error))?;
                *at_most = at_most.saturating_sub(got as u64);
                Ok(got)
            }
            Inner::Parts { open, next, count, part_bytes, part } => loop {
                if let Some((stream, left)) = part.as_mut().filter(|(_, left)| *left > 0) {
                    let wanted = buffer.len().min(usize::try_from(*left).unwrap_or(usize::MAX));
                    stream.read_exact(&mut buffer[..wanted])?;
                    *left -= wanted as u64;
                    return Ok(wanted);
                }
                if let Some((mut stream, _)) = part.take() {
                    stream.finish()?;
                }
                if *next == *count {
                    return Ok(0);
                }
                *part = Some((Box::new(open(*next)?), *part_bytes));
                *next += 1;
            },
        }
    }

    /// Fills the buffer or fails.
    pub(crate) fn read_exact(&mut self, buffer: &mut [u8]) -> Result<(), FormatError> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read(&mut buffer[filled..])? {
                0 => {
                    return Err(FormatError::Truncated {
                        file: self.file.clone(),
                        needed: (buffer.len() - filled) as u64,
                        available: "but they end before that".to_owned(),
                    });
                }
                got => filled += got,
            }
        }
        Ok(())
    }

    /// Up to `count` bytes from the front, fewer if the stream ends or is damaged; for looking at
    /// a stream that is then dropped.
    pub(crate) fn peek_up_to(&mut self, count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        let mut filled = 0;
        while let Ok(got @ 1..) = self.read(&mut bytes[filled..]) {
            filled += got;
        }
        bytes.truncate(filled);
        bytes
    }

    /// One line without its end, at most `limit` bytes; `None` at the end of the file.
    pub(crate) fn read_line(&mut self, limit: u64) -> Result<Option<Vec<u8>>, FormatError> {
        let Inner::Plain { reader, left } = &mut self.inner else {
            return Err(FormatError::corrupt(&self.file, "lines inside encoded data"));
        };
        let mut line = Vec::new();
        let got = reader
            .take(limit.saturating_add(1))
            .read_until(b'\n', &mut line)
            .map_err(FormatError::io(&self.file, "read"))? as u64;
        *left = left.saturating_sub(got);
        if got > limit {
            return Err(FormatError::TooLarge {
                file: self.file.clone(),
                what: "bytes of header",
                got: format!("a line of {got} or more"),
                limit,
            });
        }
        if got == 0 {
            return Ok(None);
        }
        for end in [b'\n', b'\r'] {
            if line.last() == Some(&end) {
                line.pop();
            }
        }
        Ok(Some(line))
    }

    /// Drops whole lines of a plain stream; fails if it has fewer.
    pub(crate) fn skip_lines(&mut self, count: u64) -> Result<(), FormatError> {
        let Inner::Plain { reader, left } = &mut self.inner else {
            return Err(FormatError::corrupt(&self.file, "lines inside encoded data"));
        };
        for skipped in 0..count {
            let got = reader.skip_until(b'\n').map_err(FormatError::io(&self.file, "read"))?;
            *left = left.saturating_sub(got as u64);
            if got == 0 {
                return Err(FormatError::field(
                    &self.file,
                    "line skip",
                    count,
                    format!("at most {skipped}, the number of lines in the data file"),
                ));
            }
        }
        Ok(())
    }

    /// Drops bytes; fails if there are fewer.
    pub(crate) fn skip(&mut self, bytes: u64, progress: &mut Progress<'_>) -> Result<(), FormatError> {
        self.require(bytes)?;
        if let Inner::Plain { reader, left } = &mut self.inner {
            let offset = i64::try_from(bytes)
                .map_err(|_| FormatError::corrupt(&self.file, "a position beyond any file is asked for"))?;
            reader.seek_relative(offset).map_err(FormatError::io(&self.file, "seek"))?;
            *left -= bytes;
            progress.advance(bytes);
            return Ok(());
        }
        let mut buffer = vec![0; SKIP_BYTES];
        let mut left = bytes;
        while left > 0 {
            let step = left.min(SKIP_BYTES as u64);
            self.read_exact(&mut buffer[..step as usize])?;
            progress.advance(step);
            left -= step;
        }
        Ok(())
    }

    /// Reads to the end where that proves the data whole (gzip keeps a checksum there). Returns
    /// a notice if anything was left over.
    pub(crate) fn finish(&mut self) -> Result<Option<String>, FormatError> {
        let trailing = match &self.inner {
            Inner::Plain { left, .. } => *left,
            _ => self.drain()?,
        };
        let stray = match &self.inner {
            Inner::Gzip { members, .. } => members.stray_bytes,
            _ => false,
        };
        Ok(match (trailing, stray) {
            (0, false) => None,
            (0, true) => Some(format!("{}: bytes after the end of the gzip data are ignored", self.file)),
            (n, _) => Some(format!("{}: {n} bytes after the last voxel are ignored", self.file)),
        })
    }

    /// Reads on to the end and counts; refuses a stream that goes on and on.
    fn drain(&mut self) -> Result<u64, FormatError> {
        let mut buffer = vec![0; SKIP_BYTES];
        let mut trailing = 0;
        loop {
            let got = self.read(&mut buffer)? as u64;
            trailing += got;
            if got == 0 {
                return Ok(trailing);
            }
            if trailing > MAX_TRAILING_BYTES {
                return Err(FormatError::corrupt(
                    &self.file,
                    format!(
                        "the data go on for more than {MAX_TRAILING_BYTES} bytes after the last \
                         voxel: the header is wrong, or the file is meant to exhaust its reader"
                    ),
                ));
            }
        }
    }
}

/// A stream as a plain reader, for decoders on top of it. A refusal travels inside the
/// [`io::Error`] and comes out unchanged.
pub(crate) struct AsReader<'a>(pub(crate) Stream<'a>);

impl Read for AsReader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer).map_err(io::Error::other)
    }
}

/// What a decoder's error means.
fn damaged(file: &str, error: io::Error) -> FormatError {
    error
        .downcast::<FormatError>()
        .unwrap_or_else(|error| FormatError::corrupt(file, format!("the data are damaged ({error})")))
}

fn damaged_gzip(file: &str, error: &io::Error) -> FormatError {
    let what = match error.kind() {
        io::ErrorKind::UnexpectedEof => "the gzip data end too early: the file is cut short",
        _ => "the gzip data are damaged",
    };
    FormatError::corrupt(file, format!("{what} ({error})"))
}

fn is_gzip(start: io::Result<&[u8]>) -> bool {
    start.is_ok_and(|bytes| bytes.starts_with(&GZIP_MAGIC))
}
