//! `warpknit completions` and `warpknit man`: completion scripts and manual pages, generated from
//! the definition of the command line.

use anyhow::{Result, bail};
use clap::CommandFactory as _;

use super::args::{Arguments, Completions, Man};
use super::terminal::print;

/// Headings in help texts whose lists stay line by line in the manual.
const LISTS: [&str; 2] = ["Examples:", "Files in the folder:"];

/// Prints a completion script.
pub(crate) fn completions(arguments: &Completions) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut Arguments::command(),
        env!("CARGO_PKG_NAME"),
        &mut script,
    );
    print(&String::from_utf8_lossy(&script))
}

/// Prints the manual page of the program, or of one of its commands.
pub(crate) fn man(arguments: &Man) -> Result<()> {
    let mut program = Arguments::command();
    // Only a built command knows the full names of its subcommands and the flags they inherit.
    program.build();
    let Some(name) = &arguments.command else { return page(program) };
    let Some(command) = program.find_subcommand(name) else {
        let known: Vec<_> = program.get_subcommands().map(clap::Command::get_name).collect();
        bail!("there is no command {name}: known are {}", known.join(" "));
    };
    let name = format!("{}-{name}", env!("CARGO_PKG_NAME"));
    page(command.clone().name(name))
}

/// Prints the manual page of one command.
fn page(command: clap::Command) -> Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    print(&as_written(&String::from_utf8_lossy(&page)))
}

/// The page with its lists line by line. Otherwise `man` would join the lines, and nobody could copy
/// an example.
fn as_written(page: &str) -> String {
    let mut text = String::with_capacity(page.len() + 16);
    let mut is_open = false;
    for line in page.lines() {
        if is_open && (line.starts_with(".SH") || line.is_empty()) {
            text += ".fi\n";
            is_open = false;
        }
        text += line;
        text.push('\n');
        // Unfilled text in roff: from `.nf` to `.fi`.
        if LISTS.contains(&line) {
            text += ".nf\n";
            is_open = true;
        }
    }
    if is_open {
        text += ".fi\n";
    }
    text
}
