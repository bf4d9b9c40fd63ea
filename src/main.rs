//! The `warpknit` command.
fn main() {}
