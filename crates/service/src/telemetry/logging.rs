//! Log lines, to the standard error stream.

use serde::{Deserialize, Serialize};
use std::io::IsTerminal as _;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::{Directive, ParseError};

/// Form of log lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// One line for people, coloured on a terminal.
    #[default]
    Human,
    /// One JSON object per line.
    Json,
}

impl LogFormat {
    /// The word that stands for it in settings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Human => "human",
            Self::Json => "json",
        }
    }
}

/// Why logging cannot begin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoggingError {
    /// The filter cannot be understood.
    #[error("log_filter {filter:?}: {source}; write a level such as info, or info,cager_service::http=debug")]
    Filter {
        /// What was given.
        filter: String,
        /// What is wrong with it.
        source: ParseError,
    },
    /// This process logs already.
    #[error("logging has begun already")]
    Twice,
}

/// The parts of a filter. Commas in braces, between the fields of a span, divide nothing.
pub(crate) fn parts(filter: &str) -> impl Iterator<Item = &str> {
    let mut depth = 0_i32;
    let is_comma = move |c| {
        depth += i32::from(matches!(c, '[' | '{')) - i32::from(matches!(c, ']' | '}'));
        c == ',' && depth <= 0
    };
    filter.split(is_comma).map(str::trim).filter(|part| !part.is_empty())
}

/// What a text selects of the log.
pub(crate) fn log_filter(text: &str) -> Result<EnvFilter, ParseError> {
    let mut all = parts(text).map(str::parse::<Directive>);
    let Some(first) = all.next() else { return EnvFilter::try_new("") };
    let filter = EnvFilter::builder().with_default_directive(first?).parse("")?;
    all.try_fold(filter, |filter, directive| Ok(filter.add_directive(directive?)))
}

/// Begins to log. Once per process.
///
/// # Errors
/// A filter that cannot be understood, and a second call.
pub fn init_logging(format: LogFormat, filter: &str) -> Result<(), LoggingError> {
    let filter = log_filter(filter).map_err(|source| LoggingError::Filter { filter: filter.to_owned(), source })?;
    // Where nobody reads them any more, lines are lost and nothing else: what would be said of that has nowhere to go either.
    let builder =
        tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).log_internal_errors(false);
    let begun = match format {
        LogFormat::Human => builder.with_ansi(std::io::stderr().is_terminal()).try_init(),
        LogFormat::Json => builder.json().flatten_event(true).with_span_list(false).try_init(),
    };
    begun.map_err(|_| LoggingError::Twice)
}
