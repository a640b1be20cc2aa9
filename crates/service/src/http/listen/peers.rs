//! How many connections one address has of which nobody knows whose they are, so that a single host cannot take every place.

use crate::sync::lock;
use std::collections::HashMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex};

/// Connections by address.
#[derive(Default)]
pub(super) struct Peers(Mutex<HashMap<IpAddr, usize>>);

/// A connection that counts for its address until it is dropped.
pub(super) struct PeerPlace {
    peers: Arc<Peers>,
    pub(super) address: IpAddr,
}

impl Peers {
    /// Counts a connection of an address that may have `most` of them, or one more where `make_room` has closed one; `None` beyond.
    pub(super) fn enter(
        self: &Arc<Self>,
        address: IpAddr,
        most: usize,
        make_room: impl FnOnce(IpAddr) -> bool,
    ) -> Option<PeerPlace> {
        let address = network(address);
        let has_room = lock(&self.0).get(&address).is_none_or(|count| *count < most);
        if !has_room && !make_room(address) {
            return None;
        }
        *lock(&self.0).entry(address).or_default() += 1;
        Some(PeerPlace { peers: Arc::clone(self), address })
    }
}

impl Drop for PeerPlace {
    fn drop(&mut self) {
        let mut peers = lock(&self.peers.0);
        if let Some(count) = peers.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                peers.remove(&self.address);
            }
        }
    }
}

/// What one host can choose its address from: of IPv6 its network of 64 bits.
fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from(u128::from(address) & (u128::MAX << 64)).into(),
        v4 => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_has_its_share_and_gives_it_back() {
        let peers = Arc::new(Peers::default());
        let enter = |address: &str| peers.enter(address.parse().expect("an address"), 2, |_| false);
        let held = [enter("10.0.0.1"), enter("::ffff:10.0.0.1")];
        assert!(held.iter().all(Option::is_some) && enter("10.0.0.1").is_none());
        assert!(enter("10.0.0.2").is_some());
        let same = [enter("2001:db8::1"), enter("2001:db8::ffff:2")];
        assert!(same.iter().all(Option::is_some) && enter("2001:db8::3").is_none());
        assert!(enter("2001:db8:0:1::1").is_some());
        assert!(peers.enter([10, 0, 0, 1].into(), 2, |_| true).is_some(), "another one was closed");
        drop((held, same));
        assert!(enter("10.0.0.1").is_some());
        assert!(lock(&peers.0).is_empty());
    }
}
