//! Times of passes by the device's own clock, where it has one: without handing over and waiting.
//!
//! Every dispatch is framed by two timestamps. They come along with the next buffer that is read back,
//! so that measuring costs no wait of its own.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Dispatches whose times can be pending; of more in a row no time is told.
const MOST_PENDING: u32 = 1024;
/// Bytes of a timestamp.
const STAMP_BYTES: u64 = wgpu::QUERY_SIZE as u64;

/// The device's clock.
pub(crate) struct DeviceClock {
    stamps: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    millis_per_tick: f64,
    recorded: Mutex<Recorded>,
}

#[derive(Default)]
struct Recorded {
    /// Dispatches whose stamps were not read yet.
    pending: u32,
    /// Time of those that were read.
    millis: f64,
    /// Some were not stamped.
    incomplete: bool,
}

impl DeviceClock {
    /// What the device needs to be asked for.
    pub const FEATURES: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY;

    /// The clock of a device; `None` if it has none.
    pub fn of(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        let millis_per_tick = f64::from(queue.get_timestamp_period()) / 1e6;
        if !device.features().contains(Self::FEATURES) || millis_per_tick <= 0.0 {
            return None;
        }
        let stamps = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: 2 * MOST_PENDING,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: 2 * u64::from(MOST_PENDING) * STAMP_BYTES,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { stamps, resolved, millis_per_tick, recorded: Mutex::default() })
    }

    /// The right to use the stamps; to be held until the work that writes or reads them is submitted,
    /// because a device waits for ever for stamps that come later.
    pub fn turn(&self) -> Turn<'_> {
        Turn { clock: self, recorded: self.recorded() }
    }

    fn recorded(&self) -> MutexGuard<'_, Recorded> {
        self.recorded.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in stamps that were copied.
    pub fn take_in(&self, bytes: &[u8]) {
        let ticks: Vec<[u64; 2]> = bytemuck::pod_collect_to_vec(bytes);
        // A clock that was set anew between two stamps tells nothing.
        let spans = ticks.iter().map(|[begin, end]| end.saturating_sub(*begin) as f64);
        self.recorded().millis += spans.sum::<f64>() * self.millis_per_tick;
    }

    /// Time of the dispatches whose stamps were taken in since the last call, milliseconds; `None` if
    /// there were more than could be stamped.
    pub fn take_millis(&self) -> Option<f64> {
        let mut recorded = self.recorded();
        let millis = (!recorded.incomplete).then_some(recorded.millis);
        (recorded.millis, recorded.incomplete) = (0.0, false);
        millis
    }
}

/// See [`DeviceClock::turn`].
pub(crate) struct Turn<'a> {
    clock: &'a DeviceClock,
    recorded: MutexGuard<'a, Recorded>,
}

impl Turn<'_> {
    /// Stamps for the next dispatch; `None` if all are pending.
    pub fn stamps(&mut self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        if self.recorded.pending == MOST_PENDING {
            self.recorded.incomplete = true;
            return None;
        }
        let first = 2 * self.recorded.pending;
        self.recorded.pending += 1;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.clock.stamps,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Bytes that the pending stamps take.
    pub fn pending_bytes(&self) -> u64 {
        2 * u64::from(self.recorded.pending) * STAMP_BYTES
    }

    /// Copies the pending stamps to a place in a buffer; then none is pending.
    pub fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, at: u64) {
        let bytes = self.pending_bytes();
        if bytes == 0 {
            return;
        }
        encoder.resolve_query_set(&self.clock.stamps, 0..2 * self.recorded.pending, &self.clock.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.clock.resolved, 0, to, at, bytes);
        self.recorded.pending = 0;
    }
}
