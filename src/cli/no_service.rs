//! The commands that need the service, in a program that was built without it.

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use std::ffi::OsString;

#[derive(Subcommand)]
pub(crate) enum ServiceCommand {
    #[command(hide = true)]
    Serve(Ignored),
    #[command(hide = true)]
    Store(Ignored),
    #[command(hide = true)]
    Demo(Ignored),
}

/// Arguments of any kind.
#[derive(Args)]
pub(crate) struct Ignored {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    _arguments: Vec<OsString>,
}

impl ServiceCommand {
    pub(super) fn run(&self) -> Result<()> {
        bail!(
            "this program was built without the service, which serve, store and demo need; build it with its default \
             features"
        )
    }
}
