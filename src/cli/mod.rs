//! The command line: one file per command, each parses, calls and prints.

mod args;
mod cage;
mod cage_args;
mod cage_file;
mod cage_outputs;
mod checks;
mod coding_args;
mod compare;
mod decode;
mod design;
mod diagnosis;
mod dry_run;
mod edit;
mod encode;
mod encode_remote;
mod encode_shared;
mod encode_summary;
mod explore;
mod formats;
mod global_args;
mod health;
mod inspect;
mod interrupt;
mod manual;
mod morph_args;
mod motion_args;
mod names;
mod outputs;
mod poses;
mod progress;
mod recover;
mod recover_args;
mod recover_remote;
mod recover_stretch;
mod rig;
#[cfg(feature = "serve")]
mod service;
#[cfg(not(feature = "serve"))]
#[path = "no_service.rs"]
mod service;
mod service_args;
mod solver_options;
mod stretches;
mod transfer;
mod transfer_args;
mod transfer_remote;
mod transfer_source;

use args::{Cli, Command};
use cager_formats::{CacheFormat, ReadModel, Units};
use cager_geometry::mesh::Model;
use clap::{CommandFactory, Parser};
pub(crate) use global_args::{is_quiet, is_verbose, tell};
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// Runs the command given to this process. Exit status 0 done, 1 failed, 2 wrong usage.
pub fn run() -> ExitCode {
    let Cli { global_args, command } = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refused(&error),
    };
    if let Err(error) = global_args.apply() {
        let _ = writeln!(std::io::stderr(), "cager: {error:#}");
        return ExitCode::FAILURE;
    }
    let result = match command {
        Command::Encode(args) => encode::run(*args),
        Command::Decode(args) => decode::run(&args),
        Command::Recover(args) => recover::run(&args),
        Command::Transfer(args) => transfer::run(&args),
        Command::Explore(args) => explore::run(&args),
        Command::Rig(args) => rig::run(&args),
        Command::Manifold(args) => rig::learn(&args),
        Command::Edit(args) => edit::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Cage(args) => cage::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Service(command) => command.run(),
        Command::Health(args) => health::run(&args),
        Command::Formats => formats::run(),
        Command::Completions(args) => {
            let mut script = Vec::new();
            clap_complete::generate(args.shell, &mut Cli::command(), "cager", &mut script);
            print(&String::from_utf8_lossy(&script))
        }
        Command::Man(args) => manual::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nowhere is left to report a closed stderr to.
            let _ = writeln!(std::io::stderr(), "cager: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// What clap says, and a hint where a shell expanded a pattern: then files follow each other
/// without an option between them.
fn refused(error: &clap::Error) -> ExitCode {
    let _ = error.print();
    let stray = match error.get(clap::error::ContextKind::InvalidArg) {
        Some(clap::error::ContextValue::String(word)) if error.kind() == clap::error::ErrorKind::UnknownArgument => {
            Some(word).filter(|word| !word.starts_with('-') && Path::new(word).exists())
        }
        _ => None,
    };
    if let Some(word) = stray {
        let _ = writeln!(
            std::io::stderr(),
            "\n  tip: if {} comes from a pattern, quote the pattern, as in --frames 'walk/*.obj'",
            plain(word)
        );
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}

/// Writes to stdout, or to stderr where stdout holds an output; a reader that has seen enough, as
/// `head` has, is no failure.
fn print(text: &str) -> anyhow::Result<()> {
    if global_args::stdout_is_taken() {
        // As for errors, nowhere is left to report a closed stderr to.
        let _ = std::io::stderr().write_all(text.as_bytes());
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(anyhow::anyhow!("standard output: {error}"))
        }
        _ => Ok(()),
    }
}

/// Reads a model, and tells what is left out of it.
fn read_model(path: &Path) -> Result<Model, cager_formats::Error> {
    read_prims(path, &[])
}

/// As [`read_model`], of a scene the meshes that are named.
fn read_prims(path: &Path, prims: &[String]) -> Result<Model, cager_formats::Error> {
    read_with_units(path, prims).map(|(model, _)| model)
}

/// As [`read_prims`], with what the file says of its coordinates.
fn read_with_units(path: &Path, prims: &[String]) -> Result<(Model, Units), cager_formats::Error> {
    read_whole(path, prims).map(|read| (read.model, read.units))
}

/// As [`read_prims`], with all that is known of the file; commands whose outputs do without what is dropped tell it.
fn read_whole(path: &Path, prims: &[String]) -> Result<ReadModel, cager_formats::Error> {
    let read = cager_formats::read_mesh(path, prims)?;
    warn(read.note.as_slice());
    Ok(read)
}

/// As [`read_whole`], of a model whose pictures no option of the command asks for.
fn read_without_pictures(path: &Path) -> Result<ReadModel, cager_formats::Error> {
    let mut read = read_whole(path, &[])?;
    read.model.surface.keep_named_pictures();
    if !std::mem::take(&mut read.model.surface.pictures).is_empty() {
        warn(&[format!(
            "{}: the pictures in it are left out; cager encode --textures embed takes pictures in",
            path.display()
        )]);
    }
    Ok(read)
}

/// What of a mesh an output loses that has no colours; of what lies on the faces its format says what it loses.
fn dropped(path: &Path, read: &ReadModel) -> Option<String> {
    read.dropped_with_colors().sentence(path, false)
}

/// A mesh whose points alone are moved, in the units and axes of another one where both say theirs.
fn read_like(path: &Path, units: Units) -> Result<Model, cager_formats::Error> {
    let mut read = read_whole(path, &[])?;
    warn(dropped(path, &read).as_slice());
    read.units.change_to(units).apply_to(&mut read.model.points);
    Ok(read.model)
}

/// Whether a file is a `.cager` file, by its name.
fn is_container(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("cager"))
}

/// Whether a file is a scene that may have several meshes, by its name.
fn is_scene(path: &Path) -> bool {
    CacheFormat::from_path(path).is_some_and(CacheFormat::is_scene)
}

fn warn(warnings: &[String]) {
    for warning in warnings {
        let _ = writeln!(std::io::stderr(), "warning: {}", plain(warning));
    }
}

/// Does what may warn, and tells the warnings also where it fails.
fn warning<T, E>(work: impl FnOnce(&mut Vec<String>) -> Result<T, E>) -> Result<T, E> {
    let mut warnings = Vec::new();
    let done = work(&mut warnings);
    warn(&warnings);
    done
}

/// Untrusted text with control characters replaced, so that it cannot control the terminal.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

/// A whole number with its digits in groups of three, `1,234,567`.
fn grouped(number: impl ToString + Copy) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// `1 shape`, `1,234 shapes`.
fn counted(count: usize, what: &str) -> String {
    format!("{} {what}{}", grouped(count), if count == 1 { "" } else { "s" })
}

/// A number of bytes with a unit people read.
fn human_bytes(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.2} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn numbers_are_grouped_and_scaled_for_people() {
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(human_bytes(999), "999 B");
        assert_eq!(human_bytes(2_580_000), "2.58 MB");
    }
}
