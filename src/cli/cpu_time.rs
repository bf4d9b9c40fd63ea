//! The CPU time of this process, from the operating system.

/// CPU time of all threads of this process together, ms. `None` on systems without such a clock.
pub(crate) fn cpu_ms() -> Option<f64> {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        Some(1e3 * time.tv_sec as f64 + 1e-6 * time.tv_nsec as f64)
    }
    #[cfg(not(unix))]
    None
}
