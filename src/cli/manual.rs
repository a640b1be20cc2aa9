//! Manual pages, from the definition of the command line.

use super::args::{Cli, ManArgs};
use super::tell;
use anyhow::{Context as _, Result};
use cager_formats::{AtomicFile, commit_together};
use clap::CommandFactory;
use std::io::Write;

pub(super) fn run(args: &ManArgs) -> Result<()> {
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    let commands = program.get_subcommands().filter(|command| !command.is_hide_set()).cloned().collect::<Vec<_>>();
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}: cannot be made", args.output.display()))?;
    let mut pages = Vec::new();
    for command in std::iter::once(program).chain(commands) {
        let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
        let mut file = AtomicFile::create(args.output.join(format!("{name}.1")))?;
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page)?;
        file.write_all(&page)?;
        pages.push(file);
    }
    let count = pages.len();
    commit_together(pages)?;
    tell(&format!("{}: {count} manual pages\n", args.output.display()))
}
