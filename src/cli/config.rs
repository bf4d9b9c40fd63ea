//! `warpknit.toml` in the working folder: defaults for flags.
//!
//! A key is a flag's long name, for every command that has it, or for one command alone in a table
//! of that command's name. What stands on the command line goes before what stands in the file. A
//! flag that takes no value is switched on by `true`.
//!
//! Not promised: flags that need each other (`eye` and `look-at`) stand together, in the file or on
//! the command line.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The file's name.
pub(super) const FILE: &str = "warpknit.toml";
/// The flag by which it is not read.
pub(super) const IGNORE: &str = "no-config";

/// A flag that on the command line means more than itself, and those of the file that would go
/// before it or make no sense with it.
const OVERRULES: [(&str, &[&str]); 3] = [
    ("fabric", &["lapping", "threading"]),
    ("lapping", &["threading"]),
    ("view", &["eye", "look-at"]),
];
/// A command that is asked about a fabric by these flags, which for others only say which one.
const ASKED: (&str, [&str; 3]) = ("inspect", ["fabric", "lapping", "threading"]);

/// What the file says of one flag.
#[derive(Debug)]
struct Entry {
    /// The only command that it is for, if it is for one.
    command: Option<String>,
    flag: String,
    values: Vec<String>,
    line: usize,
}

/// The command with the defaults that `path` sets, if there is such a file, and the arguments as it
/// understands them.
///
/// # Errors
/// What is wrong with the file, with its line. Wrong usage on the command line itself is clap's to
/// tell.
pub(super) fn matches(
    command: &Command,
    path: &Path,
    arguments: &[OsString],
) -> Result<ArgMatches, Trouble> {
    let parse = |command: &Command| command.clone().try_get_matches_from(arguments);
    let plain = parse(command);
    if arguments.iter().any(|argument| {
        argument.to_str().is_some_and(|text| text.strip_prefix("--") == Some(IGNORE))
    }) || !path.is_file()
    {
        return plain.map_err(Trouble::Usage);
    }
    let entries = match (entries(path), plain.as_ref()) {
        // Help is there for whoever has to mend the file.
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
        last = parse(&command);
        // Without the file the command line was right, so a value of the file is wrong.
        if let (true, Err(error)) = (usable, &last)
            && error.use_stderr()
        {
            let told = error.to_string();
            let what =
                told.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
            return Err(anyhow!(
                "{}:{}: {what}; --{IGNORE} passes the file over",
                path.display(),
                entry.line
            )
            .into());
        }
    }
    last.map_err(Trouble::Usage)
}

/// Flags of the file that others on the command line stand in for.
fn overruled(matches: &ArgMatches) -> Vec<&'static str> {
    let Some((_, given)) = matches.subcommand() else { return Vec::new() };
    let is_given = |flag: &str| {
        given.try_contains_id(flag).is_ok()
            && given.value_source(flag) == Some(ValueSource::CommandLine)
    };
    OVERRULES
        .iter()
        .filter(|(flag, _)| is_given(flag))
        .flat_map(|(_, others)| others.iter().copied())
        .collect()
}

/// Why there are no arguments.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The command line is wrong, or asks for help.
    Usage(clap::Error),
    /// The file is wrong.
    File(anyhow::Error),
}

impl From<anyhow::Error> for Trouble {
    fn from(error: anyhow::Error) -> Self {
        Self::File(error)
    }
}

/// The file's entries, in its order: those for all commands, then those for one.
fn entries(path: &Path) -> Result<Vec<Entry>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: can't be read", path.display()))?;
    let line_of = |at: usize| 1 + text[..at.min(text.len())].matches('\n').count();
    let table = DeTable::parse(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| line_of(span.start));
        anyhow!("{}:{line}: {}", path.display(), error.message())
    })?;
    let mut entries = Vec::new();
    for (key, value) in table.get_ref() {
        let mut add =
            |command: Option<&str>, key: &Spanned<toml::de::DeString<'_>>, value: &DeValue<'_>| {
                let start = key.span().start;
                let line = line_of(start);
                let values = values(value).with_context(|| {
                    format!("{}:{line}: {} is no value of a flag", path.display(), key.get_ref())
                })?;
                entries.push((
                    start,
                    Entry {
                        command: command.map(str::to_owned),
                        flag: key.get_ref().to_string(),
                        values,
                        line,
                    },
                ));
                anyhow::Ok(())
            };
        match value.get_ref() {
            DeValue::Table(own) => own
                .iter()
                .try_for_each(|(flag, value)| add(Some(key.get_ref()), flag, value.get_ref()))?,
            value => add(None, key, value)?,
        }
    }
    entries.sort_by_key(|(start, entry)| (entry.command.is_some(), *start));
    Ok(entries.into_iter().map(|(_, entry)| entry).collect())
}

/// A value as the command line would have it, an array as several.
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
    /// The program with this default in its command, or in all of them that have the flag.
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
                bail!(
                    "--{} of {name} takes one value and not {}: a table [COMMAND] sets it for one command",
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

    /// Whether a command takes it, if it has the flag.
    fn is_for(&self, command: &str) -> bool {
        let asks = command == ASKED.0 && ASKED.1.contains(&self.flag.as_str());
        self.command.as_ref().map_or(!asks, |own| own == command)
    }

    fn argument<'a>(&self, command: &'a Command) -> Option<&'a Arg> {
        command
            .get_arguments()
            .find(|argument| argument.get_long() == Some(&self.flag) && argument.get_id() != IGNORE)
    }
}
