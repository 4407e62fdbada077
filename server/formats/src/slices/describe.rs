//! What a TIFF's description says about its pages: ImageJ's lines or OME's XML.

use quick_xml::Reader;
use quick_xml::events::Event;

use crate::error::FormatError;
use crate::orientation::spacing_is_usable;

/// Longest unit that is kept, in characters.
const MAX_UNIT_CHARS: usize = 16;
/// Events of the XML looked at before it is given up; `Pixels` is among the first.
const MAX_EVENTS: usize = 10_000;

/// Which page holds which slice, and how far apart voxels are.
#[derive(Debug, PartialEq)]
pub(super) struct Arrangement {
    pub(super) slices: usize,
    channels: usize,
    times: usize,
    /// The letters C, Z, T, fastest first.
    order: String,
    pub(super) spacing: [f64; 3],
    pub(super) unit: Option<String>,
}

impl Arrangement {
    /// Every page is a slice, one apart.
    pub(super) fn slices_only(pages: usize, notices: &mut Vec<String>) -> Self {
        notices.push("the file gives no spacing: 1 is taken along every axis".to_owned());
        Self::plain(pages)
    }

    fn plain(pages: usize) -> Self {
        Self { slices: pages, channels: 1, times: 1, order: "CZT".into(), spacing: [1.0; 3], unit: None }
    }

    /// Interprets a description; one that does not fit the pages is left aside with a notice.
    pub(super) fn of(
        file: &str,
        description: &str,
        resolution: [Option<f64>; 2],
        pages: usize,
        notices: &mut Vec<String>,
    ) -> Result<Self, FormatError> {
        let found = if description.starts_with("ImageJ=") {
            imagej(description, resolution)
        } else if description.contains("<OME") {
            ome(description)
        } else {
            return Ok(Self::slices_only(pages, notices));
        };
        let Some(found) = found else {
            notices.push("the description of the pages cannot be read: every page is a slice".to_owned());
            return Ok(Self::slices_only(pages, notices));
        };
        let described = found.slices.checked_mul(found.channels).and_then(|n| n.checked_mul(found.times));
        if described == Some(pages) {
            return Ok(found);
        }
        if pages == 1 {
            // Stacks beyond 4 GiB: all slices behind one directory.
            return Err(FormatError::unsupported(
                file,
                "a stack whose slices follow one page without pages of their own",
                "save it as BigTIFF or OME-TIFF, for example with Bio-Formats",
            ));
        }
        notices.push(format!(
            "the description tells of {} slices, {} channels and {} times, the file has {pages} pages: \
             every page is a slice",
            found.slices, found.channels, found.times
        ));
        Ok(Self { spacing: found.spacing, unit: found.unit, ..Self::plain(pages) })
    }

    /// Channels and times to choose from; channels count fastest.
    pub(super) fn volumes(&self) -> u64 {
        (self.channels as u64).saturating_mul(self.times as u64)
    }

    /// The page of a slice of a volume.
    pub(super) fn page(&self, z: usize, volume: u64) -> usize {
        let channel = (volume % self.channels as u64) as usize;
        let time = (volume / self.channels as u64) as usize;
        let (mut page, mut stride) = (0, 1);
        for letter in self.order.chars() {
            let (at, count) = match letter {
                'C' => (channel, self.channels),
                'T' => (time, self.times),
                _ => (z, self.slices),
            };
            page += at * stride;
            stride *= count;
        }
        page
    }
}

fn unit(text: &str) -> Option<String> {
    let text = text.trim();
    let known = match text {
        "" | "pixel" | "pixels" => return None,
        "micron" | "microns" | "\\u00B5m" | "\u{b5}m" | "\u{3bc}m" | "um" => "um",
        other => other,
    };
    Some(known.chars().take(MAX_UNIT_CHARS).collect())
}

/// ImageJ: `key=value` lines; pages run through channels, slices, times.
fn imagej(text: &str, resolution: [Option<f64>; 2]) -> Option<Arrangement> {
    let value = |key: &str| {
        text.lines()
            .find_map(|line| line.split_once('=').filter(|(name, _)| *name == key).map(|(_, v)| v.trim()))
    };
    let count = |key: &str| value(key).map_or(Some(1), |text| text.parse().ok().filter(|n| *n >= 1));
    let (channels, mut slices, times): (usize, usize, usize) =
        (count("channels")?, count("slices")?, count("frames")?);
    let images: usize = count("images")?;
    if value("slices").is_none() && channels == 1 && times == 1 {
        slices = images;
    }
    let usable = |step: f64| if spacing_is_usable(step) { step } else { 1.0 };
    let [x, y] = resolution.map(|pixels| usable(1.0 / pixels.unwrap_or(1.0)));
    let z = value("spacing").and_then(|text| text.parse::<f64>().ok()).map_or(1.0, |step| usable(step.abs()));
    Some(Arrangement {
        slices,
        channels,
        times,
        order: "CZT".into(),
        spacing: [x, y, z],
        unit: value("unit").and_then(unit),
    })
}

/// OME: the attributes of the first `Pixels`.
fn ome(text: &str) -> Option<Arrangement> {
    let mut xml = Reader::from_str(text);
    for _ in 0..MAX_EVENTS {
        let tag = match xml.read_event().ok()? {
            Event::Start(tag) | Event::Empty(tag) => tag,
            Event::Eof => return None,
            _ => continue,
        };
        if tag.local_name().as_ref() != "Pixels" {
            continue;
        }
        let attribute = |name: &str| {
            tag.attributes().flatten().find(|a| a.key.as_ref() == name).map(|a| a.value.into_owned())
        };
        let count = |name: &str| attribute(name)?.parse::<usize>().ok().filter(|n| *n >= 1);
        let step = |name: &str| {
            let step = attribute(name).and_then(|text| text.parse::<f64>().ok());
            step.filter(|step| spacing_is_usable(*step)).unwrap_or(1.0)
        };
        let order = attribute("DimensionOrder")?;
        let order = order
            .strip_prefix("XY")
            .filter(|rest| rest.len() == 3 && "CZT".chars().all(|letter| rest.contains(letter)))?;
        let units = ["X", "Y", "Z"].map(|axis| {
            attribute(&format!("PhysicalSize{axis}"))
                .map(|_| attribute(&format!("PhysicalSize{axis}Unit")).unwrap_or_else(|| "um".into()))
        });
        let one_unit = units[0] == units[1] && (units[2].is_none() || units[1] == units[2]);
        return Some(Arrangement {
            slices: count("SizeZ")?,
            channels: count("SizeC")?,
            times: count("SizeT")?,
            order: order.to_owned(),
            spacing: [step("PhysicalSizeX"), step("PhysicalSizeY"), step("PhysicalSizeZ")],
            unit: units[0].as_deref().filter(|_| one_unit).and_then(unit),
        });
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hyperstacks_of_imagej() {
        let text = "ImageJ=1.53t\nimages=24\nchannels=2\nslices=4\nframes=3\nhyperstack=true\n\
                    unit=micron\nspacing=0.5\n";
        let mut notices = Vec::new();
        let found = Arrangement::of("a.tif", text, [Some(4.0), Some(2.0)], 24, &mut notices).unwrap();
        assert!(notices.is_empty());
        assert_eq!(found.spacing, [0.25, 0.5, 0.5]);
        assert_eq!(found.unit.as_deref(), Some("um"));
        assert_eq!((found.slices, found.volumes()), (4, 6));
        // channel 1 of time 2, slice 3
        assert_eq!(found.page(3, 5), 1 + 2 * (3 + 4 * 2));
        let wrong = Arrangement::of("a.tif", text, [None, None], 23, &mut notices).unwrap();
        assert_eq!((wrong.slices, wrong.volumes()), (23, 1));
        assert!(Arrangement::of("a.tif", text, [None, None], 1, &mut notices).is_err());
    }

    #[test]
    fn pixels_of_ome() {
        let text = r#"<?xml version="1.0"?><OME xmlns="x"><Image><Pixels DimensionOrder="XYZCT"
            SizeC="2" SizeT="1" SizeX="5" SizeY="4" SizeZ="3" PhysicalSizeX="0.1" PhysicalSizeY="0.2"
            PhysicalSizeZ="0.3" Type="uint8"/></Image></OME>"#;
        let found = Arrangement::of("a.tif", text, [None, None], 6, &mut Vec::new()).unwrap();
        assert_eq!(found.spacing, [0.1, 0.2, 0.3]);
        assert_eq!(found.page(2, 1), 5);
        assert_eq!(found.unit.as_deref(), Some("um"));
    }
}
