//! `GET …/coordinates`: what a client needs to decode by itself.

use crate::support::{Capture, OCTETS, TestApp, cages_of};
use cager_client::LocalDecoder;

#[tokio::test]
async fn coordinates_times_a_cage_are_the_positions_that_the_service_decodes() {
    let app = TestApp::start();
    let capture = Capture::small();
    let session = app.ready(capture).await;
    app.upload(&session.id, 0, capture.raw(0..20)).await;
    let (unknowns, n) = (session.unknowns.expect("known"), capture.points());
    let reply = app.get(&format!("/v1/sessions/{}/coordinates", session.id)).await.expect(200);
    assert_eq!(reply.header("cager-rows"), n.to_string());
    assert_eq!(reply.header("cager-columns"), unknowns.to_string());
    let phi = reply.body.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let phi: Vec<f64> = phi.collect();
    assert_eq!(phi.len(), n * unknowns as usize);
    for row in phi.chunks_exact(unknowns as usize) {
        assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-4, "coordinates sum to one");
    }
    let raw = app.cages(&session.id).await;
    let cages = cages_of(&raw, unknowns);
    let reply = app.post(&format!("/v1/sessions/{}/decode", session.id), OCTETS, raw.clone()).await.expect(200);
    let positions = cages_of(&reply.body, n as u32);
    assert_eq!(positions.len(), 20);
    // By hand.
    for (cage, positions) in cages.iter().zip(&positions) {
        for i in 0..n {
            for k in 0..3 {
                let row = &phi[i * unknowns as usize..][..unknowns as usize];
                let by_hand: f64 = row.iter().zip(cage.chunks_exact(3)).map(|(w, c)| w * f64::from(c[k])).sum();
                assert!((by_hand - f64::from(positions[3 * i + k])).abs() < 1e-4, "point {i}");
            }
        }
    }
    // By the client, to the bit.
    let local = LocalDecoder::fetch(&app.client(), &session.id).await.expect("a decoder");
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    assert!(local.decode(&views).expect("positions") == positions);
}
