//! Gzip files of one or several members.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

use flate2::bufread::GzDecoder;

/// First two bytes of every gzip member.
pub(crate) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Members without a single byte that are tolerated; block-gzip ends with one.
const MAX_EMPTY_MEMBERS: u32 = 64;

/// Inflates all members of a gzip file, which may be several, one after the other. Anything after
/// the last member that is not gzip ends the data.
pub(crate) struct GzipMembers {
    decoder: Option<GzDecoder<BufReader<File>>>,
    member_is_empty: bool,
    empty_members: u32,
    /// Whether something that is not gzip followed the last member.
    pub(crate) stray_bytes: bool,
}

impl GzipMembers {
    pub(crate) fn new(reader: BufReader<File>) -> Self {
        Self {
            decoder: Some(GzDecoder::new(reader)),
            member_is_empty: true,
            empty_members: 0,
            stray_bytes: false,
        }
    }
}

impl Read for GzipMembers {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(decoder) = &mut self.decoder {
            let got = decoder.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                self.member_is_empty = false;
                return Ok(got);
            }
            // The member's checksum held. Is there another one?
            if self.member_is_empty {
                self.empty_members += 1;
            }
            if self.empty_members > MAX_EMPTY_MEMBERS {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "too many empty members"));
            }
            let Some(mut reader) = self.decoder.take().map(GzDecoder::into_inner) else {
                break;
            };
            let rest = reader.fill_buf()?;
            if rest.starts_with(&GZIP_MAGIC) {
                self.decoder = Some(GzDecoder::new(reader));
                self.member_is_empty = true;
            } else {
                self.stray_bytes = !rest.is_empty();
            }
        }
        Ok(0)
    }
}
