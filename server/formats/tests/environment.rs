//! Environment images, written here and among the shared data.

#![allow(clippy::unwrap_used)]

mod common;

use std::path::Path;

use common::*;
use formats::{ENVIRONMENT_BUDGET, Environment, FormatError, Limits, read_environment};
use image::{Rgb, Rgb32FImage};

fn environment(path: &Path) -> Result<Environment, FormatError> {
    read_environment(path, &Limits::default())
}

/// A picture with a sun of one texel.
fn sky(width: u32, height: u32) -> Rgb32FImage {
    Rgb32FImage::from_fn(width, height, |x, y| match (x, y) {
        (3, 2) => Rgb([34_000.0, 33_000.0, 32_000.0]),
        _ => Rgb([0.25, 0.5 + y as f32, x as f32]),
    })
}

#[test]
fn small_images_come_through_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let image = sky(16, 8);
    let path = folder.path().join("a.exr");
    image.save(&path).unwrap();
    let read = environment(&path).unwrap();
    assert_eq!((read.width, read.height), (16, 8));
    assert_eq!(read.rgb, image.into_raw());
    assert!(read.notices.is_empty(), "{:?}", read.notices);
    // The content tells the format. Radiance HDR keeps eight bits of the brightest channel.
    let path = folder.path().join("a.picture");
    let image = sky(16, 8);
    let pixels: Vec<Rgb<f32>> = image.pixels().copied().collect();
    let file = std::fs::File::create(&path).unwrap();
    image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 16, 8).unwrap();
    let read = environment(&path).unwrap();
    for (found, expected) in read.rgb.as_chunks::<3>().0.iter().zip(&pixels) {
        let brightest = expected.0.into_iter().fold(0.0, f32::max);
        for (found, expected) in found.iter().zip(expected.0) {
            assert!((found - expected).abs() <= brightest / 128.0, "{found} {expected}");
        }
    }
}

#[test]
fn what_cannot_be_light_counts_as_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let mut image = sky(4, 4);
    image.put_pixel(0, 0, Rgb([-1.0, 2.0, 3.0]));
    image.put_pixel(1, 0, Rgb([f32::NAN, f32::INFINITY, 3.0]));
    image.put_pixel(2, 0, Rgb([1e30, 0.0, 0.0]));
    image.save(&path).unwrap();
    let read = environment(&path).unwrap();
    assert_eq!(read.rgb[..9], [0.0, 2.0, 3.0, 0.0, 0.0, 3.0, formats::MAX_RADIANCE, 0.0, 0.0]);
    for words in
        ["1 of 16 texels had negative", "1 of 16 texels were not finite", "1 of 16 texels were brighter"]
    {
        assert!(read.notices.iter().any(|notice| notice.contains(words)), "{:?}", read.notices);
    }
}

#[test]
fn large_images_keep_the_light_of_the_sphere() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let image = sky(2 * ENVIRONMENT_BUDGET[0] as u32 + 6, 10);
    image.save(&path).unwrap();
    let read = environment(&path).unwrap();
    assert_eq!((read.width, read.height), (ENVIRONMENT_BUDGET[0], 10));
    // Rows stay apart, so their sums over all columns must agree.
    for y in 0..10_u32 {
        let before: f64 = (0..image.width()).map(|x| f64::from(image.get_pixel(x, y).0[2])).sum();
        let row = &read.rgb[3 * read.width * y as usize..][..3 * read.width];
        let after: f64 = row.as_chunks::<3>().0.iter().map(|rgb| f64::from(rgb[2])).sum();
        let scale = f64::from(image.width()) / read.width as f64;
        assert!((after * scale / before - 1.0).abs() < 1e-6, "{after} {before}");
    }
}

#[test]
fn what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let says = |result: Result<Environment, FormatError>, words: &str| {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    says(environment(&write(folder.path(), "a.hdr", &[b"GIF89a"])), "OpenEXR");
    let lies = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 60000\nabcd";
    says(environment(&write(folder.path(), "b.hdr", &[lies])), "more than the limit");
    let lies = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 6000 +X 6000\nabcd";
    says(environment(&write(folder.path(), "c.hdr", &[lies])), "ends too early");
    let path = folder.path().join("d.exr");
    sky(64, 64).save(&path).unwrap();
    let limits = Limits { max_axis: 32, ..Limits::default() };
    says(read_environment(&path, &limits), "texels along an axis");
    let bytes = std::fs::read(&path).unwrap();
    assert!(environment(&write(folder.path(), "e.exr", &[&bytes[..bytes.len() / 2]])).is_err());
}

/// The decoder would reserve memory for a block of texels before it notices that none are there.
#[test]
fn a_header_that_lies_about_its_size_reserves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = include_bytes!("../fuzz/seeds/environment/zip.exr").to_vec();
    let key = b"dataWindow\0box2i\0";
    let window = bytes.windows(key.len()).position(|window| window == key).unwrap() + key.len() + 4;
    // From 9 x 6 texels to 2^29 x 16: one block of 100 GB.
    bytes[window + 8..window + 12].copy_from_slice(&0x1FFF_FFFF_u32.to_le_bytes());
    bytes[window + 12..window + 16].copy_from_slice(&15_u32.to_le_bytes());
    let message = environment(&write(folder.path(), "a.exr", &[&bytes])).unwrap_err().to_string();
    assert!(message.contains("texels along an axis"), "{message}");

    let limits = Limits { max_voxel_bytes: 9 * 6 * 12 - 1, ..Limits::default() };
    let path = write(folder.path(), "b.exr", &[include_bytes!("../fuzz/seeds/environment/zip.exr")]);
    let message = read_environment(&path, &limits).unwrap_err().to_string();
    assert!(message.contains("bytes of a block of texels"), "{message}");
}

#[test]
fn shared_environments_keep_their_suns() {
    let Some(folder) = shared_data("environment images") else {
        return;
    };
    for (name, brightest, negative, sums) in EXPECTED {
        let read = environment(&folder.join("environments").join(name)).unwrap();
        assert_eq!([read.width, read.height], [1024, 512], "{name}");
        assert_eq!(read.rgb.iter().copied().fold(0.0, f32::max), brightest, "{name}");
        for (channel, sum) in sums.into_iter().enumerate() {
            let found: f64 = read.rgb.iter().skip(channel).step_by(3).map(|v| f64::from(*v)).sum();
            assert!((found / sum - 1.0).abs() < 1e-5, "{name}: {found} {sum}");
        }
        let told = read.notices.iter().any(|notice| notice.starts_with(&format!("{negative} of")));
        assert!(told || negative == 0, "{name}: {:?}", read.notices);
    }
}

/// Largest value, texels with negative values, and sums of red, green and blue with negative values
/// as 0: the EXR files by OpenEXR 3.5.3, the HDR file by a decoder of its own in numpy.
const EXPECTED: [(&str, f32, u64, [f64; 3]); 4] = [
    ("city.exr", 33952.0, 299, [550683.51953745, 554535.35618192, 542818.02045059]),
    ("forest.exr", 1010.5, 784, [267539.97816443, 286455.52896166, 329153.47768062]),
    ("studio.exr", 118.375, 3, [120401.27195799, 136308.7951355, 146117.81761974]),
    ("studio_small_08_1k.hdr", 105.5, 0, [348178.09765625, 356851.31071472, 393065.83982849]),
];
