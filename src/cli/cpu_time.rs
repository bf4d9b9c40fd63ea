//! The CPU time of this process, from the operating system.

/// CPU time that this process has taken, its threads together, ms; unknown on systems that don't
/// say.
pub(crate) fn cpu_ms() -> Option<f64> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(1e3 * time.tv_sec as f64 + 1e-6 * time.tv_nsec as f64)
    }
    #[cfg(not(unix))]
    None
}
