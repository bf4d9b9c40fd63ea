//! `warpknit.toml` in the working folder: defaults for flags.
//!
//! A key is a flag's long name. At the top of the file it counts for every command that has the
//! flag. In a table with a command's name it counts for that command only. The command line has
//! priority over the file. `true` switches on a flag that takes no value.
//!
//! Not supported: one of two flags that need each other (`eye` and `look-at`) in the file and the
//! other on the command line.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The file's name.
pub(super) const FILE: &str = "warpknit.toml";
/// The flag that makes the program ignore the file.
pub(super) const IGNORE: &str = "no-config";

/// Flags whose presence on the command line cancels other flags of the file. With `--fabric`, a
/// `lapping` of the file would replace the bars of the fabric that the user just named.
const OVERRULES: [(&str, &[&str]); 5] = [
    ("fabric", &["lapping", "threading", "count", "run-in"]),
    ("lapping", &["threading", "run-in"]),
    ("view", &["eye", "look-at"]),
    ("environment", &["sun"]),
    ("sun", &["environment", "environment-turn"]),
];
/// `inspect` shows a fabric, and `fabrics` one of one's own, only if one of these flags is given. A
/// default in the file would make them show one always, so the file sets them for these commands
/// only in their own tables.
const ASKED: ([&str; 2], [&str; 5]) =
    (["inspect", "fabrics"], ["fabric", "lapping", "threading", "count", "run-in"]);

/// One key of the file.
#[derive(Debug)]
struct Entry {
    /// The command whose table has the key. `None` at the top of the file.
    command: Option<String>,
    flag: String,
    values: Vec<String>,
    line: usize,
}

/// Parses the arguments, with the defaults of the file at `path` if it exists.
///
/// clap can't tell a wrong default from a wrong argument. So the arguments are parsed once without
/// the file, then once more after each entry: the entry at which parsing begins to fail is wrong.
///
/// # Errors
/// [`Trouble::File`] with the line of the fault, or [`Trouble::Usage`] for the command line.
pub(super) fn matches(
    command: &Command,
    path: &Path,
    arguments: &[OsString],
) -> Result<ArgMatches, Trouble> {
    let plain = parse(command, arguments);
    if arguments.iter().any(|argument| {
        argument.to_str().is_some_and(|text| text.strip_prefix("--") == Some(IGNORE))
    }) || !path.is_file()
    {
        return plain.map_err(Trouble::Usage);
    }
    let entries = match (entries(path), plain.as_ref()) {
        // `--help` works with a wrong file too: it may be needed to correct the file.
        (Err(_wrong), Err(shown)) if !shown.use_stderr() => Vec::new(),
        (entries, _) => entries?,
    };
    let usable = plain.is_ok();
    let overruled = plain.as_ref().map(overruled).unwrap_or_default();
    let mut command = command.clone();
    let mut last = plain;
    for entry in entries.into_iter().filter(|entry| !overruled.contains(&entry.flag.as_str())) {
        command = entry
            .set(command)
            .map_err(|what| anyhow!("{}:{}: {what}", path.display(), entry.line))?;
        last = parse(&command, arguments);
        // The command line alone was right, so this value of the file is wrong.
        if let (true, Err(error)) = (usable, &last)
            && error.use_stderr()
        {
            let message = error.to_string();
            let what =
                message.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
            return Err(anyhow!(
                "{}:{}: {what}; --{IGNORE} ignores the file",
                path.display(),
                entry.line
            )
            .into());
        }
    }
    last.map_err(Trouble::Usage)
}

/// Parses the arguments as `command` defines them.
fn parse(command: &Command, arguments: &[OsString]) -> Result<ArgMatches, clap::Error> {
    command.clone().try_get_matches_from(arguments)
}

/// Flags of the file that are cancelled by flags on the command line.
fn overruled(matches: &ArgMatches) -> Vec<&'static str> {
    let Some((_, given)) = matches.subcommand() else { return Vec::new() };
    OVERRULES
        .iter()
        .filter(|(flag, _)| is_given(given, flag))
        .flat_map(|(_, others)| others.iter().copied())
        .collect()
}

/// Whether a flag is on the command line.
fn is_given(matches: &ArgMatches, flag: &str) -> bool {
    // `value_source` panics for a flag that the command doesn't have.
    matches.try_contains_id(flag).is_ok()
        && matches.value_source(flag) == Some(ValueSource::CommandLine)
}

/// The reason why the arguments can't be used.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The command line is wrong, or it asks for help.
    Usage(clap::Error),
    /// The file is wrong.
    File(anyhow::Error),
}

impl From<anyhow::Error> for Trouble {
    fn from(error: anyhow::Error) -> Self {
        Self::File(error)
    }
}

/// The file's entries: first those for all commands, then those of tables, each in the file's order.
/// So a table's entry replaces one for all commands.
fn entries(path: &Path) -> Result<Vec<Entry>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: can't be read", path.display()))?;
    let table = DeTable::parse(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| line_of(&text, span.start));
        anyhow!("{}:{line}: {}", path.display(), error.message())
    })?;
    let mut entries = Vec::new();
    for (key, value) in table.get_ref() {
        match value.get_ref() {
            DeValue::Table(own) => {
                for (flag, value) in own {
                    let entry = entry(&text, Some(key.get_ref()), flag, value.get_ref());
                    entries.push(entry.map_err(|what| anyhow!("{}:{what}", path.display()))?);
                }
            }
            value => {
                let entry = entry(&text, None, key, value);
                entries.push(entry.map_err(|what| anyhow!("{}:{what}", path.display()))?);
            }
        }
    }
    // The TOML reader sorts keys by name. Messages and priority follow the file's order.
    entries.sort_by_key(|(start, entry)| (entry.command.is_some(), *start));
    Ok(entries.into_iter().map(|(_, entry)| entry).collect())
}

/// One entry of the file, with the place of its key in the text; or the line and the fault.
fn entry(
    text: &str,
    command: Option<&str>,
    key: &Spanned<toml::de::DeString<'_>>,
    value: &DeValue<'_>,
) -> Result<(usize, Entry), String> {
    let start = key.span().start;
    let line = line_of(text, start);
    let flag = key.get_ref().to_string();
    let values = values(value).ok_or_else(|| format!("{line}: {flag} is no value of a flag"))?;
    Ok((start, Entry { command: command.map(str::to_owned), flag, values, line }))
}

/// The number of the line that has this byte, from 1.
fn line_of(text: &str, at: usize) -> usize {
    1 + text[..at.min(text.len())].matches('\n').count()
}

/// The words that a value would be on the command line. An array gives several. `None` for types
/// that no flag takes.
fn values(value: &DeValue<'_>) -> Option<Vec<String>> {
    match value {
        DeValue::String(text) => Some(vec![text.to_string()]),
        DeValue::Integer(number) => Some(vec![number.to_string()]),
        DeValue::Float(number) => Some(vec![number.to_string()]),
        DeValue::Boolean(on) => Some(vec![on.to_string()]),
        DeValue::Array(array) => {
            let parts =
                array.iter().map(|part| values(part.get_ref()).filter(|values| values.len() == 1));
            Some(parts.collect::<Option<Vec<_>>>()?.concat())
        }
        DeValue::Datetime(_) | DeValue::Table(_) => None,
    }
}

impl Entry {
    /// Sets this default in its command, or in all commands that have the flag.
    fn set(&self, program: Command) -> Result<Command> {
        let names: Vec<String> =
            program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
        if let Some(name) = self.command.as_ref().filter(|name| !names.contains(name)) {
            bail!("there is no command {name}: known are {}", names.join(" "));
        }
        let mut known = false;
        let mut program = program;
        for name in names.iter().filter(|name| self.is_for(name)) {
            let Some(argument) =
                program.find_subcommand(name).and_then(|command| self.argument(command))
            else {
                continue;
            };
            known = true;
            if !argument.get_action().takes_values()
                && self.values.iter().any(|value| value != "true" && value != "false")
            {
                bail!("--{} of {name} takes no value: true switches it on", self.flag);
            }
            if matches!(argument.get_action(), ArgAction::Set) && self.values.len() != 1 {
                // A flag may be repeatable in one command and single in another.
                bail!(
                    "--{} of {name} takes one value and not {}: a table [COMMAND] sets it for one \
                     command",
                    self.flag,
                    self.values.len()
                );
            }
            let id = argument.get_id().clone();
            program = program.mut_subcommand(name, |command| {
                command.mut_arg(id, |argument| argument.default_values(self.values.clone()))
            });
        }
        if !known {
            let whose = self
                .command
                .as_ref()
                .map_or_else(|| "no command".to_owned(), |name| format!("{name} does not"));
            let has = if self.command.is_some() { "have" } else { "has" };
            bail!("{whose} {has} a flag --{}; `warpknit COMMAND --help` lists them", self.flag);
        }
        Ok(program)
    }

    /// Whether the entry counts for a command, if that has the flag.
    fn is_for(&self, command: &str) -> bool {
        let asks = ASKED.0.contains(&command) && ASKED.1.contains(&self.flag.as_str());
        self.command.as_ref().map_or(!asks, |own| own == command)
    }

    /// The command's argument with this flag as its long name.
    fn argument<'a>(&self, command: &'a Command) -> Option<&'a Arg> {
        command
            .get_arguments()
            .find(|argument| argument.get_long() == Some(&self.flag) && argument.get_id() != IGNORE)
    }
}
