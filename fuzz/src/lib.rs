//! Fuzz targets: one for everything that reads bytes from outside.
//!
//! A target takes any bytes and panics where the reader breaks a promise: it panics, it accepts what cannot be right, it takes
//! more memory than the bytes justify. The tests of this crate run each target for a moment with [`mutate`]; `make fuzz` runs
//! each for as long as wanted, led by coverage.

mod disk;
#[path = "../../proto/tests/support/memory.rs"]
mod memory;
pub mod mutate;
mod targets;

use memory::peak_of_all_threads;
pub use targets::TARGETS;

/// Something that reads bytes from outside.
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// Gives it bytes; panics where it breaks a promise.
    pub run: fn(&[u8]),
    /// Bytes that it takes, to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// What its format is made of.
    pub words: &'static [&'static str],
    /// Bytes of memory that it may take whatever comes.
    pub fixed: usize,
    /// Bytes of memory that it may take for each byte that comes.
    pub per_byte: usize,
}

impl Target {
    /// The target of this name.
    pub fn find(name: &str) -> Option<&'static Self> {
        TARGETS.iter().find(|target| target.name == name)
    }

    /// Gives it bytes and looks at the memory too.
    ///
    /// # Panics
    /// Where a promise is broken.
    pub fn check(&self, bytes: &[u8]) {
        let ((), peak) = peak_of_all_threads(|| (self.run)(bytes));
        let most = self.fixed + self.per_byte * bytes.len();
        assert!(
            peak <= most,
            "{}: {peak} bytes of memory for {} bytes, where {most} are the most",
            self.name,
            bytes.len()
        );
    }
}
