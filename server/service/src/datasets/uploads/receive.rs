//! The bytes of one request, onto the end of an upload.

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use tokio::fs::File;
use tokio::io::{AsyncSeekExt, AsyncWriteExt};

use super::protocol::Checksum;
use super::{SYNC_BYTES, SYNC_INTERVAL, Turn, Upload};
use crate::App;
use crate::datasets::receive::{WRITE_BYTES, check_pace, next_piece};
use crate::problem::{Answer, Fault};

/// The end of an upload's file.
struct Tail {
    upload: Arc<Upload>,
    file: File,
    /// Received and not yet handed to the file system.
    buffer: Vec<u8>,
    /// Where the next byte goes.
    received: u64,
    /// What the record says.
    durable: u64,
    /// When it last changed.
    kept: Instant,
}

/// Appends a body to an upload. Without a checksum whatever arrived is kept, also when the body breaks
/// off; with one, all of it or nothing.
///
/// # Errors
/// The body broke off, was too slow or too long, did not have its checksum, was taken over by another
/// request, or the disk is full.
pub async fn receive(
    app: &App,
    upload: &Arc<Upload>,
    turn: &Turn,
    mut checksum: Option<Checksum>,
    body: Body,
) -> Answer<()> {
    let mut tail = Tail::open(upload.clone()).await?;
    let checked = checksum.is_some();
    let arrived = tail.append(app, turn, &mut checksum, body).await;
    let verdict = match (&arrived, checksum) {
        (Ok(()), Some(checksum)) => checksum.verify(),
        _ => arrived,
    };
    // What is beyond the upload's length, or beyond the disk, belongs to no upload.
    let useless = |fault: &Fault| matches!(fault.problem.status, 413 | 500 | 507);
    let kept = match &verdict {
        Err(fault) if checked || useless(fault) => Ok(()),
        _ => tail.keep().await,
    };
    // Anything not kept is cut off; where that fails, the next request writes over it.
    if tail.durable < tail.received {
        let _ = tail.file.set_len(tail.durable).await;
    }
    verdict.and(kept)
}

fn disk_failed(error: std::io::Error) -> Fault {
    Fault::disk("writing an upload", &error)
}

impl Tail {
    async fn open(upload: Arc<Upload>) -> Answer<Self> {
        let offset = upload.record().offset;
        let mut file = File::options().write(true).open(&upload.place.data).await.map_err(disk_failed)?;
        file.seek(std::io::SeekFrom::Start(offset)).await.map_err(disk_failed)?;
        Ok(Self { upload, file, buffer: Vec::new(), received: offset, durable: offset, kept: Instant::now() })
    }

    /// Takes a body piece by piece.
    async fn append(
        &mut self,
        app: &App,
        turn: &Turn,
        checksum: &mut Option<Checksum>,
        body: Body,
    ) -> Answer<()> {
        let (began, start, length) = (Instant::now(), self.received, self.upload.record().length);
        let mut pieces = body.into_data_stream();
        loop {
            // Only waiting is broken off, never a write.
            let piece = tokio::select! {
                biased;
                () = turn.stop.cancelled() => {
                    return Err(Fault::locked("Another request goes on with this upload."));
                }
                () = app.closing().cancelled() => {
                    return Err(Fault::busy("The service stops; what arrived is kept."));
                }
                piece = next_piece(&mut pieces) => piece?,
            };
            let Some(piece) = piece else { return Ok(()) };
            if piece.len() as u64 > length - self.received {
                return Err(Fault::too_large(format!("The upload was announced with {length} bytes.")));
            }
            if let Some(checksum) = checksum {
                checksum.update(&piece);
            }
            self.buffer.extend_from_slice(&piece);
            self.received += piece.len() as u64;
            check_pace(self.received - start, began)?;
            if self.buffer.len() >= WRITE_BYTES {
                self.write().await?;
            }
            let due = self.received - self.durable >= SYNC_BYTES || self.kept.elapsed() >= SYNC_INTERVAL;
            if checksum.is_none() && due {
                self.keep().await?;
            }
        }
    }

    async fn write(&mut self) -> Answer<()> {
        self.file.write_all(&self.buffer).await.map_err(disk_failed)?;
        self.file.flush().await.map_err(disk_failed)?;
        self.buffer.clear();
        Ok(())
    }

    /// Makes everything received durable, and says so in the record.
    async fn keep(&mut self) -> Answer<()> {
        if self.received == self.durable {
            return Ok(());
        }
        self.write().await?;
        self.file.sync_data().await.map_err(disk_failed)?;
        let offset = self.received;
        self.upload
            .persist(|record| {
                record.offset = offset;
                record.touched_unix_millis = crate::unix_millis();
            })
            .await?;
        self.durable = offset;
        self.kept = Instant::now();
        Ok(())
    }
}
