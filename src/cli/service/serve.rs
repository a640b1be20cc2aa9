//! `cager serve`.

use crate::cli::print;
use anyhow::Result;
use cager_service::config::{ServeConfig, ServeFlags};

pub(super) fn run(flags: &ServeFlags) -> Result<()> {
    let config = ServeConfig::load(flags.config.as_deref(), std::env::vars(), flags)?;
    if flags.check_config {
        config.check_files()?;
        return print(&config.check_config());
    }
    cager_service::serve::run(config, env!("CAGER_VERSION"))
}
