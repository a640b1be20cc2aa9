//! Idempotency keys (`Idempotency-Key`) by tenant.

use crate::problem::{self, ApiError};
use crate::store::{ContentKey, Idempotency};
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;

/// Known keys with their requests and results.
#[derive(Default)]
pub(crate) struct Requests {
    known: HashMap<(String, String), Request>,
}

struct Request {
    fingerprint: String,
    /// Id of the created object; `None` while the request is being processed.
    made: Option<String>,
}

/// Result of looking up a key.
pub(crate) enum KeyLookup {
    /// The key is new.
    First,
    /// An earlier request with the key created the object with this id.
    Done(String),
}

/// A registry of objects that are created by requests with idempotency keys.
pub(crate) trait Keyed<T> {
    /// Accesses the keys under the registry's lock.
    fn requests<R>(&self, work: impl FnOnce(&mut Requests) -> R) -> R;
    /// The object with this id.
    fn made(&self, id: &str) -> Option<Arc<T>>;
}

/// A request with a key for this content and these options.
pub(crate) fn request(key: Option<String>, content: &ContentKey, options: &impl Serialize) -> Option<Idempotency> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&content.0);
    hasher.update(&serde_json::to_vec(options).unwrap_or_default());
    Some(Idempotency { key: key?, fingerprint: hasher.finalize().to_hex().to_string() })
}

/// Creates an object, at most once per key.
///
/// # Errors
/// Those of `make` and of [`Requests::begin`]; `NOT_FOUND` if the object of an earlier request was deleted.
pub(crate) async fn once<T, Making: Future<Output = Result<Arc<T>, ApiError>>>(
    registry: &impl Keyed<T>,
    tenant: &str,
    request: Option<Idempotency>,
    make: impl FnOnce(Option<Idempotency>) -> Making,
) -> Result<Arc<T>, ApiError> {
    let Some(request) = request else { return make(None).await };
    match registry.requests(|requests| requests.begin(tenant, &request.key, &request.fingerprint))? {
        KeyLookup::Done(id) => registry.made(&id).ok_or_else(|| {
            ApiError::new(problem::NOT_FOUND, "what this request made before was deleted; use a new key")
        }),
        KeyLookup::First => {
            // Releases the key, also after a panic, unless an object was created.
            let key = request.key.clone();
            let _free = ReleaseOnDrop(|| registry.requests(|requests| requests.give_up(tenant, &key)));
            make(Some(request)).await
        }
    }
}

struct ReleaseOnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for ReleaseOnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

impl Requests {
    /// Registers a request; returns the id of the object that an earlier one created.
    ///
    /// # Errors
    /// The key belongs to another request, or to one that is still being worked on.
    pub(crate) fn begin(&mut self, tenant: &str, key: &str, fingerprint: &str) -> Result<KeyLookup, ApiError> {
        let place = (tenant.to_owned(), key.to_owned());
        match self.known.get(&place) {
            None => {
                self.known.insert(place, Request { fingerprint: fingerprint.to_owned(), made: None });
                Ok(KeyLookup::First)
            }
            Some(request) if request.fingerprint != fingerprint => Err(ApiError::new(
                problem::KEY_REUSED,
                "this Idempotency-Key came with other files or options before; use a new key for a new request",
            )),
            Some(Request { made: Some(id), .. }) => Ok(KeyLookup::Done(id.clone())),
            Some(Request { made: None, .. }) => Err(ApiError::new(
                problem::KEY_IN_USE,
                "the same request is being worked on right now; ask again in a moment",
            )
            .retry_after(1)),
        }
    }

    /// Records the object that a request created.
    pub(crate) fn made(&mut self, tenant: &str, idempotency: &Idempotency, id: &str) {
        let request = Request { fingerprint: idempotency.fingerprint.clone(), made: Some(id.to_owned()) };
        self.known.insert((tenant.to_owned(), idempotency.key.clone()), request);
    }

    /// Releases the key of a deleted object.
    pub(crate) fn forget(&mut self, tenant: &str, idempotency: &Idempotency) {
        self.known.remove(&(tenant.to_owned(), idempotency.key.clone()));
    }

    /// Releases the key of a request that created nothing.
    pub(crate) fn give_up(&mut self, tenant: &str, key: &str) {
        let place = (tenant.to_owned(), key.to_owned());
        if self.known.get(&place).is_some_and(|request| request.made.is_none()) {
            self.known.remove(&place);
        }
    }
}
