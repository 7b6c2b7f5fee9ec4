//! How much memory this process may have.

use std::path::Path;

/// Where Linux tells the memory limit of the group of processes that this one belongs to, as a container sees it:
/// cgroups of version 2 and 1. Without a limit they hold `max`, or more than any machine has.
const GROUP_LIMITS: [&str; 2] = [
    "/sys/fs/cgroup/memory.max",
    "/sys/fs/cgroup/memory/memory.limit_in_bytes",
];

/// Bytes of memory that the process may have: the least of its own limits, that of its container and that of the
/// machine, as far as the system tells them.
pub fn process_memory() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(Path::new(path)).ok();
    let groups = GROUP_LIMITS
        .iter()
        .filter_map(|&path| read(path)?.trim().parse().ok());
    let machine = read("/proc/meminfo").and_then(|text| total_of(&text));
    own_limits().into_iter().chain(groups).chain(machine).min()
}

/// Bytes of `MemTotal` in the text of `/proc/meminfo`.
fn total_of(text: &str) -> Option<u64> {
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1 << 10)
}

/// The limits that the process was started with.
#[cfg(unix)]
fn own_limits() -> Vec<u64> {
    use rustix::process::{Resource, getrlimit};
    let limits = [Resource::Data, Resource::As].map(getrlimit);
    limits
        .into_iter()
        .filter_map(|limit| limit.current)
        .collect()
}

#[cfg(not(unix))]
fn own_limits() -> Vec<u64> {
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_the_machine_is_read() {
        let text = "MemFree:  7 kB\nMemTotal:       24053384 kB\nMemAvailable:   1 kB\n";
        assert_eq!(total_of(text), Some(24_053_384 << 10));
        assert_eq!(total_of("MemTotal: much\n"), None);
        assert_eq!(total_of(""), None);
        if cfg!(target_os = "linux") {
            assert!(process_memory().unwrap() > 1 << 20);
        }
    }
}
