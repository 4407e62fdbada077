//! A bake's way to its file and back, a slice at a time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::store::{Arrival, BakeStore, Done, Incoming, Key, Outgoing, PIECE_BYTES};
use crate::error::RenderError;
use crate::gpu::Gpu;

/// How long a slice waits for a thread.
pub const WAIT: Duration = Duration::from_millis(2);
/// A bake under way is worked on at least this many times as long as it takes to be handed to the disk.
const WORK_PER_WRITING: u32 = 20;

/// What a bake has to do with a store.
pub struct Keeping {
    store: Arc<BakeStore>,
    key: Key,
    /// Among those who work on bakes.
    who: u64,
    /// How far somebody else is who makes the same bake, as long as that is waited for.
    elsewhere: Option<f32>,
    stage: Stage,
    /// When it was last handed to the disk, or began, and how long that took.
    since: Instant,
    took: Duration,
}

enum Stage {
    Idle,
    Reading { incoming: Incoming, done: Option<Done>, at: u64 },
    Writing { handing: Handing, began: Instant },
}

/// Matrices on their way from the device to a thread, a piece at a time.
pub struct Handing {
    outgoing: Outgoing,
    /// What there was no room for.
    waiting: Option<Vec<u8>>,
    at: u64,
}

/// What a slice of handing over came to.
#[derive(Debug, PartialEq, Eq)]
pub enum Handed {
    /// It goes on; the matrices must stay as they are.
    Part,
    All,
    /// Nobody takes any more.
    Refused,
}

impl Handing {
    pub fn new(outgoing: Outgoing) -> Self {
        Self { outgoing, waiting: None, at: 0 }
    }

    /// Reads and gives the next piece.
    ///
    /// # Errors
    /// GPU errors.
    pub fn step(&mut self, gpu: &Gpu, matrices: &Matrices<'_>) -> Result<Handed, RenderError> {
        let piece = match self.waiting.take() {
            Some(piece) => piece,
            None if self.at == matrices.bytes() => return Ok(Handed::All),
            None => {
                let piece = matrices.read(gpu, self.at)?;
                self.at += piece.len() as u64;
                piece
            }
        };
        match self.outgoing.give(piece) {
            Ok(true) => Ok(Handed::Part),
            Ok(false) => Ok(Handed::Refused),
            Err(piece) => {
                self.waiting = Some(piece);
                std::thread::sleep(WAIT);
                Ok(Handed::Part)
            }
        }
    }
}

/// What a slice came to.
#[derive(Debug, PartialEq, Eq)]
pub enum Step {
    /// There is nothing to do.
    Free,
    /// It goes on; the matrices must stay as they are.
    Busy,
    /// The matrices are those of the file.
    Loaded(Done),
    /// There was no file of use: matrices are empty.
    Missed,
    /// All is with the disk.
    Stored,
}

/// What is kept of a bake, one buffer behind the other.
pub struct Matrices<'a>(pub Vec<&'a wgpu::Buffer>);

impl Matrices<'_> {
    pub fn bytes(&self) -> u64 {
        self.0.iter().map(|buffer| buffer.size()).sum()
    }

    /// The buffer that holds the byte at a place, where that is in it, and how many bytes follow there.
    fn at(&self, place: u64) -> Option<(&wgpu::Buffer, u64, u64)> {
        let mut begins = 0;
        for buffer in &self.0 {
            if place < begins + buffer.size() {
                return Some((buffer, place - begins, begins + buffer.size() - place));
            }
            begins += buffer.size();
        }
        None
    }

    fn write(&self, gpu: &Gpu, mut place: u64, mut bytes: &[u8]) -> Result<(), RenderError> {
        while let Some((buffer, from, room)) = self.at(place).filter(|_| !bytes.is_empty()) {
            let (now, later) = bytes.split_at(room.min(bytes.len() as u64) as usize);
            gpu.queue.write_buffer(buffer, from, now);
            (place, bytes) = (place + now.len() as u64, later);
        }
        // What waits to be copied is bounded.
        gpu.queue.submit([]);
        gpu.wait()
    }

    fn read(&self, gpu: &Gpu, place: u64) -> Result<Vec<u8>, RenderError> {
        let Some((buffer, from, rest)) = self.at(place) else { return Ok(Vec::new()) };
        gpu.read_part(buffer, from, rest.min(PIECE_BYTES))
    }

    fn clear(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.0.iter().for_each(|buffer| encoder.clear_buffer(buffer, 0, None));
        gpu.queue.submit([encoder.finish()]);
    }
}

impl Keeping {
    /// Looks for the bake in the store.
    pub fn new(store: &Arc<BakeStore>, key: Key, matrices: &Matrices<'_>) -> Self {
        let mut keeping = Self::to_write(store, key);
        keeping.read(matrices);
        keeping
    }

    fn read(&mut self, matrices: &Matrices<'_>) {
        if let Some(incoming) = self.store.read(self.key, matrices.bytes()) {
            self.stage = Stage::Reading { incoming, done: None, at: 0 };
        }
    }

    /// Whether somebody else makes this bake, which has not begun: what they have made is read when they are
    /// done, or leave it. Waits for a moment.
    pub fn waits_for_another(&mut self, matrices: &Matrices<'_>) -> bool {
        if !self.is_idle() {
            return false;
        }
        let waited = self.elsewhere.is_some();
        self.elsewhere = self.store.made_by_another(&self.key, self.who);
        match self.elsewhere {
            Some(_) => std::thread::sleep(WAIT),
            None if waited => self.read(matrices),
            None => {}
        }
        self.elsewhere.is_some()
    }

    /// How far somebody else is, 0..1, whom this bake waits for.
    pub fn elsewhere(&self) -> Option<f32> {
        self.elsewhere
    }

    /// Says that this bake is worked on, and how far it is.
    pub fn is_worked_on(&mut self, progress: f32) {
        self.elsewhere = None;
        self.store.works_on(&self.key, self.who, progress);
    }

    /// Says that it is no longer.
    pub fn is_left(&self) {
        self.store.leaves(&self.key, self.who);
    }

    /// Of a bake that followed from another one: there is nothing to be read.
    pub fn to_write(store: &Arc<BakeStore>, key: Key) -> Self {
        let (stage, since, took) = (Stage::Idle, Instant::now(), Duration::ZERO);
        let who = store.newcomer();
        Self { store: store.clone(), key, who, elsewhere: None, stage, since, took }
    }

    /// Whether the matrices are not those of the file yet.
    pub fn is_reading(&self) -> bool {
        matches!(self.stage, Stage::Reading { .. })
    }

    /// Whether disk and matrices have nothing to do with each other now.
    pub fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::Idle)
    }

    /// Whether a bake under way should be written again.
    pub fn is_due(&self) -> bool {
        self.since.elapsed() >= self.store.checkpoint_interval().max(WORK_PER_WRITING * self.took)
    }

    /// Begins to write the matrices as they are; not where there is no room.
    pub fn write(&mut self, done: Done, matrices: &Matrices<'_>) {
        self.since = Instant::now();
        if let Some(outgoing) = self.store.write(self.key, done, matrices.bytes()) {
            self.stage = Stage::Writing { handing: Handing::new(outgoing), began: self.since };
        }
    }

    /// A slice of reading or writing.
    ///
    /// # Errors
    /// GPU errors.
    pub fn step(&mut self, gpu: &Gpu, matrices: &Matrices<'_>) -> Result<Step, RenderError> {
        let step = match &mut self.stage {
            Stage::Idle => return Ok(Step::Free),
            Stage::Reading { incoming, done, at } => match incoming.next(WAIT) {
                None => Step::Busy,
                Some(Arrival::Begins(begun)) => {
                    *done = Some(begun);
                    Step::Busy
                }
                Some(Arrival::Piece(piece)) => {
                    matrices.write(gpu, *at, &piece)?;
                    *at += piece.len() as u64;
                    Step::Busy
                }
                Some(Arrival::Ends) => done.map_or(Step::Missed, Step::Loaded),
                Some(Arrival::Nothing) => Step::Missed,
            },
            Stage::Writing { handing, began } => match handing.step(gpu, matrices)? {
                Handed::Part => Step::Busy,
                Handed::All => {
                    self.took = began.elapsed();
                    self.since = Instant::now();
                    Step::Stored
                }
                // It was said why.
                Handed::Refused => Step::Free,
            },
        };
        if step != Step::Busy {
            self.stage = Stage::Idle;
        }
        if step == Step::Missed {
            matrices.clear(gpu);
        }
        Ok(step)
    }
}

impl Drop for Keeping {
    fn drop(&mut self) {
        self.is_left();
    }
}
