//! Memory limits for encoding and decoding.

/// Limit of the memory used beside the model. What does not fit is computed in parts; groups of
/// coded frames are shorter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    bytes: u64,
}

/// Limit where the system does not report its free memory, in bytes.
const UNKNOWN: u64 = 4 << 30;
/// Largest memory of buffered frames, in bytes, unless a single frame is larger.
const FRAMES_BYTES: u64 = 640 << 20;

impl Memory {
    /// A limit in bytes.
    pub fn at_most(bytes: u64) -> Self {
        Self { bytes }
    }

    /// Half of the free memory, also within the limits of a cgroup.
    pub fn half_of_free() -> Self {
        Self { bytes: free_bytes() / 2 }
    }

    /// Number of frames of `bytes` bytes to buffer, at most `most`.
    pub(crate) fn frames(self, bytes: usize, most: usize) -> usize {
        let room = FRAMES_BYTES.min(self.bytes / 4) as usize;
        (room / bytes.max(1)).clamp(1, most.max(1))
    }

    /// Whether to keep `Φ` in single precision: if it fits and more than one batch needs it.
    pub(crate) fn keeps(self, points: usize, columns: usize, batches: usize) -> bool {
        batches > 1 && 4 * (points as u64).saturating_mul(columns as u64) <= self.bytes / 2
    }
}

/// The free memory, also within the limits of a cgroup: what coordinates may take that cannot be
/// computed in parts. Asking for it tells nothing, as systems promise more than they have.
pub fn free_bytes() -> u64 {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
    let machine = read("/proc/meminfo").as_deref().and_then(available);
    let container =
        number("/sys/fs/cgroup/memory.max").zip(number("/sys/fs/cgroup/memory.current")).map(|(most, used)| {
            let files = read("/sys/fs/cgroup/memory.stat").map_or(0, |stat| kept_of_files(&stat));
            most.saturating_sub(used.saturating_sub(files))
        });
    machine.into_iter().chain(container).min().unwrap_or(2 * UNKNOWN)
}

/// `MemAvailable` of `/proc/meminfo`, in bytes.
fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Bytes of files that a cgroup's `memory.stat` counts, and that the system gives up.
fn kept_of_files(stat: &str) -> u64 {
    let names = ["active_file ", "inactive_file "];
    let of = |name| stat.lines().find_map(|line: &str| line.strip_prefix(name)?.trim().parse::<u64>().ok());
    names.into_iter().filter_map(of).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_the_system_keeps_in_memory_count_as_free() {
        assert_eq!(kept_of_files("anon 7\nfile 90\ninactive_anon 5\nactive_file 20\ninactive_file 30\n"), 50);
        assert_eq!(kept_of_files(""), 0);
    }

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
