//! A cache of limited size that tenants share: what one of them keeps counts against its share, and makes room of its own first.

use crate::admission::{Budget, Exhausted, Permit};
use crate::store::ContentKey;
use std::collections::HashMap;
use std::sync::Arc;

/// Values by content key.
pub(crate) struct SharedCache<V> {
    budget: Arc<Budget>,
    entries: HashMap<ContentKey, Entry<V>>,
    clock: u64,
}

struct Entry<V> {
    value: V,
    used: u64,
    room: Permit,
}

impl<V> SharedCache<V> {
    pub(super) fn new(budget: Arc<Budget>) -> Self {
        Self { budget, entries: HashMap::new(), clock: 0 }
    }

    /// Bytes in use.
    pub(crate) fn bytes(&self) -> u64 {
        self.budget.used()
    }

    /// A value, which counts as used now.
    pub(super) fn get(&mut self, key: &ContentKey) -> Option<&V> {
        self.clock += 1;
        let entry = self.entries.get_mut(key)?;
        entry.used = self.clock;
        Some(&entry.value)
    }

    /// Keeps a value of so many bytes. Where a tenant has its share, what it used longest ago makes room; where the cache is full, what
    /// the tenant that holds most used longest ago. Returns the keys of what is kept no longer, `key` among them if there is no room for it.
    pub(super) fn insert(&mut self, tenant: &str, key: ContentKey, bytes: u64, value: V) -> Vec<ContentKey> {
        self.entries.remove(&key);
        let mut gone = Vec::new();
        while bytes <= self.budget.most() {
            let from = match self.budget.try_take(tenant, bytes) {
                Ok(room) => {
                    self.clock += 1;
                    self.entries.insert(key, Entry { value, used: self.clock, room });
                    return gone;
                }
                Err(Exhausted::OverShare) => Some(tenant.to_owned()),
                Err(Exhausted::Full) => self.budget.largest_holder(),
            };
            let Some(oldest) = from.and_then(|from| self.oldest_of(&from)) else { break };
            self.entries.remove(&oldest);
            gone.push(oldest);
        }
        gone.push(key);
        gone
    }

    pub(super) fn remove(&mut self, key: &ContentKey) {
        self.entries.remove(key);
    }

    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    fn oldest_of(&self, tenant: &str) -> Option<ContentKey> {
        let mine = self.entries.iter().filter(|(_, entry)| entry.room.tenant() == tenant);
        mine.min_by_key(|(_, entry)| entry.used).map(|(key, _)| *key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u8) -> ContentKey {
        ContentKey([number; 32])
    }

    /// Which of these are kept, without using them.
    fn kept(cache: &SharedCache<()>, numbers: impl IntoIterator<Item = u8>) -> Vec<u8> {
        numbers.into_iter().filter(|&number| cache.entries.contains_key(&key(number))).collect()
    }

    #[test]
    fn a_tenant_that_keeps_much_makes_room_of_its_own() {
        let mut cache = SharedCache::new(Budget::new(90, true));
        assert!(cache.insert("quiet", key(0), 10, ()).is_empty());
        let gone: Vec<ContentKey> = (1..40).flat_map(|number| cache.insert("loud", key(number), 10, ())).collect();
        assert!(!gone.contains(&key(0)), "what others keep stays");
        assert_eq!(kept(&cache, 0..40), [0, 35, 36, 37, 38, 39], "of its own, what was used longest ago goes first");
        // Who comes later finds room.
        assert!(cache.insert("late", key(100), 10, ()).is_empty());
        assert_eq!(cache.insert("late", key(101), 30, ()), [35, 36, 37].map(key), "the one with the most gives way");
        assert_eq!(kept(&cache, [0, 100, 101]), [0, 100, 101]);
    }

    #[test]
    fn without_tenants_it_is_one_list_by_last_use() {
        let mut cache = SharedCache::new(Budget::new(30, false));
        for number in 0..3 {
            assert!(cache.insert("local", key(number), 10, ()).is_empty());
        }
        cache.get(&key(0));
        assert_eq!(cache.insert("local", key(3), 20, ()), [1, 2].map(key));
        assert_eq!(kept(&cache, 0..4), [0, 3]);
        assert_eq!((cache.insert("local", key(4), 31, ()), cache.bytes()), (vec![key(4)], 30), "it is larger than all");
        cache.insert("local", key(0), 5, ());
        assert_eq!(cache.bytes(), 25, "what is there already is replaced");
        cache.clear();
        assert_eq!(cache.bytes(), 0);
    }
}
