//! Silence of drivers that print.
//!
//! Mesa's Vulkan drivers print "error: XDG_RUNTIME_DIR is invalid" to stderr, although nothing fails.
//! In: nothing. Out: [`SilentStderr`]; while it lives, what this process writes to stderr is lost.
//! Not promised: that only drivers are silenced, so it must live shortly. Of two at once the later
//! would take the silence of the earlier for stderr, so there must be one only.

use std::fs::OpenOptions;
use std::io;
use std::os::fd::OwnedFd;

use rustix::stdio::dup2_stderr;

/// While it lives, stderr leads nowhere.
pub(super) struct SilentStderr {
    /// The true stderr.
    kept: OwnedFd,
}

impl SilentStderr {
    /// Begins the silence. `None` if the system refuses; then drivers are heard.
    pub(super) fn begin() -> Option<Self> {
        let kept = rustix::io::fcntl_dupfd_cloexec(io::stderr(), 0).ok()?;
        let nowhere = OpenOptions::new().write(true).open("/dev/null").ok()?;
        dup2_stderr(nowhere).ok()?;
        Some(Self { kept })
    }
}

impl Drop for SilentStderr {
    fn drop(&mut self) {
        // It was open before, so it can be opened again.
        let _spoken = dup2_stderr(&self.kept);
    }
}
