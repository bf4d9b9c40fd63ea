//! What happens at Ctrl-C, when the system asks the program to end, and when a file outgrows its
//! limit.
//!
//! The temporary files of unfinished outputs are removed, then the program dies by the same signal,
//! as shells and scripts expect (a shell shows 130 after Ctrl-C). SIGKILL can't be heard; what that
//! leaves, the next run removes.

use std::fs;
use std::io;
use std::process;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;
use warpknit::export::remove_temporaries;

/// Listens for the signals that end a program, on a thread of its own.
///
/// # Errors
/// What the system says.
pub(crate) fn clean_up_on_signals() -> io::Result<()> {
    // Once somebody listens, a write beyond `ulimit -f` is an error like that of a full disk, told
    // with the file's name, and no sudden death.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let ignored = ignored_signals();
    let asked_to_hear =
        [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored & (1 << (signal - 1)) == 0);
    let mut signals = Signals::new(asked_to_hear)?;
    let listen = move || {
        if let Some(signal) = signals.forever().next() {
            remove_temporaries();
            let _dead = emulate_default_handler(signal);
            process::exit(128 + signal);
        }
    };
    thread::Builder::new().name("signals".to_owned()).spawn(listen).map(drop)
}

/// The signals that whoever started the program wants ignored (`nohup`, jobs in the background of a
/// script), a bit each from signal 1; they stay so. Where the system doesn't tell, SIGHUP is taken
/// for one of them.
fn ignored_signals() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.unwrap_or(1 << (SIGHUP - 1))
}
