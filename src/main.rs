//! The one binary: `cager`.

use std::process::ExitCode;

fn main() -> ExitCode {
    cager::cli::run()
}
