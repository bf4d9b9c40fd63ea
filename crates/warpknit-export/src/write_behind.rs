//! A file that is written while the next bytes of it are made.
//!
//! In: bytes, in order. They are copied into chunks. Out: a file with these bytes. A thread of
//! rayon's pool that has nothing else to do writes them.
//!
//! Method: full chunks wait in a queue. A thread holds the file's lock from taking a chunk to having
//! written it, so chunks reach the file in order. When too many chunks wait, the thread that makes
//! bytes writes one itself, for each that it adds. In a pool of one thread it writes all of them.
//!
//! Cost: one more copy in memory; the system takes about ten times as long for its own. All files
//! together keep at most [`MOST_WAITING`] chunks, and each keeps [`MOST_SPARE`] for later use. Not
//! promised: an error may be that of earlier bytes. The error of the last ones comes from
//! [`Write::flush`].

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};

/// Bytes of a chunk: so many that calls of the system don't count, and so few that a thread is soon
/// back at other work.
const CHUNK: usize = 1 << 18;
/// Chunks of all files that wait: 16 MB, as much as the tubes of two threads' blocks.
const MOST_WAITING: usize = 64;
/// Written chunks of a file whose memory is kept.
const MOST_SPARE: usize = 8;

/// Chunks of all files that wait now.
static WAITING: AtomicUsize = AtomicUsize::new(0);

/// A file that is written behind.
///
/// Dropped before it is flushed, it loses what waits. After an error it writes nothing more.
#[derive(Debug)]
pub(super) struct WriteBehind {
    /// The chunk that is being filled.
    chunk: Vec<u8>,
    shared: Arc<SharedFile>,
}

/// What the threads that write have in common.
#[derive(Debug)]
struct SharedFile {
    /// A thread that needs both locks this before the queue.
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
    /// The first error.
    failed: Option<io::Error>,
}

impl WriteBehind {
    /// Appends to an open file.
    pub(super) fn new(file: File) -> Self {
        let shared = SharedFile { file: Mutex::new(file), queue: Mutex::default() };
        Self { chunk: Vec::new(), shared: Arc::new(shared) }
    }

    /// The file itself, once it has all bytes.
    ///
    /// # Errors
    /// What the system said of any of them.
    pub(super) fn file(&mut self) -> io::Result<MutexGuard<'_, File>> {
        if !self.chunk.is_empty() {
            self.queue_chunk();
        }
        let mut file = lock(&self.shared.file);
        while self.shared.write_chunk(&mut file) {}
        self.shared.check()?;
        Ok(file)
    }

    /// Puts the chunk in the queue.
    fn queue_chunk(&mut self) {
        let mut queue = lock(&self.shared.queue);
        let spare = queue.spare.pop().unwrap_or_default();
        queue.waiting.push_back(std::mem::replace(&mut self.chunk, spare));
        WAITING.fetch_add(1, Ordering::Relaxed);
    }

    /// Sees to it that a thread writes what waits.
    fn write_waiting(&self) {
        let is_alone = rayon::current_num_threads() == 1;
        if is_alone || WAITING.load(Ordering::Relaxed) > MOST_WAITING {
            self.shared.write_chunk(&mut lock(&self.shared.file));
        }
        if !is_alone && !std::mem::replace(&mut lock(&self.shared.queue).has_task, true) {
            add_task(Arc::downgrade(&self.shared));
        }
    }
}

/// Has the pool write what waits, unless the file is dropped before. Each chunk is a task of its
/// own, so that a thread which waits for others goes on when they are done.
fn add_task(shared: Weak<SharedFile>) {
    rayon::spawn(move || {
        if shared.upgrade().is_some_and(|shared| shared.write_in_task()) {
            add_task(shared);
        }
    });
}

impl SharedFile {
    /// Writes a chunk, unless another thread is at the file. True if another task is needed. A task
    /// never waits for the file: the thread that has it could be waiting for the task.
    fn write_in_task(&self) -> bool {
        let mut file = match self.file.try_lock() {
            Ok(file) => Some(file),
            Err(TryLockError::Poisoned(file)) => Some(file.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        };
        if let Some(file) = &mut file {
            self.write_chunk(file);
        }
        let mut queue = lock(&self.queue);
        queue.has_task = file.is_some() && !queue.waiting.is_empty();
        queue.has_task
    }

    /// Writes the chunk that has waited longest. False if none waits.
    fn write_chunk(&self, file: &mut File) -> bool {
        let Some(mut chunk) = lock(&self.queue).take() else { return false };
        let written = file.write_all(&chunk);
        chunk.clear();
        let mut queue = lock(&self.queue);
        if queue.spare.len() < MOST_SPARE {
            queue.spare.push(chunk);
        }
        queue.failed = written.err();
        true
    }

    /// The first error, each time anew.
    fn check(&self) -> io::Result<()> {
        lock(&self.queue).failed.as_ref().map_or(Ok(()), |error| {
            Err(error
                .raw_os_error()
                .map_or_else(|| error.kind().into(), io::Error::from_raw_os_error))
        })
    }
}

impl Queue {
    /// The next chunk to be written. None after an error: later bytes would be at a wrong place.
    fn take(&mut self) -> Option<Vec<u8>> {
        if self.failed.is_some() {
            self.clear();
        }
        let chunk = self.waiting.pop_front()?;
        WAITING.fetch_sub(1, Ordering::Relaxed);
        Some(chunk)
    }

    fn clear(&mut self) {
        WAITING.fetch_sub(self.waiting.len(), Ordering::Relaxed);
        self.waiting.clear();
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        self.clear();
    }
}

/// Locks, also after a panic of another thread, which left whole chunks.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Write for WriteBehind {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.chunk.len() == CHUNK {
            self.shared.check()?;
            self.queue_chunk();
            self.write_waiting();
        }
        if self.chunk.capacity() == 0 {
            self.chunk.reserve_exact(CHUNK);
        }
        let count = bytes.len().min(CHUNK - self.chunk.len());
        self.chunk.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    /// Waits until the system has all bytes.
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
    use std::sync::mpsc;
    use std::time::{Duration, Instant};

    use super::*;

    /// Runs in a pool of so many threads.
    fn with_threads<T: Send>(threads: usize, run: impl FnOnce() -> T + Send) -> T {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run)
    }

    /// More than may wait.
    fn many() -> Vec<u8> {
        let places = 0..(MOST_WAITING + 9) * CHUNK + 5;
        places.map(|at| ((at * 31) ^ (at >> 11)).to_le_bytes()[0]).collect()
    }

    /// Writes them in pieces that end anywhere in a chunk.
    fn write_many(file: &mut WriteBehind, bytes: &[u8]) {
        bytes.chunks(99_991).try_for_each(|piece| file.write_all(piece)).unwrap();
    }

    fn content(file: &mut WriteBehind) -> Vec<u8> {
        let mut content = Vec::new();
        let mut file = file.file().unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        file.read_to_end(&mut content).unwrap();
        content
    }

    #[test]
    fn bytes_come_in_order_whatever_threads_write_them() {
        let bytes = many();
        for threads in [1, 2, 5] {
            let written = with_threads(threads, || {
                let mut file = WriteBehind::new(tempfile::tempfile().unwrap());
                write_many(&mut file, &bytes);
                file.seek(SeekFrom::Start(7)).unwrap();
                file.write_all(b"patched").unwrap();
                content(&mut file)
            });
            assert!(written[7..14] == *b"patched");
            assert!(written[..7] == bytes[..7] && written[14..] == bytes[14..], "{threads}");
        }
    }

    #[test]
    fn another_thread_writes_what_nobody_flushes() {
        with_threads(2, || {
            let own = tempfile::NamedTempFile::new().unwrap();
            let mut file = WriteBehind::new(own.reopen().unwrap());
            file.write_all(&[1; CHUNK + 1]).unwrap();
            let begun = Instant::now();
            while own.as_file().metadata().unwrap().len() < CHUNK as u64 {
                assert!(begun.elapsed() < Duration::from_secs(60), "no task writes");
                std::thread::yield_now();
            }
        });
    }

    #[test]
    fn bytes_are_written_while_no_other_thread_has_the_time() {
        let bytes = many();
        let written = with_threads(2, || {
            let mut file = WriteBehind::new(tempfile::tempfile().unwrap());
            let (end, ended) = mpsc::channel::<()>();
            rayon::scope(|scope| {
                scope.spawn(move |_| assert!(ended.recv().is_err()));
                write_many(&mut file, &bytes);
                let written = lock(&file.shared.file).metadata().unwrap().len();
                assert!(written >= 9 * CHUNK as u64, "more than the limit wait");
                drop(end);
            });
            content(&mut file)
        });
        assert!(written == bytes);
    }

    #[test]
    fn a_task_does_not_wait_for_the_file_and_a_later_chunk_has_another() {
        with_threads(2, || {
            let mut file = WriteBehind::new(tempfile::tempfile().unwrap());
            let (end, ended) = mpsc::channel::<()>();
            rayon::scope(|scope| {
                scope.spawn(move |_| assert!(ended.recv().is_err()));
                write_many(&mut file, &[1; CHUNK + 1]);
                let shared = Arc::clone(&file.shared);
                let at_file = lock(&shared.file);
                assert!(!shared.write_in_task() && !lock(&shared.queue).has_task);
                drop(at_file);
                // Also where so many wait that this thread writes one itself.
                write_many(&mut file, &many());
                assert!(lock(&shared.queue).has_task);
                drop(end);
            });
        });
    }

    #[test]
    fn after_an_error_nothing_more_is_taken() {
        for threads in [1, 2] {
            with_threads(threads, || {
                let own = tempfile::NamedTempFile::new().unwrap();
                let read_only = || WriteBehind::new(File::open(own.path()).unwrap());
                let mut file = read_only();
                file.write_all(b"few").unwrap();
                for _ in 0..2 {
                    assert!(file.flush().unwrap_err().raw_os_error().is_some());
                }
                assert!(file.seek(SeekFrom::Start(0)).is_err());
                let mut file = read_only();
                let mut pieces = (0..=2 * MOST_WAITING).map(|_| file.write_all(&[0; CHUNK]));
                assert!(pieces.any(|written| written.is_err()));
                drop(pieces);
                assert!(file.flush().is_err());
            });
        }
    }
}
