//! A file that pictures are added to: an animated PNG, or a zip of PNGs.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use proto::rest::{ExportFormat, ExportRequest};
use render::Picture;

/// The file being written.
pub struct Reel {
    writer: Writer,
    frames: u32,
    bytes: Arc<AtomicU64>,
    path: PathBuf,
}

enum Writer {
    Animation(Box<png::Writer<Counting>>),
    Archive(Box<zip::ZipWriter<Counting>>),
}

/// Counts what is written.
struct Counting {
    file: BufWriter<File>,
    bytes: Arc<AtomicU64>,
}

impl Write for Counting {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Counting {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// What encoders say, as errors of the file.
fn failed(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
    let error = error.into();
    match error.downcast::<png::EncodingError>() {
        Ok(error) => match *error {
            png::EncodingError::IoError(error) => error,
            other => io::Error::other(other),
        },
        Err(error) => match error.downcast::<zip::result::ZipError>() {
            Ok(error) => match *error {
                zip::result::ZipError::Io(error) => error,
                other => io::Error::other(other),
            },
            Err(error) => io::Error::other(error),
        },
    }
}

impl Reel {
    /// Begins the file.
    ///
    /// # Errors
    /// The file system, or the encoder refuses the size.
    pub fn create(path: &Path, request: &ExportRequest) -> io::Result<Self> {
        let bytes = Arc::new(AtomicU64::new(0));
        let file = Counting { file: BufWriter::new(File::create(path)?), bytes: bytes.clone() };
        let writer = match request.format {
            ExportFormat::Apng => {
                let mut encoder = png::Encoder::new(file, request.width, request.height);
                encoder.set_color(png::ColorType::Rgb);
                encoder.set_depth(png::BitDepth::Eight);
                encoder.set_compression(png::Compression::Balanced);
                encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
                // Fewer pictures than were promised are an error.
                encoder.validate_sequence(true);
                // Played again and again.
                encoder.set_animated(request.frames, 0).map_err(failed)?;
                let rate = u16::try_from(request.frames_per_second).unwrap_or(u16::MAX);
                encoder.set_frame_delay(1, rate).map_err(failed)?;
                Writer::Animation(Box::new(encoder.write_header().map_err(failed)?))
            }
            ExportFormat::Zip => Writer::Archive(Box::new(zip::ZipWriter::new(file))),
        };
        Ok(Self { writer, frames: 0, bytes, path: path.to_owned() })
    }

    /// Adds a picture of the size that was asked for.
    ///
    /// # Errors
    /// The file system, or the encoder refuses.
    pub fn add(&mut self, picture: &Picture) -> io::Result<()> {
        self.frames += 1;
        match &mut self.writer {
            Writer::Animation(writer) => writer.write_image_data(&picture.rgb()).map_err(failed),
            Writer::Archive(writer) => {
                let png = render::still::png(picture).map_err(failed)?;
                // Pictures are compressed already.
                let options = zip::write::SimpleFileOptions::default()
                    .compression_method(zip::CompressionMethod::Stored);
                writer.start_file(format!("frame-{:04}.png", self.frames), options).map_err(failed)?;
                writer.write_all(&png)
            }
        }
    }

    /// About how many bytes were written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Ends the file; its length.
    ///
    /// # Errors
    /// The file system; pictures are missing.
    pub fn finish(self) -> io::Result<u64> {
        match self.writer {
            Writer::Animation(writer) => writer.finish().map_err(failed)?,
            Writer::Archive(writer) => {
                writer.finish().map_err(failed)?.flush()?;
            }
        }
        Ok(std::fs::metadata(self.path)?.len())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;

    fn request(format: ExportFormat) -> ExportRequest {
        ExportRequest {
            width: 5,
            height: 3,
            frames: 4,
            turns: Some(1.0),
            keys: Vec::new(),
            frames_per_second: 20,
            samples: None,
            format,
            camera: None,
        }
    }

    fn picture(level: u8) -> Picture {
        Picture { width: 5, height: 3, rgba: [level, 0, 255 - level, 255].repeat(15) }
    }

    fn written(format: ExportFormat) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("reel");
        let mut reel = Reel::create(&path, &request(format)).unwrap();
        for level in [0, 80, 160, 240] {
            reel.add(&picture(level)).unwrap();
        }
        assert!(reel.bytes() > 0);
        let length = reel.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(bytes.len() as u64, length);
        bytes
    }

    #[test]
    fn an_animation_holds_every_picture_and_its_time() {
        let bytes = written(ExportFormat::Apng);
        let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        let mut reader = decoder.read_info().unwrap();
        let control = *reader.info().animation_control().unwrap();
        assert_eq!((control.num_frames, control.num_plays), (4, 0));
        for level in [0, 80, 160, 240] {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, picture(level).rgb());
            let frame = reader.info().frame_control().unwrap();
            assert_eq!((frame.delay_num, frame.delay_den), (1, 20));
        }
    }

    #[test]
    fn an_archive_holds_every_picture_in_order() {
        let mut archive = zip::ZipArchive::new(std::io::Cursor::new(written(ExportFormat::Zip))).unwrap();
        assert_eq!(archive.len(), 4);
        for (index, level) in [0, 80, 160, 240].into_iter().enumerate() {
            let mut entry = archive.by_index(index).unwrap();
            assert_eq!(entry.name().unwrap(), format!("frame-{:04}.png", index + 1));
            let mut png = Vec::new();
            entry.read_to_end(&mut png).unwrap();
            assert_eq!(image::load_from_memory(&png).unwrap().to_rgb8().into_raw(), picture(level).rgb());
        }
    }

    #[test]
    fn an_animation_that_lacks_pictures_is_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut reel = Reel::create(&folder.path().join("reel"), &request(ExportFormat::Apng)).unwrap();
        reel.add(&picture(1)).unwrap();
        assert!(reel.finish().is_err());
    }
}
