//! Signals: Ctrl-C, requests to terminate, a file that exceeds its size limit, and the end of
//! memory.
//!
//! The temporary files of unfinished outputs are removed. Then the program ends by the same signal,
//! as shells and scripts expect (a shell shows 130 after Ctrl-C). SIGKILL can't be caught: the next
//! run removes the temporary files that it leaves.

use std::fs;
use std::io;
use std::process;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;
use warpknit::export::remove_temporaries;

/// Listens for the signals that end a program, on a thread of its own.
///
/// # Errors
/// The system's error if a signal can't be registered.
pub(crate) fn clean_up_on_signals() -> io::Result<()> {
    // With any handler for it, a write beyond `ulimit -f` fails like one on a full disk, and the
    // error names the file. Without a handler the program would end at once.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    // A failed allocation prints its line and aborts the program. It shall end like any other error
    // and dump no core.
    signal_hook::flag::register_conditional_shutdown(SIGABRT, 1, Arc::new(AtomicBool::new(true)))?;
    let ignored = ignored_signals();
    let caught =
        [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored & (1 << (signal - 1)) == 0);
    let mut signals = Signals::new(caught)?;
    let listen = move || {
        if let Some(signal) = signals.forever().next() {
            remove_temporaries();
            let _ended = emulate_default_handler(signal);
            // Only if the signal's own action did not end the process.
            process::exit(128 + signal);
        }
    };
    thread::Builder::new().name("signals".to_owned()).spawn(listen).map(drop)
}

/// The signals that the program's parent set to be ignored (`nohup`, background jobs of a script),
/// one bit each from signal 1. They stay ignored. Where `/proc` is missing, only SIGHUP counts as
/// ignored.
fn ignored_signals() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.unwrap_or(1 << (SIGHUP - 1))
}
