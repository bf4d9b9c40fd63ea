//! Numbers of things in messages.

/// A number of things, in the plural unless there is one.
pub(crate) fn counted(number: u64, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}
