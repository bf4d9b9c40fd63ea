//! A file that is written while the next bytes of it are made.
//!
//! In: bytes, in order. They are copied into chunks. Out: a file with these bytes, which the
//! system takes from any thread of rayon's pool that has nothing else to do.
//!
//! Method: full chunks wait in a queue. Who takes one out holds the lock of the file until it is
//! written, so chunks reach the file in order whatever thread writes them. Where no thread has the
//! time, the queue fills up, and who adds to it writes all that waits. A pool of one thread writes
//! each chunk at once, so that one thread works at a time.
//!
//! Cost: a copy in memory, some tenth of what the system takes for its own, and memory for
//! [`MOST_WAITING`] chunks at most. Not promised: that an error is that of the bytes at hand. It may
//! be that of earlier ones; of the last ones it shows with [`Write::flush`].

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// Bytes of a chunk: so many that calls of the system don't count, and so few that a thread is soon
/// back at other work.
const CHUNK: usize = 1 << 18;
/// Chunks that wait at most: 16 MB, as much as the tubes of two threads' blocks.
const MOST_WAITING: usize = 64;

/// A file that takes bytes and writes them behind.
///
/// Dropped before it is flushed, it loses what waits.
#[derive(Debug)]
pub(super) struct WriteBehind {
    /// The chunk that is being filled.
    chunk: Vec<u8>,
    shared: Arc<Shared>,
}

/// What the threads that write have in common.
#[derive(Debug)]
struct Shared {
    /// Locked before the queue by who needs both.
    file: Mutex<File>,
    queue: Mutex<Queue>,
}

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<Vec<u8>>,
    /// Memory of chunks that are written.
    spare: Vec<Vec<u8>>,
    /// Whether the pool has a task that writes what waits.
    has_task: bool,
    /// The first error that nobody was told of.
    failed: Option<io::Error>,
}

impl WriteBehind {
    /// Appends to an open file.
    pub(super) fn new(file: File) -> Self {
        let shared = Shared { file: Mutex::new(file), queue: Mutex::default() };
        Self { chunk: Vec::new(), shared: Arc::new(shared) }
    }

    /// The file itself, which holds all bytes so far.
    ///
    /// # Errors
    /// What the system said of any of them.
    pub(super) fn file(&mut self) -> io::Result<MutexGuard<'_, File>> {
        if !self.chunk.is_empty() {
            self.hand_over();
        }
        while self.shared.write_chunk() {}
        self.shared.tell()?;
        Ok(lock(&self.shared.file))
    }

    /// Puts the chunk in the queue, and sees to it that somebody writes it.
    fn hand_over(&mut self) {
        let mut queue = lock(&self.shared.queue);
        let spare = queue.spare.pop().unwrap_or_default();
        queue.waiting.push_back(std::mem::replace(&mut self.chunk, spare));
        let is_full = queue.waiting.len() > MOST_WAITING || rayon::current_num_threads() == 1;
        let has_task = std::mem::replace(&mut queue.has_task, !is_full);
        drop(queue);
        if is_full {
            while self.shared.write_chunk() {}
        } else if !has_task {
            add_task(Arc::downgrade(&self.shared));
        }
    }
}

/// Has the pool write what waits, unless the file is dropped before. Each chunk is a task of its
/// own, so that the thread can go back to what others wait for.
fn add_task(shared: Weak<Shared>) {
    rayon::spawn(move || {
        if shared.upgrade().is_some_and(|shared| shared.write_chunk()) {
            add_task(shared);
        }
    });
}

impl Shared {
    /// Writes the chunk that has waited longest. False if none waits.
    fn write_chunk(&self) -> bool {
        let mut file = lock(&self.file);
        let mut queue = lock(&self.queue);
        let Some(mut chunk) = queue.waiting.pop_front() else {
            queue.has_task = false;
            return false;
        };
        drop(queue);
        let written = file.write_all(&chunk);
        chunk.clear();
        let mut queue = lock(&self.queue);
        queue.spare.push(chunk);
        if let Err(error) = written {
            queue.failed.get_or_insert(error);
        }
        true
    }

    /// The error that nobody was told of.
    fn tell(&self) -> io::Result<()> {
        lock(&self.queue).failed.take().map_or(Ok(()), Err)
    }
}

/// Locks, also after a panic of another thread, which left whole chunks.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Write for WriteBehind {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.chunk.len() == CHUNK {
            self.hand_over();
            self.shared.tell()?;
        }
        if self.chunk.capacity() == 0 {
            self.chunk.reserve_exact(CHUNK);
        }
        let count = bytes.len().min(CHUNK - self.chunk.len());
        self.chunk.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    /// Waits until the system has taken all bytes.
    fn flush(&mut self) -> io::Result<()> {
        self.file().map(drop)
    }
}

impl Seek for WriteBehind {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.file()?.seek(position)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;

    /// Runs in a pool of so many threads.
    fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
    }

    #[test]
    fn bytes_come_in_order_whatever_threads_write_them() {
        // More than may wait, in pieces that end anywhere in a chunk.
        let bytes: Vec<u8> = (0..(MOST_WAITING + 9) * CHUNK + 5)
            .map(|at| ((at * 31) ^ (at >> 11)).to_le_bytes()[0])
            .collect();
        for threads in [1, 2, 5] {
            let written = with_threads(threads, || {
                let mut file = WriteBehind::new(tempfile::tempfile().unwrap());
                bytes.chunks(99_991).try_for_each(|piece| file.write_all(piece)).unwrap();
                file.seek(SeekFrom::Start(7)).unwrap();
                file.write_all(b"patched").unwrap();
                let mut written = Vec::new();
                let mut file = file.file().unwrap();
                file.seek(SeekFrom::Start(0)).unwrap();
                file.read_to_end(&mut written).unwrap();
                written
            });
            assert!(written[7..14] == *b"patched");
            assert!(written[..7] == bytes[..7] && written[14..] == bytes[14..], "{threads}");
        }
    }

    #[test]
    fn an_error_is_told_once_with_later_bytes_or_at_the_end() {
        for threads in [1, 2] {
            with_threads(threads, || {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join("read_only");
                std::fs::write(&path, "").unwrap();
                let mut file = WriteBehind::new(File::open(&path).unwrap());
                file.write_all(b"few").unwrap();
                assert!(file.flush().is_err());
                file.flush().unwrap();
                let mut many = (0..MOST_WAITING + 9).map(|_| file.write_all(&[0; CHUNK]));
                assert!(many.any(|written| written.is_err()));
            });
        }
    }
}
