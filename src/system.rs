//! Facts from the operating system about this process and its machine: memory and the processor.
//!
//! They are read from Linux's `/proc`. On other systems they are unknown.

use crate::ids::index32;

/// The processor's name.
#[must_use]
pub fn processor() -> Option<String> {
    line("/proc/cpuinfo", "model name")
}

/// Memory of the machine, GB.
#[must_use]
pub fn memory_gb() -> Option<f64> {
    bytes("/proc/meminfo", "MemTotal").map(|bytes| bytes / 1e9)
}

/// Memory that this process can still get without swapping, GB: what the machine has free, what the
/// limit of its address space leaves (`ulimit -v`), and what that of its control group leaves.
#[must_use]
pub fn available_memory_gb() -> Option<f64> {
    let free = bytes("/proc/meminfo", "MemAvailable");
    let found = [free, room_in_address_space(), room_in_control_group()].into_iter().flatten();
    found.reduce(f64::min).map(|bytes| bytes.max(0.0) / 1e9)
}

/// The limit of this process's address space (`ulimit -v`), GB. `None` without one.
#[must_use]
pub fn address_space_gb() -> Option<f64> {
    address_space().map(|bytes| bytes / 1e9)
}

/// The same in bytes.
fn address_space() -> Option<f64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let limit = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    limit.split_whitespace().next()?.parse().ok()
}

/// Address space that glibc's allocator sets aside for each thread, bytes. A failed allocation is one
/// of these more often than not.
const ARENA: f64 = 67.2e6;

/// Bytes that the limit of the address space leaves. `None` without a limit.
fn room_in_address_space() -> Option<f64> {
    let threads = f64::from(index32(rayon::current_num_threads()) + 1);
    Some(address_space()? - bytes("/proc/self/status", "VmSize")? - threads * ARENA)
}

/// Bytes that the limit of the control group leaves, in which containers run. `None` without one.
fn room_in_control_group() -> Option<f64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let folder = std::path::Path::new("/sys/fs/cgroup").join(own);
    let number = |name: &str| -> Option<f64> {
        std::fs::read_to_string(folder.join(name)).ok()?.trim().parse().ok()
    };
    // Without a limit the file says `max`, which is no number.
    Some(number("memory.max")? - number("memory.current")?)
}

/// The peak memory of this process, MB. 0 if unknown.
#[must_use]
pub fn peak_memory_mb() -> f64 {
    bytes("/proc/self/status", "VmHWM").map_or(0.0, |bytes| bytes / 1e6)
}

/// The current memory of this process, MB. 0 if unknown.
#[must_use]
pub fn resident_memory_mb() -> f64 {
    bytes("/proc/self/status", "VmRSS").map_or(0.0, |bytes| bytes / 1e6)
}

/// Resets [`peak_memory_mb`] to the current memory, if Linux allows it.
pub fn forget_peak_memory() {
    // 5 resets the peak (man 5 proc). If it is refused, the peak stays that of the whole process.
    let _kept = std::fs::write("/proc/self/clear_refs", "5");
}

/// The number of a line, in bytes. Linux gives it in units of 1024 bytes and calls them kB.
fn bytes(file: &str, name: &str) -> Option<f64> {
    line(file, name)?.trim_end_matches("kB").trim().parse().ok().map(|units: f64| 1024.0 * units)
}

/// The text after `name` and a colon in one of the system's files.
fn line(file: &str, name: &str) -> Option<String> {
    let text = std::fs::read_to_string(file).ok()?;
    let found =
        text.lines().filter_map(|line| line.split_once(':')).find(|(at, _)| at.trim() == name);
    found.map(|(_, value)| value.trim().to_owned())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn linux_tells_what_is_asked() {
        assert!(memory_gb() >= available_memory_gb() && available_memory_gb() > Some(0.0));
        // Other tests run beside this one, one of them has the peak counted anew, and counts lag
        // behind by some pages.
        let held = resident_memory_mb();
        assert!(held > 1.0 && peak_memory_mb() > held / 2.0);
        assert_eq!(line("/proc/self/status", "no such line"), None);
    }
}
