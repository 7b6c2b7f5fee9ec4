//! The bytes that a data set is read from.

use std::io::{self, Cursor, Read};

/// The unpacked bytes of a file, from front to back.
pub trait Bytes: Read {
    /// The file's name, for messages.
    fn file(&self) -> &str;

    /// Bytes given out or skipped so far.
    fn position(&self) -> u64;

    /// Upper bound on the number of bytes in the file.
    fn capacity(&self) -> u64;

    /// The next `length` bytes, fewer at the end of the file, which stay to be read.
    ///
    /// # Errors
    /// If the file cannot be read.
    fn peek(&mut self, length: usize) -> io::Result<&[u8]>;
}

/// A file whose bytes are in memory.
#[derive(Debug, Clone)]
pub struct InMemory<'a> {
    name: &'a str,
    bytes: Cursor<&'a [u8]>,
}

impl<'a> InMemory<'a> {
    /// The file `name` with these `bytes`, from byte `begin` on.
    pub fn new(name: &'a str, bytes: &'a [u8], begin: u64) -> Self {
        let mut bytes = Cursor::new(bytes);
        bytes.set_position(begin);
        Self { name, bytes }
    }

    /// The bytes that are left.
    fn rest(&self) -> &'a [u8] {
        let bytes: &'a [u8] = self.bytes.get_ref();
        let begin = usize::try_from(self.bytes.position()).ok();
        begin
            .and_then(|begin| bytes.get(begin..))
            .unwrap_or_default()
    }
}

impl Read for InMemory<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.bytes.read(buffer)
    }
}

impl Bytes for InMemory<'_> {
    fn file(&self) -> &str {
        self.name
    }

    fn position(&self) -> u64 {
        self.bytes.position()
    }

    fn capacity(&self) -> u64 {
        self.bytes.get_ref().len() as u64
    }

    fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        let rest = self.rest();
        Ok(&rest[..length.min(rest.len())])
    }
}
