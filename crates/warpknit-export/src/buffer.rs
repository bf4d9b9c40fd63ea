//! Bytes on their way to a file: made in parallel in reused memory, and written in order.

use std::fmt;

use rayon::prelude::*;

use super::ExportError;

/// Bytes that grow at their end.
#[derive(Debug, Default)]
pub(super) struct Buffer {
    /// Longer than the content: bytes behind `length` are left over and will be overwritten. So no
    /// byte is zeroed twice.
    bytes: Vec<u8>,
    length: usize,
}

impl Buffer {
    /// Forgets everything but keeps the memory.
    pub(super) fn clear(&mut self) {
        self.length = 0;
    }

    pub(super) fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// Appends so many bytes of any value, for the caller to overwrite.
    pub(super) fn grow(&mut self, count: usize) -> &mut [u8] {
        let start = self.length;
        self.length += count;
        if self.bytes.len() < self.length {
            self.bytes.resize(self.length.max(2 * self.bytes.len()), 0);
        }
        &mut self.bytes[start..self.length]
    }

    /// The first bytes, to be overwritten.
    pub(super) fn start(&mut self, count: usize) -> &mut [u8] {
        &mut self.bytes[..count]
    }

    /// Removes the last bytes.
    pub(super) fn shrink(&mut self, count: usize) {
        self.length -= count;
    }
}

impl fmt::Write for Buffer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.grow(text.len()).copy_from_slice(text.as_bytes());
        Ok(())
    }
}

/// Makes bytes of items in parallel, one item a thread, and writes them in order.
#[derive(Debug, Default)]
pub(super) struct BufferPool {
    /// They keep their memory: after the first items nothing is allocated.
    buffers: Vec<Buffer>,
}

impl BufferPool {
    /// Writes all items. `make` puts an item's bytes into an empty buffer.
    ///
    /// # Errors
    /// The first error of `write`.
    pub(super) fn write_each<T: Sync>(
        &mut self,
        items: &[T],
        make: impl Fn(&T, &mut Buffer) + Sync,
        mut write: impl FnMut(&[u8]) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let threads = rayon::current_num_threads();
        self.buffers.resize_with(threads, Buffer::default);
        for items in items.chunks(threads) {
            items.par_iter().zip(&mut self.buffers).for_each(|(item, buffer)| {
                buffer.clear();
                make(item, buffer);
            });
            let made = &self.buffers[..items.len()];
            made.iter().try_for_each(|buffer| write(buffer.as_bytes()))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_are_written_in_order_whatever_made_them() {
        let items: Vec<u32> = (0..100).collect();
        let expected: String = items.iter().map(u32::to_string).collect();
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (mut buffers, mut written) = (BufferPool::default(), Vec::new());
            for items in items.chunks(34) {
                let make = |item: &u32, buffer: &mut Buffer| {
                    fmt::Write::write_str(buffer, &item.to_string()).unwrap();
                };
                let mut write = |bytes: &[u8]| {
                    written.extend_from_slice(bytes);
                    Ok(())
                };
                pool.install(|| buffers.write_each(items, make, &mut write)).unwrap();
            }
            assert_eq!(String::from_utf8(written).unwrap(), expected);
        }
    }
}
