//! Arguments that say which service computes.

use clap::Args;

/// A service that computes, and what it is shown.
#[derive(Args)]
pub(super) struct ServiceArgs {
    /// Have a service compute: its address, such as http://127.0.0.1:8080. The same command goes on
    /// where the connection broke.
    #[arg(long, value_name = "URL")]
    pub(super) server: Option<String>,

    /// Token to show to the service [default: the environment's CAGER_TOKEN, which other users of
    /// this machine do not see].
    #[arg(long, value_name = "T", requires = "server", hide_default_value = true)]
    token: Option<String>,
}

impl ServiceArgs {
    /// The token, where there is one.
    pub(super) fn token(&self) -> Option<String> {
        let token = self.token.clone().or_else(|| std::env::var("CAGER_TOKEN").ok());
        token.filter(|token| !token.is_empty())
    }
}
