//! Files of any bytes: what comes back, what goes, what leaves nothing.

use super::*;

use crate::test_support::Folder;

const LONG: Duration = Duration::from_secs(20);
const PAYLOAD: u64 = PIECE_BYTES + 4;

fn done(photons: u64, directions: u32) -> Done {
    Done { photons, directions }
}

/// Stores a bake of which every byte is `value`, and waits for it.
fn put(store: &BakeStore, key: u8, value: u8, done: Done, payload: u64) -> bool {
    let Some(outgoing) = store.write([key; 32], done, payload) else { return false };
    let mut missing = payload;
    while missing > 0 {
        let length = missing.min(PIECE_BYTES);
        assert_eq!(outgoing.give(vec![value; length as usize]), Ok(true));
        missing -= length;
    }
    let mut writers = lock(&store.0.writers);
    while *writers > 0 {
        writers = store.0.written.wait(writers).unwrap();
    }
    true
}

fn get(store: &BakeStore, key: u8, payload: u64) -> Option<(Done, Vec<u8>)> {
    let incoming = store.read([key; 32], payload)?;
    let (mut found, mut bytes) = (None, Vec::new());
    loop {
        match incoming.next(LONG).unwrap() {
            Arrival::Begins(done) => found = Some(done),
            Arrival::Piece(piece) => bytes.extend(piece),
            Arrival::Ends => return Some((found.unwrap(), bytes)),
            Arrival::Nothing => return None,
        }
    }
}

fn names(folder: &Path) -> Vec<String> {
    let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

#[test]
fn what_is_stored_comes_back_and_more_replaces_less() {
    let folder = Folder::new();
    let store = BakeStore::open(folder.path(), 1 << 30).unwrap();
    assert!(store.read([1; 32], PAYLOAD).is_none());
    assert!(put(&store, 1, 7, done(10, 3), PAYLOAD));
    assert_eq!(get(&store, 1, PAYLOAD), Some((done(10, 3), vec![7; PAYLOAD as usize])));
    put(&store, 1, 8, done(10, 4), PAYLOAD);
    assert_eq!(get(&store, 1, PAYLOAD).unwrap().0, done(10, 4));
    put(&store, 1, 9, done(9, 9), PAYLOAD);
    assert_eq!(get(&store, 1, PAYLOAD), Some((done(10, 4), vec![8; PAYLOAD as usize])));
    drop(store);
    let store = BakeStore::open(folder.path(), 1 << 30).unwrap();
    assert!(get(&store, 1, PAYLOAD).is_some(), "it outlives the process");
}

#[test]
fn what_is_not_given_whole_leaves_nothing() {
    let folder = Folder::new();
    let leftover = folder.path().join("x.part");
    fs::write(&leftover, "half").unwrap();
    let store = BakeStore::open(folder.path(), 1 << 30).unwrap();
    assert!(!leftover.exists());
    let outgoing = store.write([1; 32], done(1, 1), PAYLOAD).unwrap();
    outgoing.give(vec![0; 100]).unwrap();
    drop(outgoing);
    // Closing waits for nobody who gives no more.
    let waiting = store.write([2; 32], done(1, 1), PAYLOAD).unwrap();
    drop(store);
    drop(waiting);
    assert!(names(folder.path()).is_empty(), "{:?}", names(folder.path()));
}

#[test]
fn what_was_not_used_for_longest_makes_room() {
    let folder = Folder::new();
    let one = HEAD_BYTES + 1000 + HASH_BYTES;
    let store = BakeStore::open(folder.path(), 3 * one).unwrap();
    let age = |key: u8, seconds: u64| {
        let file = File::options().append(true).open(store.0.path(&[key; 32])).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).unwrap();
    };
    for key in 1..=3 {
        put(&store, key, key, done(1, 1), 1000);
        age(key, 100 - u64::from(key));
    }
    assert!(get(&store, 1, 1000).is_some());
    put(&store, 4, 4, done(1, 1), 1000);
    let there = [1, 2, 3, 4].map(|key| store.0.path(&[key; 32]).exists());
    assert_eq!(there, [true, false, true, true]);
    assert!(!put(&store, 5, 5, done(1, 1), 4000), "larger than everything");
    drop(store);
    drop(BakeStore::open(folder.path(), 2 * one).unwrap());
    assert_eq!(names(folder.path()).len(), 2, "a smaller budget holds from the start");
}

#[test]
fn what_is_unsound_is_removed() {
    let folder = Folder::new();
    let store = BakeStore::open(folder.path(), 1 << 30).unwrap();
    let path = store.0.path(&[1; 32]);
    put(&store, 2, 5, done(1, 1), PAYLOAD);
    let others = fs::read(store.0.path(&[2; 32])).unwrap();
    type Harm = fn(&mut Vec<u8>);
    let harms: [Harm; 7] = [
        Vec::clear,
        |bytes| bytes.truncate(40),
        |bytes| bytes.truncate(bytes.len() - 1),
        |bytes| bytes.push(0),
        |bytes| bytes[HEAD_BYTES as usize + 5000] ^= 1,
        // As far as another bake, but not this one.
        |bytes| bytes[16] ^= 1,
        |bytes| bytes[8] += 1,
    ];
    for harm in harms {
        put(&store, 1, 7, done(1, 1), PAYLOAD);
        assert!(get(&store, 1, PAYLOAD).is_some());
        let mut bytes = fs::read(&path).unwrap();
        harm(&mut bytes);
        fs::write(&path, bytes).unwrap();
        assert!(get(&store, 1, PAYLOAD).is_none());
        assert!(!path.exists());
    }
    fs::write(&path, others).unwrap();
    assert!(get(&store, 1, PAYLOAD).is_none() && !path.exists(), "another one's");
    put(&store, 1, 7, done(1, 1), PAYLOAD);
    assert!(get(&store, 1, PAYLOAD - 4).is_none() && !path.exists(), "of another size");
}
