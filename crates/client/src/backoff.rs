//! How long to wait before the next attempt, and when to stop.

use crate::error::{ClientError, Failure};
use std::time::{Duration, SystemTime};

/// The first wait, doubled from attempt to attempt.
const FIRST: Duration = Duration::from_millis(100);

/// Upper bound of a pause requested by the service.
const MAX_RETRY_AFTER: Duration = Duration::from_secs(600);

/// Retry state of one call: counts failures without progress.
#[derive(Debug)]
pub(crate) struct Backoff {
    failures: u32,
    retries: u32,
    max: Duration,
    total: u32,
}

impl Backoff {
    /// Gives up after `retries` consecutive failures; `max` limits its own waits, not those that the service asks for.
    pub(crate) fn new(retries: u32, max: Duration) -> Self {
        Self { failures: 0, retries, max, total: 0 }
    }

    /// Resets the failure count after progress.
    pub(crate) fn progress(&mut self) {
        self.failures = 0;
    }

    /// Total number of failed attempts.
    pub(crate) fn total(&self) -> u32 {
        self.total
    }

    /// The wait before the next attempt.
    ///
    /// # Errors
    /// The error to report, if there is no further attempt.
    pub(crate) fn failed(&mut self, failure: Failure) -> Result<Duration, ClientError> {
        let (error, retry_after) = match failure {
            Failure::Final(error) => return Err(error),
            Failure::Transient { error, retry_after } => (error, retry_after),
        };
        self.failures += 1;
        self.total += 1;
        if self.failures > self.retries {
            return Err(match self.failures {
                1 => error,
                attempts => ClientError::GaveUp { attempts, last: Box::new(error) },
            });
        }
        let own = self.next_wait();
        Ok(match retry_after {
            // A little later than asked for, and not all clients at once.
            Some(asked) => own.max(asked.min(MAX_RETRY_AFTER).mul_f64(1.0 + 0.1 * fastrand::f64())),
            None => own,
        })
    }

    /// Sleeps before the next attempt, or returns the error to report.
    pub(crate) async fn wait_after(&mut self, failure: Failure) -> Result<(), ClientError> {
        let wait = self.failed(failure)?;
        tokio::time::sleep(wait).await;
        Ok(())
    }

    /// Doubled wait with jitter: between half and all of it.
    fn next_wait(&self) -> Duration {
        let doubled = FIRST.saturating_mul(1 << (self.failures - 1).min(20)).min(self.max);
        doubled.mul_f64(0.5 + 0.5 * fastrand::f64())
    }
}

/// The wait that a `Retry-After` header asks for: seconds or a date (RFC 9110, 10.2.3).
pub(crate) fn retry_after(value: &str, now: SystemTime) -> Option<Duration> {
    let value = value.trim();
    if !value.is_empty() && value.bytes().all(|b| b.is_ascii_digit()) {
        // More digits than fit are a long time too.
        return Some(Duration::from_secs(value.parse().unwrap_or(u64::MAX)));
    }
    let date = httpdate::parse_http_date(value).ok()?;
    Some(date.duration_since(now).unwrap_or(Duration::ZERO))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn broken() -> Failure {
        Failure::transient(ClientError::Broken { address: "a".to_owned(), cause: "reset".to_owned() })
    }

    #[test]
    fn retry_after_is_read_as_seconds_or_as_a_date() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(784_111_777 - 30);
        assert_eq!(retry_after("7", now), Some(Duration::from_secs(7)));
        assert_eq!(retry_after(" 0 ", now), Some(Duration::ZERO));
        assert_eq!(retry_after("Sun, 06 Nov 1994 08:49:37 GMT", now), Some(Duration::from_secs(30)));
        assert_eq!(retry_after("Sun, 06 Nov 1983 08:49:37 GMT", now), Some(Duration::ZERO));
        assert_eq!(retry_after("99999999999999999999999", now), Some(Duration::from_secs(u64::MAX)));
        for bad in ["", "-1", "soon", "1.5", "Sun, 99 Nov 1994 08:49:37 GMT"] {
            assert_eq!(retry_after(bad, now), None, "{bad:?}");
        }
    }

    #[test]
    fn waits_double_up_to_the_longest() {
        let mut backoff = Backoff::new(12, Duration::from_secs(2));
        for attempt in 0..12 {
            let most = Duration::from_millis(100 << attempt).min(Duration::from_secs(2));
            let wait = backoff.failed(broken()).expect("not yet");
            assert!(wait >= most / 2 && wait <= most, "attempt {attempt}: {wait:?}");
        }
        let last = backoff.failed(broken()).expect_err("enough");
        assert!(matches!(last, ClientError::GaveUp { attempts: 13, .. }), "{last}");
        assert_eq!(backoff.total(), 13);
    }

    #[test]
    fn progress_starts_the_count_again() {
        let mut backoff = Backoff::new(1, Duration::from_secs(1));
        for _ in 0..50 {
            assert!(backoff.failed(broken()).is_ok());
            backoff.progress();
        }
        assert_eq!(backoff.total(), 50);
    }

    #[test]
    fn without_retries_the_first_failure_is_reported_as_it_is() {
        let error = Backoff::new(0, Duration::from_secs(1)).failed(broken()).expect_err("at once");
        assert!(matches!(error, ClientError::Broken { .. }));
    }

    proptest! {
        #[test]
        fn what_the_service_asks_for_is_honoured_but_not_for_ever(asked in 0_u64..=u64::MAX) {
            let asked = Duration::from_secs(asked);
            let mut backoff = Backoff::new(1, Duration::from_secs(1));
            let error = ClientError::Protocol(String::new());
            let wait = backoff.failed(Failure::Transient { error, retry_after: Some(asked) }).expect("one more");
            prop_assert!(wait >= asked.min(MAX_RETRY_AFTER));
            prop_assert!(wait <= MAX_RETRY_AFTER.mul_f64(1.1));
        }
    }
}
