//! Lingering close, which lets the client read the last response.
//!
//! Closing a socket while data still arrives makes the kernel send a reset, and a reset discards data that the client has not read: of
//! early refusals, such as 413 during an upload, 19 of 20 were lost. So the server closes its sending side and keeps reading for a short
//! while. Such a connection has given its place back: others are served meanwhile.

use super::peers::{PeerPlace, Peers};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, copy, sink};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

/// Longest wait for the client's end.
const TIME: Duration = Duration::from_secs(2);
/// Most bytes that are read and thrown away.
const BYTES: u64 = 1 << 20;
/// How long the socket stays open without reading after that, so that the client can read the response.
const HOLD: Duration = Duration::from_millis(500);

/// Limits how many connections linger.
#[derive(Clone)]
pub(super) struct LingeringPlaces {
    places: Arc<Semaphore>,
    peers: Arc<Peers>,
    most_per_address: usize,
}

impl LingeringPlaces {
    /// `most` places, a quarter of them for one address of which nobody knows who uses it.
    pub(super) fn new(most: usize) -> Self {
        Self { places: Arc::new(Semaphore::new(most)), peers: Arc::default(), most_per_address: most.div_ceil(4) }
    }

    /// A place for a connection that counts for `address`, if for any.
    pub(super) fn enter(self, address: Option<IpAddr>) -> Option<(OwnedSemaphorePermit, Option<PeerPlace>)> {
        let peer = match address {
            Some(address) => Some(self.peers.enter(address, self.most_per_address, |_| false)?),
            None => None,
        };
        Some((self.places.try_acquire_owned().ok()?, peer))
    }
}

/// Closes the sending side, then takes bytes until the client closes, or for 1 MiB, or for 2 s.
pub(super) async fn linger(mut io: impl AsyncRead + AsyncWrite + Unpin) {
    let drain = async {
        if io.shutdown().await.is_err() {
            return;
        }
        // Fewer bytes, or an error: the client has closed. The socket stays open beyond the copy.
        if copy(&mut (&mut io).take(BYTES), &mut sink()).await.is_ok_and(|read| read == BYTES) {
            sleep(HOLD).await;
        }
    };
    // Running out of time is one of the three ordinary ends.
    let _ = timeout(TIME, drain).await;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_address_leaves_places_to_linger_to_others() {
        let places = LingeringPlaces::new(8);
        let enter = |address: Option<[u8; 4]>| places.clone().enter(address.map(IpAddr::from));
        let one = Some([10, 0, 0, 1]);
        let held = [enter(one), enter(one)];
        assert!(held.iter().all(Option::is_some) && enter(one).is_none());
        let known: Vec<_> = std::iter::from_fn(|| enter(None)).collect();
        assert_eq!(known.len(), 6, "the rest is for who is known, and for other addresses");
        drop(held);
        assert!(enter(Some([10, 0, 0, 2])).is_some());
    }
}
