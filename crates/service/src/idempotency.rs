//! Idempotency keys (`Idempotency-Key`) by tenant.

use crate::problem::{self, ApiError};
use crate::store::{ContentKey, Idempotency};
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;

/// Known keys with their requests and results.
#[derive(Default)]
pub(crate) struct KnownKeys {
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
    /// The same request came before and created the object with this id.
    Done(String),
    /// A request with the key created the object with this id, under a version whose fingerprints cannot be compared.
    Earlier(String),
}

/// A registry of objects that are created by requests with idempotency keys.
pub(crate) trait Keyed<T> {
    /// Accesses the keys under the registry's lock.
    fn requests<R>(&self, work: impl FnOnce(&mut KnownKeys) -> R) -> R;
    /// The object with this id.
    fn made(&self, id: &str) -> Option<Arc<T>>;
}

/// What fingerprints begin with. Those of earlier versions have no such beginning: they held the version of the solver too, so that
/// nothing is known of one that differs.
const SENT: &str = "sent-";

/// A request with a key for these parts and options. Its fingerprint is made of what the client sent and nothing else, so that it is the
/// same after an upgrade.
pub(crate) fn fingerprint<'a>(
    key: Option<String>,
    parts: impl IntoIterator<Item = &'a [u8]>,
    options: &impl Serialize,
) -> Option<Idempotency> {
    let key = key?;
    let options = serde_json::to_vec(options).unwrap_or_default();
    let mut sent: Vec<&[u8]> = parts.into_iter().collect();
    sent.push(&options);
    let sent = ContentKey::of(sent);
    Some(Idempotency { key, fingerprint: format!("{SENT}{sent}") })
}

/// A request with a key for files, by their parts, names and digests, and options, as [`fingerprint`].
pub(crate) fn fingerprint_of_files<'a>(
    key: Option<String>,
    files: impl IntoIterator<Item = (&'a str, &'a str, blake3::Hash)>,
    options: &impl Serialize,
) -> Option<Idempotency> {
    let key = key?;
    let files: Vec<_> = files.into_iter().map(|(part, name, digest)| (part, extension(name), digest)).collect();
    let sent = files.iter().flat_map(|(part, name, digest)| [part.as_bytes(), name.as_bytes(), digest.as_bytes()]);
    fingerprint(Some(key), sent, options)
}

/// The part of a file's name that says something about its content, in lower case.
pub(crate) fn extension(name: &str) -> String {
    name.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase()
}

/// What an earlier request with the same key created, if it did. `may_be` compares the request with an object that a version with other
/// fingerprints created for its key.
///
/// # Errors
/// Those of [`KnownKeys::look`]; `NOT_FOUND` if the object was deleted.
pub(crate) fn made_before<T>(
    registry: &impl Keyed<T>,
    tenant: &str,
    request: Option<&Idempotency>,
    may_be: impl FnOnce(&T) -> bool,
) -> Result<Option<Arc<T>>, ApiError> {
    let Some(request) = request else { return Ok(None) };
    match registry.requests(|requests| requests.look(tenant, request))? {
        KeyLookup::First => Ok(None),
        KeyLookup::Done(id) => made(registry, &id).map(Some),
        KeyLookup::Earlier(id) => {
            let object = made(registry, &id)?;
            if may_be(&object) { Ok(Some(object)) } else { Err(reused()) }
        }
    }
}

/// Creates an object, at most once per key, after [`made_before`] found none.
///
/// # Errors
/// Those of `make` and of [`KnownKeys::begin`]; `NOT_FOUND` if the object of an earlier request was deleted.
pub(crate) async fn create_once<T, Making: Future<Output = Result<Arc<T>, ApiError>>>(
    registry: &impl Keyed<T>,
    tenant: &str,
    request: Option<Idempotency>,
    make: impl FnOnce(Option<Idempotency>) -> Making,
) -> Result<Arc<T>, ApiError> {
    let Some(request) = request else { return make(None).await };
    match registry.requests(|requests| requests.begin(tenant, &request))? {
        KeyLookup::Done(id) | KeyLookup::Earlier(id) => made(registry, &id),
        KeyLookup::First => {
            // Releases the key, also after a panic, unless an object was created.
            let key = request.key.clone();
            let _free = ReleaseOnDrop(|| registry.requests(|requests| requests.give_up(tenant, &key)));
            make(Some(request)).await
        }
    }
}

fn made<T>(registry: &impl Keyed<T>, id: &str) -> Result<Arc<T>, ApiError> {
    let gone = || ApiError::new(problem::NOT_FOUND, "what this request made before was deleted; use a new key");
    registry.made(id).ok_or_else(gone)
}

fn reused() -> ApiError {
    let detail = "this Idempotency-Key came with other files or options before; use a new key for a new request";
    ApiError::new(problem::KEY_REUSED, detail)
}

struct ReleaseOnDrop<F: FnMut()>(F);

impl<F: FnMut()> Drop for ReleaseOnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

impl KnownKeys {
    /// Looks a request up.
    ///
    /// # Errors
    /// The key belongs to another request, or to one that is still being worked on.
    fn look(&self, tenant: &str, request: &Idempotency) -> Result<KeyLookup, ApiError> {
        let Idempotency { key, fingerprint } = request;
        match self.known.get(&(tenant.to_owned(), key.clone())) {
            None => Ok(KeyLookup::First),
            Some(Request { fingerprint: before, made: Some(id) }) if !before.starts_with(SENT) => {
                Ok(KeyLookup::Earlier(id.clone()))
            }
            Some(request) if request.fingerprint != *fingerprint => Err(reused()),
            Some(Request { made: Some(id), .. }) => Ok(KeyLookup::Done(id.clone())),
            Some(Request { made: None, .. }) => Err(ApiError::new(
                problem::KEY_IN_USE,
                "the same request is being worked on right now; ask again in a moment",
            )
            .retry_after(1)),
        }
    }

    /// As [`Self::look`]; registers a request that is the first.
    ///
    /// # Errors
    /// As [`Self::look`].
    fn begin(&mut self, tenant: &str, request: &Idempotency) -> Result<KeyLookup, ApiError> {
        let found = self.look(tenant, request)?;
        if matches!(found, KeyLookup::First) {
            let Idempotency { key, fingerprint } = request.clone();
            self.known.insert((tenant.to_owned(), key), Request { fingerprint, made: None });
        }
        Ok(found)
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

#[cfg(test)]
mod tests {
    use super::*;
    use cager_proto::cage_messages::CageOptions;
    use cager_proto::messages::SessionOptions;

    #[test]
    fn a_fingerprint_is_what_was_sent_whatever_the_version_of_the_solver() {
        let parts: [&[u8]; 2] = [b"rest", b"cage"];
        let of = |options: &dyn Fn() -> Option<Idempotency>| options().expect("a key").fingerprint;
        let key = || Some("key".to_owned());
        let some = SessionOptions { lambda: Some(0.5), ..SessionOptions::default() };
        // Keys outlive upgrades: with other values here, a request repeated after one would be refused as another.
        let defaults = "sent-d4852dca7117667e1b9a86586b926fb4a3680ffad2b05cb61e46935835c475a6";
        assert_eq!(of(&|| fingerprint(key(), parts, &SessionOptions::default())), defaults);
        assert_eq!(of(&|| fingerprint(key(), parts, &CageOptions::default())), defaults);
        assert_eq!(
            of(&|| fingerprint(key(), parts, &some)),
            "sent-d43d828b855e62a4a92c492ee98d8dcf9a30c108854433965115b45190fe5dff"
        );
    }
}
