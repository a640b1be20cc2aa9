//! How much memory a job may take for what grows with the model.

/// A limit for what a job holds beside the model itself. What does not fit is computed in parts, with the same result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    bytes: u64,
}

/// Where the system does not tell what is free.
const UNKNOWN: u64 = 4 << 30;
/// Frames on their way take at most this much, unless a single one already takes more.
const FRAMES_BYTES: u64 = 640 << 20;

impl Memory {
    /// At most so many bytes.
    pub fn at_most(bytes: u64) -> Self {
        Self { bytes }
    }

    /// Half of what is free, in the container that the process runs in as well.
    pub fn half_of_free() -> Self {
        let read = |path: &str| std::fs::read_to_string(path).ok();
        let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
        let machine = read("/proc/meminfo").as_deref().and_then(available);
        let container = number("/sys/fs/cgroup/memory.max")
            .zip(number("/sys/fs/cgroup/memory.current"))
            .map(|(most, used)| most.saturating_sub(used));
        Self { bytes: machine.into_iter().chain(container).min().unwrap_or(2 * UNKNOWN) / 2 }
    }

    /// Frames of so many bytes that are on their way together, at most as many as asked for.
    pub(crate) fn frames(self, bytes: usize, most: usize) -> usize {
        let room = FRAMES_BYTES.min(self.bytes / 4) as usize;
        (room / bytes.max(1)).clamp(1, most.max(1))
    }

    /// Whether to keep `Φ` in single precision for so many batches of frames: where it fits, and more than one needs it.
    pub(crate) fn keeps(self, points: usize, columns: usize, batches: usize) -> bool {
        batches > 1 && 4 * (points as u64).saturating_mul(columns as u64) <= self.bytes / 2
    }
}

/// Bytes that are available, as Linux tells them.
fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_available_is_read_from_the_system() {
        assert_eq!(available("MemTotal:  8 kB\nMemAvailable:    2048 kB\n"), Some(2 << 20));
        assert_eq!(available("MemTotal:  8 kB\n"), None);
        assert!(Memory::half_of_free().bytes > 0);
    }

    #[test]
    fn a_gigabyte_holds_few_large_frames_and_no_large_coordinates() {
        let gigabyte = Memory::at_most(1 << 30);
        assert_eq!(
            (gigabyte.frames(24_000_000, 80), gigabyte.frames(1 << 40, 80), gigabyte.frames(1, 80)),
            (11, 1, 80)
        );
        assert!(!gigabyte.keeps(1_000_000, 350, 500) && gigabyte.keeps(100_000, 350, 500));
        assert!(!gigabyte.keeps(100_000, 350, 1), "one batch needs them once");
    }
}
