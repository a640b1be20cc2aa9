//! Requests that may be repeated, by tenant and the client's name for them (`Idempotency-Key`).

use crate::problem::{self, ApiError};
use crate::store::Idempotency;
use std::collections::HashMap;
use std::sync::Arc;

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
pub(crate) enum Repetition {
    /// It is the first of its kind.
    First,
    /// It was done before, and made what has this id.
    Done(String),
}

/// Keeps the keys of requests, and what those made.
pub(crate) trait Keyed<T> {
    /// Does something with the keys.
    fn requests<R>(&self, work: impl FnOnce(&mut Requests) -> R) -> R;
    /// What has this id.
    fn made(&self, id: &str) -> Option<Arc<T>>;
}

/// Makes something, once for each key.
///
/// # Errors
/// Those of `make`, and those of [`Requests::begin`]; what an earlier request made is gone.
pub(crate) async fn once<T, Making: Future<Output = Result<Arc<T>, ApiError>>>(
    registry: &impl Keyed<T>,
    tenant: &str,
    request: Option<Idempotency>,
    make: impl FnOnce(Option<Idempotency>) -> Making,
) -> Result<Arc<T>, ApiError> {
    let Some(request) = request else { return make(None).await };
    match registry.requests(|requests| requests.begin(tenant, &request.key, &request.fingerprint))? {
        Repetition::Done(id) => registry.made(&id).ok_or_else(|| {
            ApiError::new(problem::NOT_FOUND, "what this request made before was deleted; use a new key")
        }),
        Repetition::First => {
            // Frees the key also after a panic.
            let key = request.key.clone();
            let _free = GiveUp(|| registry.requests(|requests| requests.give_up(tenant, &key)));
            make(Some(request)).await
        }
    }
}

struct GiveUp<F: FnMut()>(F);

impl<F: FnMut()> Drop for GiveUp<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

impl Requests {
    /// Announces a request; gives the id of what an earlier one made.
    ///
    /// # Errors
    /// The key belongs to another request, or to one that is still being worked on.
    pub(crate) fn begin(&mut self, tenant: &str, key: &str, fingerprint: &str) -> Result<Repetition, ApiError> {
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
