//! The tokens file, and looking a token up in it.

use super::{Grant, Priority, Scope, Tenant, TenantLimits};
use crate::config::{EntriesError, entries, entries::Wrong, line_of};
use serde::Deserialize;
use std::collections::HashMap;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;
use subtle::{Choice, ConditionallySelectable as _, ConstantTimeEq as _};
use tokio_util::sync::CancellationToken;
use toml::Spanned;

/// Why a tokens file cannot be used. Never quotes the file, which would show hashes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// It cannot be read, or an entry is wrong.
    #[error(transparent)]
    Entries(#[from] EntriesError),
    /// The provider of tokens cannot be trusted as it is set.
    #[error("{0}")]
    Provider(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    token: Vec<Written>,
}

/// An entry as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: Spanned<String>,
    tenant: Spanned<String>,
    sha256: Spanned<String>,
    #[serde(default)]
    priority: Priority,
    #[serde(default)]
    scope: Scope,
    max_sessions: Option<u64>,
    max_bytes: Option<u64>,
    max_age_s: Option<u64>,
    max_streams: Option<u64>,
}

type Hash = [u8; 32];

/// All tokens, by their hashes.
#[derive(Default)]
pub(super) struct Entries(Vec<(Hash, Grant)>);

impl Entries {
    pub(super) fn read(file: &Path, defaults: TenantLimits) -> Result<Self, AccessError> {
        Ok(entries::read(file, |text| Self::parse(text, defaults))?)
    }

    /// Reads entries; errors have their place in the text.
    fn parse(text: &str, defaults: TenantLimits) -> Result<Self, Wrong> {
        let document: Document = entries::document(text, "tokens")?;
        if document.token.is_empty() {
            let why = "there is no token in it, and nobody would be let in; add an entry [[token]] with name, tenant and sha256";
            return Err((0, why.to_owned()));
        }
        let mut names = HashMap::new();
        let mut entries: Vec<(Hash, Grant)> = Vec::with_capacity(document.token.len());
        for token in document.token {
            for (word, text) in [("name", &token.name), ("tenant", &token.tenant)] {
                if !is_name(text.as_ref()) {
                    let why = format!("{word} must be 1 to 64 letters, digits, or . _ - and not begin with a point");
                    return Err((text.span().start, why));
                }
            }
            let offset = token.name.span().start;
            let line = line_of(text, offset);
            if let Some(first) = names.insert(token.name.get_ref().clone(), line) {
                let why = format!("name {} is used by another token, in line {first}", token.name.get_ref());
                return Err((offset, format!("{why}; give each its own name")));
            }
            let at_hash = token.sha256.span().start;
            let hash = parse_hash(token.sha256.get_ref()).ok_or_else(|| {
                (at_hash, "sha256 must be 64 hexadecimal digits: printf %s \"$T\" | sha256sum".to_owned())
            })?;
            if entries.iter().any(|(other, _)| *other == hash) {
                return Err((at_hash, "another entry has the same token; make a new one".to_owned()));
            }
            let limits = TenantLimits {
                max_sessions: token.max_sessions.unwrap_or(defaults.max_sessions),
                max_bytes: token.max_bytes.unwrap_or(defaults.max_bytes),
                max_age_s: token.max_age_s.unwrap_or(defaults.max_age_s),
                max_streams: token.max_streams.unwrap_or(defaults.max_streams),
            };
            let tenant = Tenant { name: token.tenant.into_inner(), priority: token.priority, limits };
            let (scope, token) = (token.scope, token.name.into_inner().into());
            let revoked = CancellationToken::new();
            entries.push((hash, Grant { tenant: Arc::new(tenant), token, scope, revoked, expires: None }));
        }
        Ok(Self(entries))
    }

    /// Carries the revocation tokens of the previous entries over; returns the grants that were removed, moved to another tenant or
    /// restricted.
    pub(super) fn inherit_revocations(&mut self, before: &Self) -> Vec<Grant> {
        let mut gone = Vec::new();
        for (hash, old) in &before.0 {
            let same = |(other, new): &&mut (Hash, Grant)| {
                other == hash && new.tenant.name == old.tenant.name && new.scope >= old.scope
            };
            match self.0.iter_mut().find(same) {
                Some((_, new)) => new.revoked = old.revoked.clone(),
                None => gone.push(old.clone()),
            }
        }
        gone
    }

    /// The grant of a token. All entries are compared in constant time, so that timing reveals nothing about the hashes.
    pub(super) fn find(&self, hash: &Hash) -> Option<Grant> {
        let mut found = Choice::from(0);
        let mut place = 0_u64;
        for (index, (other, _)) in self.0.iter().enumerate() {
            let equal = other.ct_eq(hash);
            place.conditional_assign(&(index as u64), equal);
            found |= equal;
        }
        let grant = self.0.get(usize::try_from(place).ok()?).map(|(_, grant)| grant.clone());
        grant.filter(|_| bool::from(found))
    }

    /// The tenants of all tokens; some of them more than once.
    pub(super) fn tenants(&self) -> impl Iterator<Item = &Tenant> {
        self.0.iter().map(|(_, grant)| &*grant.tenant)
    }
}

impl std::fmt::Debug for Entries {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.tenants().map(|tenant| &tenant.name)).finish()
    }
}

pub(crate) fn is_name(text: &str) -> bool {
    (1..=64).contains(&text.len())
        && !text.starts_with('.')
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
}

fn parse_hash(text: &str) -> Option<Hash> {
    let digits = text.as_bytes();
    let mut hash = [0; 32];
    if digits.len() != 2 * hash.len() {
        return None;
    }
    for (byte, pair) in hash.iter_mut().zip(digits.chunks_exact(2)) {
        let digit = |digit: u8| char::from(digit).to_digit(16).and_then(|value| u8::try_from(value).ok());
        *byte = digit(pair[0])? << 4 | digit(pair[1])?;
    }
    Some(hash)
}

/// File attributes by which a change is detected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp {
    modified: Option<SystemTime>,
    changed: (i64, i64),
    bytes: u64,
    inode: u64,
    device: u64,
}

impl Stamp {
    /// `None` where there is no file.
    pub(super) fn of(file: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(file).ok()?;
        Some(Self {
            modified: metadata.modified().ok(),
            changed: (metadata.ctime(), metadata.ctime_nsec()),
            bytes: metadata.len(),
            inode: metadata.ino(),
            device: metadata.dev(),
        })
    }
}
