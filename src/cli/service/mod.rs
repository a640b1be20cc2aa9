//! The commands that need the service within this program.

mod demo;
mod demo_report;
mod serve;
mod store;

use anyhow::Result;
use cager_service::config::ServeFlags;
use clap::Subcommand;

#[derive(Subcommand)]
pub(crate) enum ServiceCommand {
    Serve(Box<ServeFlags>),
    Store(store::StoreArgs),
    Demo(demo::DemoArgs),
}

impl ServiceCommand {
    pub(super) fn run(&self) -> Result<()> {
        match self {
            Self::Serve(flags) => serve::run(flags),
            Self::Store(args) => store::run(args),
            Self::Demo(args) => demo::run(args),
        }
    }
}
