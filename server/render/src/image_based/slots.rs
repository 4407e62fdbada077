//! Which record is kept where on the device, and for which scene each was computed.

use std::sync::Arc;

use scene::Snapshot;

/// Slots of a chunk: of one buffer of rays.
pub const CHUNK_SLOTS: u32 = 4096;
/// Most snapshots that records may stem from; those of the oldest are forgotten beyond it.
const MAX_BASES: usize = 8;
/// Records in a row that are worked on together; such rows are taken in an order that spreads over the
/// volume, so that light appears everywhere at once.
const ROW: usize = 64;

const NONE: u32 = u32::MAX;

/// A record that is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slot {
    /// Index in the grid, x fastest; `NONE`: the slot is free.
    record: u32,
    /// What its rays were cast for: an identifier in `bases`; 0: not cast.
    base: u32,
    /// Which light its coefficients are the product with; 0: with none.
    lit: u64,
}

/// Work on records of one chunk that stem from one scene.
pub struct Group {
    /// The buffer.
    pub chunk: usize,
    /// What their rays were cast for; `None`: they were not.
    pub base: Option<Arc<Snapshot>>,
    /// Slots within the chunk, with the cell of the record (10 bits each along x, y, z).
    pub entries: Vec<[u32; 2]>,
}

/// The bookkeeping.
pub struct Slots {
    dims: [u32; 3],
    of_record: Vec<u32>,
    slots: Vec<Slot>,
    free: Vec<u32>,
    bases: Vec<(u32, Arc<Snapshot>)>,
    last_base: u32,
    /// Cells of records that are no longer needed, whose texels are still there.
    left: Vec<u32>,
}

impl Slots {
    /// None yet, of a grid.
    pub fn new(dims: [u32; 3]) -> Self {
        let records = dims.iter().map(|&n| n as usize).product();
        Self {
            dims,
            of_record: vec![NONE; records],
            slots: Vec::new(),
            free: Vec::new(),
            bases: Vec::new(),
            last_base: 0,
            left: Vec::new(),
        }
    }

    /// Records kept.
    pub fn len(&self) -> usize {
        self.slots.len() - self.free.len()
    }

    /// Chunks that hold them.
    #[cfg(test)]
    pub fn chunks(&self) -> usize {
        self.slots.len().div_ceil(CHUNK_SLOTS as usize)
    }

    /// Keeps these records of the grid from now on, and no other.
    pub fn keep(&mut self, needed: &[bool]) {
        for (record, &needed) in needed.iter().enumerate() {
            let slot = self.of_record[record];
            if !needed && slot != NONE {
                self.slots[slot as usize] = Slot { record: NONE, base: 0, lit: 0 };
                self.free.push(slot);
                self.of_record[record] = NONE;
                self.left.push(self.code(record as u32));
            }
        }
        for (record, &needed) in needed.iter().enumerate() {
            if needed && self.of_record[record] == NONE {
                let new = Slot { record: record as u32, base: 0, lit: 0 };
                let slot = match self.free.pop() {
                    Some(slot) => slot,
                    None => {
                        self.slots.push(new);
                        self.slots.len() as u32 - 1
                    }
                };
                self.slots[slot as usize] = new;
                self.of_record[record] = slot;
            }
        }
    }

    /// Cells whose texels are to become nothing; forgotten by the call.
    pub fn take_left(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.left)
    }

    /// An identifier for what rays are cast for from now on.
    pub fn base_of(&mut self, snapshot: &Arc<Snapshot>) -> u32 {
        if let Some((id, _)) = self.bases.iter().find(|(_, base)| Arc::ptr_eq(base, snapshot)) {
            return *id;
        }
        let used: std::collections::BTreeSet<u32> = self.slots.iter().map(|slot| slot.base).collect();
        self.bases.retain(|(id, _)| used.contains(id));
        if self.bases.len() >= MAX_BASES {
            let (oldest, _) = self.bases.remove(0);
            self.slots.iter_mut().filter(|slot| slot.base == oldest).for_each(|slot| slot.base = 0);
        }
        self.last_base += 1;
        self.bases.push((self.last_base, snapshot.clone()));
        self.last_base
    }

    /// The identifier of a scene that rays were cast for.
    pub fn base_id(&self, snapshot: &Arc<Snapshot>) -> Option<u32> {
        self.bases.iter().find(|(_, base)| Arc::ptr_eq(base, snapshot)).map(|(id, _)| *id)
    }

    /// All scenes that rays of some record were cast for.
    pub fn bases(&self) -> Vec<(u32, Arc<Snapshot>)> {
        self.bases.clone()
    }

    /// Says of all records cast for one scene that they are, as they stand, those of another.
    pub fn rename(&mut self, from: u32, to: u32) {
        self.slots.iter_mut().filter(|slot| slot.base == from).for_each(|slot| slot.base = to);
    }

    /// All that are kept, by chunk.
    pub fn all(&self) -> Vec<(usize, Vec<[u32; 2]>)> {
        let chunk = |(chunk, slots): (usize, &[Slot])| {
            let kept = slots.iter().enumerate().filter(|(_, slot)| slot.record != NONE);
            (chunk, kept.map(|(index, slot)| [index as u32, self.code(slot.record)]).collect())
        };
        self.slots.chunks(CHUNK_SLOTS as usize).enumerate().map(chunk).collect()
    }

    /// Records that are up to date.
    pub fn done(&self, base: u32, lit: u64) -> usize {
        self.slots.iter().filter(|slot| slot.record != NONE && (slot.base, slot.lit) == (base, lit)).count()
    }

    /// What is to be done until all records stand for a base and a light, the longest neglected first.
    pub fn todo(&self, base: u32, lit: u64) -> Vec<Group> {
        let mut groups: Vec<(usize, u32, Vec<[u32; 2]>)> = Vec::new();
        for row in spread(self.slots.len().div_ceil(ROW)) {
            let first = row * ROW;
            for (index, slot) in self.slots.iter().enumerate().skip(first).take(ROW) {
                if slot.record == NONE || (slot.base, slot.lit) == (base, lit) {
                    continue;
                }
                let chunk = index / CHUNK_SLOTS as usize;
                let entry = [index as u32 % CHUNK_SLOTS, self.code(slot.record)];
                match groups.iter_mut().find(|(c, b, _)| (*c, *b) == (chunk, slot.base)) {
                    Some((_, _, entries)) => entries.push(entry),
                    None => groups.push((chunk, slot.base, vec![entry])),
                }
            }
        }
        groups.sort_by_key(|(chunk, base, _)| (*base, *chunk));
        let held = |id: u32| self.bases.iter().find(|(base, _)| *base == id).map(|(_, base)| base.clone());
        groups.into_iter().map(|(chunk, base, entries)| Group { chunk, base: held(base), entries }).collect()
    }

    /// Notes that entries of a chunk are done.
    pub fn finish(&mut self, chunk: usize, entries: &[[u32; 2]], base: u32, lit: u64) {
        for [slot, _] in entries {
            let slot = &mut self.slots[chunk * CHUNK_SLOTS as usize + *slot as usize];
            (slot.base, slot.lit) = (base, lit);
        }
    }

    fn code(&self, record: u32) -> u32 {
        let [nx, ny, _] = self.dims;
        (record % nx) | ((record / nx % ny) << 10) | ((record / nx / ny) << 20)
    }
}

/// 0..count, each once, spread evenly from the beginning on (bits reversed).
fn spread(count: usize) -> impl Iterator<Item = usize> {
    let bits = usize::BITS - count.saturating_sub(1).leading_zeros();
    let reversed = move |i: usize| if bits == 0 { 0 } else { i.reverse_bits() >> (usize::BITS - bits) };
    (0..1usize << bits).map(reversed).filter(move |&i| i < count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_takes_each_once() {
        for count in [0, 1, 2, 5, 64, 100] {
            let mut all: Vec<usize> = spread(count).collect();
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
        assert_eq!(spread(8).take(3).collect::<Vec<_>>(), [0, 4, 2]);
    }

    fn cells(groups: &[Group]) -> Vec<u32> {
        let mut cells: Vec<u32> =
            groups.iter().flat_map(|g| g.entries.iter().map(|[_, cell]| *cell)).collect();
        cells.sort_unstable();
        cells
    }

    #[test]
    fn records_keep_their_slots_and_free_ones_serve_again() {
        let mut slots = Slots::new([4, 2, 1]);
        let mut needed = vec![true, true, false, false, true, false, false, false];
        slots.keep(&needed);
        assert_eq!((slots.len(), slots.chunks()), (3, 1));
        let all = slots.todo(1, 1);
        assert_eq!(cells(&all), [0, 1, 1 << 10]);
        assert!(all.len() == 1 && all[0].base.is_none());
        let entries = all[0].entries.clone();
        slots.finish(0, &entries[..2], 1, 1);
        assert_eq!((slots.done(1, 1), slots.todo(1, 1)[0].entries.len()), (2, 1));
        assert_eq!(slots.todo(1, 2).len(), 2, "another light: all of them, by what their rays stem from");
        needed[1] = false;
        needed[7] = true;
        slots.keep(&needed);
        assert_eq!(slots.take_left(), [1]);
        assert!(slots.take_left().is_empty());
        assert_eq!((slots.len(), slots.chunks()), (3, 1));
        let todo = slots.todo(1, 1);
        assert!(cells(&todo).contains(&(3 | 1 << 10)));
    }
}
