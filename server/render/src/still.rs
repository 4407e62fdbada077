//! Pictures and radiance as files: PNG (8-bit sRGB), EXR and NPY (linear float32 RGB).

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};

use crate::renderer::{Picture, Radiance};

/// Encoding failed; does not happen for pictures this crate made.
#[derive(Debug, thiserror::Error)]
#[error("the picture cannot be encoded: {0}")]
pub struct EncodeError(#[from] image::ImageError);

/// PNG, 8-bit sRGB, without alpha.
///
/// # Errors
/// If the encoder refuses the size.
pub fn png(picture: &Picture) -> Result<Vec<u8>, EncodeError> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive);
    encoder.write_image(&picture.rgb(), picture.width, picture.height, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

/// OpenEXR, linear float32 RGB, never tone-mapped.
///
/// # Errors
/// If the encoder refuses the size.
pub fn exr(radiance: &Radiance) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Cursor::new(Vec::new());
    let pixels: Vec<u8> = radiance.rgb.iter().flat_map(|x| x.to_ne_bytes()).collect();
    let encoder = image::codecs::openexr::OpenExrEncoder::new(&mut bytes);
    encoder.write_image(&pixels, radiance.width, radiance.height, ExtendedColorType::Rgb32F)?;
    Ok(bytes.into_inner())
}

/// NumPy array of shape (height, width, 3), little-endian float32, rows top to bottom, never
/// tone-mapped (NPY format 1.0: magic, version, header length, a Python dict padded to 64 bytes).
pub fn npy(radiance: &Radiance) -> Vec<u8> {
    const PREFIX_BYTES: usize = 10;
    let shape = format!("({}, {}, 3)", radiance.height, radiance.width);
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    while !(PREFIX_BYTES + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(radiance.rgb.iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn radiance() -> Radiance {
        Radiance { width: 3, height: 2, rgb: (0..18).map(|i| i as f32 * 0.25).collect() }
    }

    #[test]
    fn npy_is_what_numpy_reads() {
        let bytes = npy(&radiance());
        let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((header + 10) % 64, 0);
        let text = std::str::from_utf8(&bytes[10..10 + header]).unwrap();
        assert!(text.contains("'shape': (2, 3, 3)") && text.ends_with('\n'));
        assert_eq!(&bytes[10 + header + 4..10 + header + 8], &0.25f32.to_le_bytes());
        assert_eq!(bytes.len(), 10 + header + 18 * 4);
    }

    #[test]
    fn exr_and_png_round_trip() {
        let decoded = image::load_from_memory(&exr(&radiance()).unwrap()).unwrap().to_rgb32f();
        assert_eq!(decoded.as_raw(), &radiance().rgb);
        let picture = Picture { width: 2, height: 1, rgba: vec![1, 2, 3, 255, 250, 251, 252, 255] };
        let decoded = image::load_from_memory(&png(&picture).unwrap()).unwrap().to_rgb8();
        assert_eq!(decoded.as_raw(), &[1, 2, 3, 250, 251, 252]);
    }
}
