//! OME-Zarr hierarchies, written here chunk by chunk.

#![allow(clippy::unwrap_used)]

mod common;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use common::*;
use formats::{Limits, ReadOptions, read_volume};
use serde_json::{Value, json};

/// Value at a place, different everywhere.
fn value(z: usize, y: usize, x: usize) -> u16 {
    (100 * z + 10 * y + x) as u16
}

/// Version 2 or 3 metadata of an image with axes z, y, x and one level for each path.
fn image(version: u8, paths: &[&str]) -> Value {
    let axes: Vec<Value> = ["z", "y", "x"]
        .iter()
        .map(|name| json!({"name": name, "type": "space", "unit": "micrometer"}))
        .collect();
    let datasets: Vec<Value> = paths
        .iter()
        .enumerate()
        .map(|(i, path)| {
            let scale: Vec<f64> = [2.0, 1.0, 0.5].iter().map(|s| s * f64::from(1 << i)).collect();
            json!({"path": path, "coordinateTransformations": [{"type": "scale", "scale": scale}]})
        })
        .collect();
    let multiscales = json!([{"version": "0.4", "axes": axes, "datasets": datasets}]);
    match version {
        2 => json!({"multiscales": multiscales}),
        _ => json!({"zarr_format": 3, "node_type": "group",
                    "attributes": {"ome": {"version": "0.5", "multiscales": multiscales}}}),
    }
}

fn put(root: &Path, key: &str, bytes: &[u8]) {
    let path = root.join(key);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// What compresses a chunk.
type Pack<'a> = &'a dyn Fn(Vec<u8>) -> Vec<u8>;

/// An array of 3 x 4 x 5 in chunks of 2 x 3 x 4, packed by the closure.
fn version2(root: &Path, compressor: Value, pack: Pack<'_>) {
    put(root, ".zattrs", image(2, &["0"]).to_string().as_bytes());
    let array = json!({"zarr_format": 2, "shape": [3, 4, 5], "chunks": [2, 3, 4], "dtype": "<u2",
        "compressor": compressor, "fill_value": 77, "order": "C", "filters": null, "dimension_separator": "/"});
    put(root, "0/.zarray", array.to_string().as_bytes());
    for (cz, cy, cx) in chunks() {
        put(root, &format!("0/{cz}/{cy}/{cx}"), &pack(chunk(cz, cy, cx)));
    }
}

fn chunks() -> impl Iterator<Item = (usize, usize, usize)> {
    (0..8).map(|i| (i / 4, i / 2 % 2, i % 2))
}

fn chunk(cz: usize, cy: usize, cx: usize) -> Vec<u8> {
    (0..24).flat_map(|i| value(2 * cz + i / 12, 3 * cy + i / 4 % 3, 4 * cx + i % 4).to_le_bytes()).collect()
}

fn expected() -> Vec<f64> {
    (0..60).map(|i| f64::from(value(i / 20, i / 5 % 4, i % 5))).collect()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A Blosc buffer of one block whose bytes are shuffled and compressed with zlib.
fn blosc(bytes: &[u8]) -> Vec<u8> {
    let values = bytes.len() / 2;
    let shuffled: Vec<u8> = (0..bytes.len()).map(|i| bytes[i % values * 2 + i / values]).collect();
    let packed = zlib(&shuffled);
    let word = |n: usize| (n as u32).to_le_bytes();
    [
        &[2, 1, 0x01 | 0x10 | 3 << 5, 2][..],
        &word(bytes.len()),
        &word(bytes.len()),
        &word(24 + packed.len()),
        &word(20),
        &word(packed.len()),
        &packed,
    ]
    .concat()
}

#[test]
fn codecs_of_version_2() {
    let folder = tempfile::tempdir().unwrap();
    let packs: [(Value, Pack<'_>); 5] = [
        (Value::Null, &|bytes| bytes),
        (json!({"id": "gzip"}), &|bytes| gzip(&bytes)),
        (json!({"id": "zlib"}), &|bytes| zlib(&bytes)),
        (json!({"id": "blosc", "cname": "zlib"}), &|bytes| blosc(&bytes)),
        (json!({"id": "zstd"}), &|bytes| {
            ruzstd::encoding::compress_to_vec(&bytes[..], ruzstd::encoding::CompressionLevel::Fastest)
        }),
    ];
    for (compressor, pack) in packs {
        version2(folder.path(), compressor.clone(), pack);
        let imported = read(folder.path()).unwrap();
        assert_eq!(data(&imported), expected(), "{compressor}");
        assert_eq!(imported.volume.spacing, [0.5, 1.0, 2.0]);
        assert_eq!(imported.volume.spacing_unit.as_deref(), Some("um"));
        assert_eq!(imported.format.name(), "ome-zarr");
    }
    // The metadata may be named instead of the folder.
    assert_eq!(data(&read(&folder.path().join(".zattrs")).unwrap()), expected());
    fs::remove_file(folder.path().join("0/1/1/1")).unwrap();
    let imported = read(folder.path()).unwrap();
    assert_eq!(imported.volume.value(4, 3, 2), 77.0);
    noticed(&imported, "1 of 8 chunks");
}

fn array3(codecs: &Value, chunk: [u64; 3]) -> Value {
    json!({"zarr_format": 3, "node_type": "array", "shape": [3, 4, 5], "data_type": "uint16",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": codecs, "fill_value": 0})
}

fn bytes_codec() -> Value {
    json!({"name": "bytes", "configuration": {"endian": "little"}})
}

#[test]
fn shards_of_version_3() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    put(root, "zarr.json", image(3, &["0"]).to_string().as_bytes());
    for at_end in [true, false] {
        let location = if at_end { "end" } else { "start" };
        let inner = json!([bytes_codec(), {"name": "gzip", "configuration": {"level": 1}}]);
        let sharding = json!({"name": "sharding_indexed", "configuration": {"chunk_shape": [2, 3, 4],
            "codecs": inner, "index_codecs": [bytes_codec()], "index_location": location}});
        put(root, "0/zarr.json", array3(&json!([sharding]), [4, 6, 8]).to_string().as_bytes());
        let (mut body, mut table) = (Vec::new(), Vec::new());
        for (cz, cy, cx) in chunks() {
            let packed = gzip(&chunk(cz, cy, cx));
            let offset = body.len() as u64 + if at_end { 0 } else { 8 * 16 };
            table.extend(offset.to_le_bytes());
            table.extend((packed.len() as u64).to_le_bytes());
            body.extend(packed);
        }
        let shard = if at_end { [body, table].concat() } else { [table, body].concat() };
        put(root, "0/c/0/0/0", &shard);
        assert_eq!(data(&read(root).unwrap()), expected(), "{location}");
    }
}

#[test]
fn a_zip_archive_reads_like_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    version2(folder.path(), Value::Null, &|bytes| bytes);
    let archive = |prefix: &str| -> PathBuf {
        let path = folder.path().join("a.zip");
        let mut zip = zip::ZipWriter::new(fs::File::create(&path).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        let names = chunks().map(|(z, y, x)| format!("0/{z}/{y}/{x}"));
        for name in names.chain([".zattrs".into(), "0/.zarray".into()]) {
            zip.start_file(format!("{prefix}{name}"), options).unwrap();
            zip.write_all(&fs::read(folder.path().join(name)).unwrap()).unwrap();
        }
        zip.finish().unwrap();
        path
    };
    for prefix in ["", "scan.ome.zarr/"] {
        assert_eq!(data(&read(&archive(prefix)).unwrap()), expected());
    }
    refused(read(&archive("../")), "a.zip", &["points out of the archive"]);
}

#[test]
fn the_finest_level_that_fits_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    version2(root, Value::Null, &|bytes| bytes);
    put(root, ".zattrs", image(2, &["0", "1", "2"]).to_string().as_bytes());
    for (path, size) in [("1", 2), ("2", 1)] {
        let array = json!({"zarr_format": 2, "shape": [size, size, size], "chunks": [2, 2, 2], "dtype": "|u1",
            "compressor": null, "fill_value": 0, "order": "C", "filters": null});
        put(root, &format!("{path}/.zarray"), array.to_string().as_bytes());
        put(root, &format!("{path}/0.0.0"), &[1, 2, 3, 4, 5, 6, 7, 8]);
    }
    let finest = read(root).unwrap();
    noticed(&finest, "level 0 of 3");
    let limits = Limits { max_voxel_bytes: 20, ..Limits::default() };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    let coarse = read_volume(root, &options).unwrap();
    assert_eq!((data(&coarse), coarse.volume.spacing), ((1..9).map(f64::from).collect(), [1.0, 2.0, 4.0]));
    noticed(&coarse, "level 0 is too large");
    // A level without a single chunk has nothing to show.
    fs::remove_dir_all(root.join("0")).unwrap();
    put(root, "0/.zarray", &fs::read(root.join("1/.zarray")).unwrap());
    noticed(&read(root).unwrap(), "level 0 has no chunks");
}

#[test]
fn what_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    version2(root, Value::Null, &|bytes| bytes);
    let array = fs::read_to_string(root.join("0/.zarray")).unwrap();
    let attributes = fs::read_to_string(root.join(".zattrs")).unwrap();
    for (from, to, words) in [
        ("\"<u2\"", "\"|O\"", "dtype"),
        ("\"filters\":null", "\"filters\":[{\"id\":\"pickle\"}]", "filters"),
        ("\"compressor\":null", "\"compressor\":{\"id\":\"secret\"}", "compressor"),
        ("\"chunks\":[2,3,4]", "\"chunks\":[0,3,4]", "chunks"),
        ("\"chunks\":[2,3,4]", "\"chunks\":[2,3]", "chunks"),
        ("\"chunks\":[2,3,4]", "\"chunks\":[2,3,5]", "chunk"),
        ("\"chunks\":[2,3,4]", "\"chunks\":[4294967296,4294967296,4294967296]", "bytes of a chunk"),
        ("\"shape\":[3,4,5]", "\"shape\":[99999999999,4,5]", "shape"),
        ("\"fill_value\":77", "\"fill_value\":\"NaN\"", "fill_value"),
        ("\"fill_value\":77", "\"fill_value\":77777", "fill_value"),
    ] {
        let changed = array.replace(from, to);
        assert_ne!(changed, array, "{from}");
        put(root, "0/.zarray", changed.as_bytes());
        refused(read(root), "", &[words]);
    }
    put(
        root,
        "0/.zarray",
        array.replace("[3,4,5]", "[4096,4096,4096]").replace("[2,3,4]", "[1,1,1]").as_bytes(),
    );
    refused(read(root), "", &["more than the limit"]);
    put(root, "0/.zarray", array.as_bytes());
    for (from, to, words) in [
        ("\"path\":\"0\"", "\"path\":\"../../etc\"", "path"),
        ("\"path\":\"0\"", "\"path\":\"gone\"", "gone"),
        ("\"datasets\"", "\"sets\"", "datasets"),
        ("[2.0,1.0,0.5]", "[2.0,1.0]", "scale"),
        ("[2.0,1.0,0.5]", "[2.0,1.0,0.0]", "scale"),
        ("multiscales", "images", "multiscales"),
        ("\"name\":\"z\"", "\"name\":\"Y\"", "there twice"),
    ] {
        let changed = attributes.replace(from, to);
        assert_ne!(changed, attributes, "{from}");
        put(root, ".zattrs", changed.as_bytes());
        refused(read(root), "", &[words]);
    }
}

#[test]
fn axes_without_the_usual_names_keep_the_order_of_the_array() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    version2(root, Value::Null, &|bytes| bytes);
    let attributes = fs::read_to_string(root.join(".zattrs")).unwrap();
    for name in ["", "xy", "depth"] {
        put(
            root,
            ".zattrs",
            attributes.replace("\"name\":\"z\"", &format!("\"name\":\"{name}\"")).as_bytes(),
        );
        let imported = read(root).unwrap_or_else(|refused| panic!("{name}: {refused}"));
        assert_eq!(data(&imported), expected(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("a.ome.zarr");
    version2(&root, Value::Null, &|bytes| bytes);
    let chunk = root.join("0/0/0/0");
    fs::rename(&chunk, folder.path().join("outside")).unwrap();
    std::os::unix::fs::symlink(folder.path().join("outside"), &chunk).unwrap();
    refused(read(&root), "", &["links"]);
}
