//! Files that the system lets the process have open, of which each connection is one.

use crate::config::ServeConfig;
use rustix::process::{Resource, getrlimit, setrlimit};

/// What is open beside the connections of clients: those of operators, of a database and of other processes, files of sessions at work, and connections that are
/// refused.
const OWN: u64 = 384;
/// Of a limit below twice that, clients get a quarter.
const SMALL: u64 = 2 * OWN;

/// Raises the limit as far as the system allows, and lowers `max_connections` to what it leaves room for, so that health and operators are answered however many
/// clients there are.
pub(crate) fn make_room(config: &mut ServeConfig) {
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current != limit.maximum {
        limit.current = limit.maximum;
        if let Err(error) = setrlimit(Resource::Nofile, limit) {
            tracing::debug!(%error, "the limit of open files stays as it is");
            limit = getrlimit(Resource::Nofile);
        }
    }
    let Some(limit) = limit.current else { return };
    let most = connections(limit);
    if config.max_connections > most {
        tracing::warn!(
            "the system allows {limit} open files, too few for max_connections = {}: {most} are served; raise the limit, as by `ulimit -n {}`",
            config.max_connections,
            (config.max_connections as u64).saturating_add(OWN)
        );
        config.max_connections = most;
    }
}

/// Connections of clients that there is room for.
fn connections(limit: u64) -> usize {
    let most = if limit < SMALL { limit / 4 } else { limit - OWN };
    usize::try_from(most).unwrap_or(usize::MAX).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_files_are_kept_for_what_is_no_client() {
        assert_eq!([0, 64, 256, 767, 768, 1024, 4096].map(connections), [1, 16, 64, 191, 384, 640, 3712]);
    }

    #[test]
    fn the_limit_is_raised_and_fewer_connections_are_served_where_that_is_not_enough() {
        let wanted = 1_000_000;
        let mut config = ServeConfig { max_connections: wanted, ..ServeConfig::default() };
        make_room(&mut config);
        let now = getrlimit(Resource::Nofile);
        assert_eq!(now.current, now.maximum);
        assert_eq!(config.max_connections, now.current.map_or(wanted, |limit| connections(limit).min(wanted)));
    }
}
