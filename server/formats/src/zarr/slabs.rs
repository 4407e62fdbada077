//! The voxels of one channel and time, chunk by chunk: a reader that yields them slab by slab
//! along the slowest axis of space.

use std::collections::BTreeMap;
use std::io::{self, Read};

use rayon::prelude::*;

use super::array::Array;
use super::codec;
use super::store::{Part, Store};
use crate::error::FormatError;

/// Largest chunk that is decoded, bytes.
const MAX_CHUNK_BYTES: u64 = 1 << 30;
/// Stored bytes may exceed the chunk's by so many, where it does not compress.
const STORED_SLACK_BYTES: u64 = 1 << 20;
/// Bytes of chunks that are decoded at the same time.
const BATCH_BYTES: u64 = 256 << 20;
/// Most chunks of a volume.
const MAX_CHUNKS: u64 = 1 << 18;
/// Most inner chunks of a shard.
const MAX_SHARD_CHUNKS: u64 = 1 << 20;
/// Offset and length of an inner chunk that is not there.
const NOT_STORED: u64 = u64::MAX;

/// What to read of an array.
pub(super) struct Cut {
    /// Axes of the array that are space, slowest first; one to three of them.
    pub(super) space: Vec<usize>,
    /// Index along every axis that is not space; 0 for the others.
    pub(super) at: Vec<u64>,
}

/// Reads the values of a cut, the last axis of space fastest.
pub(super) struct Slabs {
    store: Store,
    path: String,
    array: Array,
    cut: Cut,
    /// Number of the next chunk along the slowest axis of space.
    next: u64,
    slab: Vec<u8>,
    /// Bytes of `slab` that have been handed out.
    given: usize,
    /// Tables of the shards of this slab.
    shard_tables: BTreeMap<String, Option<Vec<[u64; 2]>>>,
    /// Chunks that are not stored.
    missing: u64,
    total: u64,
    on_end: Box<dyn FnMut(u64, u64)>,
}

/// Checks the chunks of an array against the limits; to be called before voxels are read.
pub(super) fn check(file: &str, array: &Array, cut: &Cut, max_slab_bytes: u64) -> Result<(), FormatError> {
    let too_large = |what: &'static str, got: u128, limit: u64| {
        Err(FormatError::TooLarge { file: file.to_owned(), what, got: got.to_string(), limit })
    };
    let product = |sizes: &mut dyn Iterator<Item = u64>| {
        sizes.fold(1_u128, |product, size| product.saturating_mul(u128::from(size)))
    };
    let chunk_bytes = product(&mut array.chunk.iter().copied().chain([array.value_bytes()]));
    if chunk_bytes > u128::from(MAX_CHUNK_BYTES) {
        return too_large("bytes of a chunk", chunk_bytes, MAX_CHUNK_BYTES);
    }
    let chunks = product(&mut cut.space.iter().map(|axis| array.shape[*axis].div_ceil(array.chunk[*axis])));
    if chunks > u128::from(MAX_CHUNKS) {
        return too_large("chunks of the volume", chunks, MAX_CHUNKS);
    }
    let slab = product(&mut cut.space.iter().skip(1).map(|axis| array.shape[*axis]));
    let thickness = cut.space.first().map_or(1, |axis| array.chunk[*axis].min(array.shape[*axis]));
    let slab_bytes = slab.saturating_mul(u128::from(thickness) * u128::from(array.value_bytes()));
    if slab_bytes > u128::from(max_slab_bytes) {
        return too_large("bytes of a slab of chunks", slab_bytes, max_slab_bytes);
    }
    let in_shard = array.shard.as_ref().map_or(1, |shard| product(&mut shard.counts.iter().copied()));
    if in_shard > u128::from(MAX_SHARD_CHUNKS) {
        return too_large("inner chunks of a shard", in_shard, MAX_SHARD_CHUNKS);
    }
    Ok(())
}

impl Slabs {
    /// `on_end` is told how many of how many chunks were not stored.
    pub(super) fn new(
        store: Store,
        path: String,
        array: Array,
        cut: Cut,
        on_end: Box<dyn FnMut(u64, u64)>,
    ) -> Self {
        Self {
            store,
            path,
            array,
            cut,
            next: 0,
            slab: Vec::new(),
            given: 0,
            shard_tables: BTreeMap::new(),
            missing: 0,
            total: 0,
            on_end,
        }
    }

    /// Decodes the next slab; false after the last.
    fn advance(&mut self) -> Result<bool, FormatError> {
        let (array, cut) = (&self.array, &self.cut);
        let slowest = cut.space[0];
        let start = self.next * array.chunk[slowest];
        if start >= array.shape[slowest] {
            return Ok(false);
        }
        let value = array.value_bytes() as usize;
        let thickness = array.chunk[slowest].min(array.shape[slowest] - start) as usize;
        let sizes: Vec<usize> = cut.space.iter().skip(1).map(|axis| array.shape[*axis] as usize).collect();
        let values = thickness * sizes.iter().product::<usize>();
        self.slab.clear();
        self.given = 0;
        self.slab.reserve_exact(values * value);
        for _ in 0..values {
            self.slab.extend_from_slice(&array.fill);
        }

        // The chunks of the slab, in batches: fetched one by one, decoded at once.
        let counts: Vec<u64> =
            cut.space.iter().skip(1).map(|axis| array.shape[*axis].div_ceil(array.chunk[*axis])).collect();
        let chunk_bytes = array.chunk.iter().product::<u64>() * array.value_bytes();
        let batch = (BATCH_BYTES / chunk_bytes).clamp(1, 64);
        let all: u64 = counts.iter().product();
        for first in (0..all).step_by(batch as usize) {
            let mut stored = Vec::new();
            for number in first..(first + batch).min(all) {
                let mut coordinates: Vec<u64> =
                    self.cut.at.iter().zip(&self.array.chunk).map(|(at, chunk)| at / chunk).collect();
                coordinates[slowest] = self.next;
                let mut rest = number;
                for (axis, count) in self.cut.space.iter().skip(1).zip(&counts).rev() {
                    coordinates[*axis] = rest % count;
                    rest /= count;
                }
                self.total += 1;
                match self.fetch(&coordinates, chunk_bytes)? {
                    Some(bytes) => stored.push((coordinates, bytes)),
                    None => self.missing += 1,
                }
            }
            let codecs = &self.array.codecs;
            let decoded: Vec<_> = stored
                .into_par_iter()
                .map(|(at, bytes)| codec::decode(codecs, bytes, chunk_bytes).map(|plain| (at, plain)))
                .collect();
            for result in decoded {
                let (coordinates, plain) = result.map_err(|why| {
                    FormatError::corrupt(&self.store.file, format!("a chunk of {}: {why}", self.path))
                })?;
                self.place(&coordinates, &plain, thickness, &sizes);
            }
        }
        self.shard_tables.clear();
        self.next += 1;
        Ok(true)
    }

    /// The stored bytes of a chunk.
    fn fetch(&mut self, at: &[u64], chunk_bytes: u64) -> Result<Option<Vec<u8>>, FormatError> {
        let most = chunk_bytes.saturating_mul(2).saturating_add(STORED_SLACK_BYTES);
        let key_of = |array: &Array, path: &str, at: &[u64]| format!("{path}/{}", array.keys.key(at));
        let Some(shard) = self.array.shard.clone() else {
            let key = key_of(&self.array, &self.path, at);
            return self.store.get(&key, Part::Whole, most);
        };
        let shard_at: Vec<u64> = at.iter().zip(&shard.counts).map(|(at, count)| at / count).collect();
        let key = key_of(&self.array, &self.path, &shard_at);
        if !self.shard_tables.contains_key(&key) {
            let inner: u64 = shard.counts.iter().product();
            let table_bytes = inner * 16;
            let stored_bytes = table_bytes + 4 * shard.index_codecs.len() as u64;
            let part = if shard.index_at_end { Part::End(stored_bytes) } else { Part::At(0, stored_bytes) };
            let table = match self.store.get(&key, part, stored_bytes)? {
                None => None,
                Some(bytes) => {
                    let bytes = codec::decode(&shard.index_codecs, bytes, table_bytes).map_err(|why| {
                        FormatError::corrupt(&self.store.file, format!("the table of {key}: {why}"))
                    })?;
                    let (words, _) = bytes.as_chunks::<8>();
                    let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
                    Some(words.as_chunks::<2>().0.to_vec())
                }
            };
            self.shard_tables.insert(key.clone(), table);
        }
        let Some(Some(table)) = self.shard_tables.get(&key) else { return Ok(None) };
        let number = at.iter().zip(&shard.counts).fold(0, |number, (at, count)| number * count + at % count);
        match table.get(number as usize) {
            None | Some([NOT_STORED, NOT_STORED]) => Ok(None),
            Some([offset, length]) => self.store.get(&key, Part::At(*offset, *length), most),
        }
    }

    /// Copies the part of a chunk that lies in the slab and in the array.
    fn place(&mut self, coordinates: &[u64], plain: &[u8], thickness: usize, sizes: &[usize]) {
        let (array, cut) = (&self.array, &self.cut);
        let value = array.value_bytes() as usize;
        // Bytes between neighbours along each axis of the chunk.
        let mut strides = vec![0; array.chunk.len()];
        let mut stride = value;
        for axis in array.order.iter().rev() {
            strides[*axis] = stride;
            stride *= array.chunk[*axis] as usize;
        }
        let fixed: usize = (0..array.chunk.len())
            .filter(|axis| !cut.space.contains(axis))
            .map(|axis| (cut.at[axis] % array.chunk[axis]) as usize * strides[axis])
            .sum();
        // Up to three axes: slab rows [a][b][c], of which there may be fewer.
        let axis_of = |k: usize| cut.space.get(k).copied();
        let start_of =
            |k: usize| axis_of(k).map_or(0, |axis| (coordinates[axis] * array.chunk[axis]) as usize);
        let size_of = |k: usize| sizes.get(k - 1).copied().unwrap_or(1);
        let length_of = |k: usize| {
            axis_of(k).map_or(1, |axis| (array.chunk[axis] as usize).min(size_of(k) - start_of(k)))
        };
        let stride_of = |k: usize| axis_of(k).map_or(0, |axis| strides[axis]);
        let (start_b, length_b) = (start_of(1), length_of(1));
        let (start_c, length_c, stride_c) = (start_of(2), length_of(2), stride_of(2));
        for a in 0..thickness {
            for b in 0..length_b {
                let from = fixed + a * stride_of(0) + b * stride_of(1);
                let to = ((a * size_of(1) + start_b + b) * size_of(2) + start_c) * value;
                if stride_c == value {
                    let row = length_c * value;
                    self.slab[to..to + row].copy_from_slice(&plain[from..from + row]);
                } else {
                    for c in 0..length_c {
                        let (from, to) = (from + c * stride_c, to + c * value);
                        self.slab[to..to + value].copy_from_slice(&plain[from..from + value]);
                    }
                }
            }
        }
    }
}

impl Read for Slabs {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.slab.len() {
            if !self.advance().map_err(io::Error::other)? {
                (self.on_end)(self.missing, self.total);
                return Ok(0);
            }
        }
        let step = buffer.len().min(self.slab.len() - self.given);
        buffer[..step].copy_from_slice(&self.slab[self.given..self.given + step]);
        self.given += step;
        Ok(step)
    }
}
