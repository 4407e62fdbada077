//! The XML of a VTI file: attributes of the grid, and where the arrays lie. The contents of the
//! arrays are passed over, not kept.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use proto::scene_file::VoxelType;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::ReadOptions;
use crate::error::FormatError;
use crate::stream::Stream;

/// Most arrays a file may have.
const MAX_ARRAYS: usize = 1 << 12;

/// How the voxels of an array are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// Numbers in text, from a byte of the file on, so many bytes.
    Text { start: u64, length: u64 },
    /// Base64, from a byte of the file on, so many bytes.
    Inline { start: u64, length: u64 },
    /// So many bytes (or base64 characters) into the appended data.
    Appended { offset: u64 },
}

/// One `DataArray` of points or cells.
#[derive(Debug, Clone)]
pub(super) struct Array {
    pub(super) name: String,
    /// `None` for types that are no numbers.
    pub(super) voxel_type: Option<VoxelType>,
    pub(super) type_name: String,
    pub(super) components: u64,
    pub(super) on_cells: bool,
    pub(super) place: Option<Place>,
    format: String,
}

/// Where the appended data start, and whether they are base64.
#[derive(Debug, Clone, Copy)]
pub(super) struct Appended {
    pub(super) start: u64,
    pub(super) is_base64: bool,
}

/// What the XML says.
#[derive(Debug, Default)]
pub(super) struct Header {
    pub(super) file: String,
    pub(super) byte_order: Option<String>,
    pub(super) header_type: Option<String>,
    pub(super) compressor: Option<String>,
    pub(super) whole_extent: Option<String>,
    pub(super) origin: Option<String>,
    pub(super) spacing: Option<String>,
    pub(super) direction: Option<String>,
    piece_extent: Option<String>,
    pieces: u32,
    /// Names of the arrays that the file marks as the ones to show.
    pub(super) active: Vec<String>,
    pub(super) arrays: Vec<Array>,
    pub(super) appended: Option<Appended>,
}

/// Reads the XML up to the appended data.
pub(super) fn read(path: &Path, options: &ReadOptions<'_>) -> Result<Header, FormatError> {
    let (file, reader, _) = Stream::open(path)?.into_plain()?;
    let bounded = Bounded { reader, left: options.limits.max_header_bytes, is_free: false };
    let mut parser =
        Parser { xml: Reader::from_reader(bounded), header: Header { file, ..Header::default() } };
    parser.run()?;
    let header = parser.header;
    if header.pieces > 1 {
        return Err(FormatError::unsupported(
            &header.file,
            format!("an image in {} pieces", header.pieces),
            "write it as one piece, for example from ParaView with one process",
        ));
    }
    if header.piece_extent.as_deref().map(str::trim) != header.whole_extent.as_deref().map(str::trim) {
        let expected = "one Piece of the whole extent";
        let got = header.piece_extent.unwrap_or_else(|| "nothing".to_owned());
        return Err(FormatError::field(&header.file, "Piece Extent", got, expected));
    }
    Ok(header)
}

struct Parser {
    xml: Reader<Bounded>,
    header: Header,
}

impl Parser {
    fn run(&mut self) -> Result<(), FormatError> {
        let mut buffer = Vec::new();
        // Whether the arrays that come belong to cells; `None` outside of points and cells.
        let mut on_cells = None;
        // The array whose content is being passed over.
        let mut open = None;
        loop {
            buffer.clear();
            let event = self.xml.read_event_into(&mut buffer).map_err(|e| damaged(&self.header.file, &e))?;
            let (tag, is_empty) = match event {
                Event::Start(tag) => (tag, false),
                Event::Empty(tag) => (tag, true),
                Event::End(tag) => {
                    match tag.name().as_ref() {
                        "PointData" | "CellData" => on_cells = None,
                        "DataArray" => open = None,
                        // The voxels follow what is said about them.
                        _ => self.pass_over(open)?,
                    }
                    continue;
                }
                Event::Eof => return Ok(()),
                _ => continue,
            };
            let file = self.header.file.clone();
            let attribute = |name: &str| attribute(&file, &tag, name);
            let header = &mut self.header;
            match tag.name().as_ref() {
                "VTKFile" => {
                    if let Some(kind) = attribute("type")?.filter(|kind| kind != "ImageData") {
                        return Err(FormatError::unsupported(
                            &file,
                            format!("a VTK file of {}", crate::error::quoted(&kind)),
                            "resample it to an image (vtkImageData, .vti)",
                        ));
                    }
                    header.byte_order = attribute("byte_order")?;
                    header.header_type = attribute("header_type")?;
                    header.compressor = attribute("compressor")?;
                }
                "ImageData" => {
                    header.whole_extent = attribute("WholeExtent")?;
                    header.origin = attribute("Origin")?;
                    header.spacing = attribute("Spacing")?;
                    header.direction = attribute("Direction")?;
                }
                "Piece" => {
                    header.pieces = header.pieces.saturating_add(1);
                    header.piece_extent = attribute("Extent")?;
                }
                name @ ("PointData" | "CellData") if !is_empty => {
                    on_cells = Some(name == "CellData");
                    header.active.extend(attribute("Scalars")?);
                }
                "DataArray" => {
                    if let Some(on_cells) = on_cells {
                        if header.arrays.len() == MAX_ARRAYS {
                            return Err(FormatError::TooLarge {
                                file,
                                what: "arrays",
                                got: "more".to_owned(),
                                limit: MAX_ARRAYS as u64,
                            });
                        }
                        let array = array(&file, &tag, on_cells)?;
                        if !is_empty {
                            open = Some(header.arrays.len());
                        }
                        header.arrays.push(array);
                    }
                    if !is_empty {
                        self.pass_over(open)?;
                    }
                }
                "AppendedData" => {
                    let encoding = attribute("encoding")?.unwrap_or_else(|| "raw".to_owned());
                    let is_base64 = match encoding.as_str() {
                        "base64" => true,
                        "raw" => false,
                        _ => {
                            let expected = "base64 or raw";
                            return Err(FormatError::field(
                                &file,
                                "AppendedData encoding",
                                encoding,
                                expected,
                            ));
                        }
                    };
                    // The data start behind an underscore; they need not be XML.
                    self.skip_to(b'_')?;
                    let start = self.xml.buffer_position() + 1;
                    self.header.appended = Some(Appended { start, is_base64 });
                    return Ok(());
                }
                _ if is_empty && open.is_some() => self.pass_over(open)?,
                _ => {}
            }
        }
    }

    /// Passes over text and remembers where it lies if it is the content of an array.
    fn pass_over(&mut self, array: Option<usize>) -> Result<(), FormatError> {
        let start = self.xml.buffer_position();
        let is_blank = self.skip_to(b'<')?;
        let length = self.xml.buffer_position() - start;
        if let Some(array) = array.and_then(|i| self.header.arrays.get_mut(i)).filter(|_| !is_blank) {
            array.place = match array.format.as_str() {
                "ascii" => Some(Place::Text { start, length }),
                "binary" => Some(Place::Inline { start, length }),
                _ => array.place,
            };
        }
        Ok(())
    }

    /// Drops bytes up to the given one; whether all were white space.
    fn skip_to(&mut self, end: u8) -> Result<bool, FormatError> {
        let file = &self.header.file;
        let mut is_blank = true;
        self.xml.get_mut().is_free = true;
        let mut stream = self.xml.stream();
        loop {
            let bytes = stream.fill_buf().map_err(FormatError::io(file, "read"))?;
            let found = bytes.iter().position(|byte| *byte == end);
            let passed = found.unwrap_or(bytes.len());
            is_blank &= bytes[..passed].trim_ascii().is_empty();
            let is_over = found.is_some() || bytes.is_empty();
            stream.consume(passed);
            if is_over {
                break;
            }
        }
        self.xml.get_mut().is_free = false;
        Ok(is_blank)
    }
}

fn array(file: &str, tag: &BytesStart<'_>, on_cells: bool) -> Result<Array, FormatError> {
    let attribute = |name: &str| attribute(file, tag, name);
    let whole = |name: &str, default: u64| match attribute(name)? {
        None => Ok(default),
        Some(text) => text
            .trim()
            .parse()
            .map_err(|_| FormatError::field(file, format!("DataArray {name}"), text, "a whole number")),
    };
    let type_name = attribute("type")?.unwrap_or_default();
    let voxel_type = match type_name.as_str() {
        "Int8" => Some(VoxelType::Int8),
        "UInt8" => Some(VoxelType::Uint8),
        "Int16" => Some(VoxelType::Int16),
        "UInt16" => Some(VoxelType::Uint16),
        "Int32" => Some(VoxelType::Int32),
        "UInt32" => Some(VoxelType::Uint32),
        "Int64" => Some(VoxelType::Int64),
        "UInt64" => Some(VoxelType::Uint64),
        "Float32" => Some(VoxelType::Float32),
        "Float64" => Some(VoxelType::Float64),
        _ => None,
    };
    let format = attribute("format")?.unwrap_or_else(|| "ascii".to_owned());
    let place = match format.as_str() {
        "appended" => Some(Place::Appended { offset: whole("offset", 0)? }),
        "ascii" | "binary" => None,
        _ => {
            let expected = "ascii, binary or appended";
            return Err(FormatError::field(file, "DataArray format", format, expected));
        }
    };
    Ok(Array {
        name: attribute("Name")?.unwrap_or_default(),
        voxel_type,
        type_name,
        components: whole("NumberOfComponents", 1)?.max(1),
        on_cells,
        place,
        format,
    })
}

fn attribute(file: &str, tag: &BytesStart<'_>, name: &str) -> Result<Option<String>, FormatError> {
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|e| damaged(file, &e))?;
        if attribute.key.as_ref() == name {
            let value = attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0);
            return value.map(|value| Some(value.into_owned())).map_err(|e| damaged(file, &e));
        }
    }
    Ok(None)
}

fn damaged(file: &str, error: &dyn std::fmt::Display) -> FormatError {
    FormatError::corrupt(file, format!("the XML is damaged ({error})"))
}

/// Whether a file is XML of VTK, by its first bytes.
pub(crate) fn is_header(start: &[u8]) -> bool {
    let start = start.trim_ascii_start();
    start.starts_with(b"<VTKFile")
        || start.starts_with(b"<?xml") && start.windows(8).any(|window| window == b"<VTKFile")
}

/// A reader that yields a limited number of bytes, those of arrays not counted.
struct Bounded {
    reader: BufReader<File>,
    left: u64,
    is_free: bool,
}

impl Read for Bounded {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.fill_buf()?.len().min(buffer.len());
        let bytes = self.fill_buf()?;
        buffer[..got].copy_from_slice(&bytes[..got]);
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Bounded {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let bytes = self.reader.fill_buf()?;
        if self.is_free {
            return Ok(bytes);
        }
        if self.left == 0 && !bytes.is_empty() {
            return Err(io::Error::other("more text than the limit on headers allows"));
        }
        let allowed = usize::try_from(self.left).unwrap_or(usize::MAX).min(bytes.len());
        Ok(&bytes[..allowed])
    }

    fn consume(&mut self, count: usize) {
        if !self.is_free {
            self.left = self.left.saturating_sub(count as u64);
        }
        self.reader.consume(count);
    }
}
