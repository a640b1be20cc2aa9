//! Requests that may be repeated, by tenant and the client's name for them (`Idempotency-Key`).

use crate::problem::{self, ApiError};
use crate::store::Idempotency;
use std::collections::HashMap;

/// Which keys belong to which requests, and what those made.
#[derive(Default)]
pub(crate) struct Requests {
    known: HashMap<(String, String), Request>,
}

struct Request {
    fingerprint: String,
    /// The id of what it made; `None` while it is being made.
    made: Option<String>,
}

/// What a repeated request meets.
pub(crate) enum Repetition<T> {
    /// It is the first of its kind.
    First,
    /// It was done before; here is what it made.
    Done(T),
}

impl Requests {
    /// Announces a request; gives the id of what an earlier one made.
    ///
    /// # Errors
    /// The key belongs to another request, or to one that is still being worked on.
    pub(crate) fn begin(&mut self, tenant: &str, key: &str, fingerprint: &str) -> Result<Repetition<String>, ApiError> {
        let place = (tenant.to_owned(), key.to_owned());
        match self.known.get(&place) {
            None => {
                self.known.insert(place, Request { fingerprint: fingerprint.to_owned(), made: None });
                Ok(Repetition::First)
            }
            Some(request) if request.fingerprint != fingerprint => Err(ApiError::new(
                problem::KEY_REUSED,
                "this Idempotency-Key came with other files or options before; use a new key for a new request",
            )),
            Some(Request { made: Some(id), .. }) => Ok(Repetition::Done(id.clone())),
            Some(Request { made: None, .. }) => Err(ApiError::new(
                problem::KEY_IN_USE,
                "the same request is being worked on right now; ask again in a moment",
            )
            .retry_after(1)),
        }
    }

    /// Says what a request made.
    pub(crate) fn made(&mut self, tenant: &str, idempotency: &Idempotency, id: &str) {
        let request = Request { fingerprint: idempotency.fingerprint.clone(), made: Some(id.to_owned()) };
        self.known.insert((tenant.to_owned(), idempotency.key.clone()), request);
    }

    /// Frees the key of what is gone.
    pub(crate) fn forget(&mut self, tenant: &str, idempotency: &Idempotency) {
        self.known.remove(&(tenant.to_owned(), idempotency.key.clone()));
    }

    /// Frees the key of a request that made nothing.
    pub(crate) fn give_up(&mut self, tenant: &str, key: &str) {
        let place = (tenant.to_owned(), key.to_owned());
        if self.known.get(&place).is_some_and(|request| request.made.is_none()) {
            self.known.remove(&place);
        }
    }
}
