//! Tokens of an OpenID Connect provider.

use crate::support::{Capture, Elsewhere, TestApp, eventually, within};
use axum::response::IntoResponse as _;
use base64::Engine as _;
use base64::prelude::BASE64_URL_SAFE_NO_PAD;
use ring::rand::SystemRandom;
use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, KeyPair as _};
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

fn encoded(bytes: impl AsRef<[u8]>) -> String {
    BASE64_URL_SAFE_NO_PAD.encode(bytes)
}

fn now() -> u64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a time").as_secs()
}

/// A key pair with its name.
struct Key {
    id: &'static str,
    pair: EcdsaKeyPair,
}

impl Key {
    fn new(id: &'static str) -> Self {
        let random = SystemRandom::new();
        let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
        let document = EcdsaKeyPair::generate_pkcs8(algorithm, &random).expect("a key");
        Self { id, pair: EcdsaKeyPair::from_pkcs8(algorithm, document.as_ref(), &random).expect("a key") }
    }

    fn public(&self) -> Value {
        let point = self.pair.public_key().as_ref();
        json!({ "kty": "EC", "crv": "P-256", "use": "sig", "alg": "ES256", "kid": self.id,
                "x": encoded(&point[1..33]), "y": encoded(&point[33..]) })
    }

    fn sign(&self, claims: &Value) -> String {
        self.sign_as(&json!({ "alg": "ES256", "typ": "at+jwt", "kid": self.id }), claims)
    }

    fn sign_as(&self, header: &Value, claims: &Value) -> String {
        let message = format!("{}.{}", encoded(header.to_string()), encoded(claims.to_string()));
        let signature = self.pair.sign(&SystemRandom::new(), message.as_bytes()).expect("a signature");
        format!("{message}.{}", encoded(signature))
    }
}

/// A provider whose keys can be changed, and a service that trusts it.
struct Place {
    provider: Elsewhere,
    keys: Arc<Mutex<Vec<Value>>>,
    key: Key,
    app: TestApp,
}

impl Place {
    async fn new(settings: &[&str]) -> Self {
        let key = Key::new("first");
        let keys = Arc::new(Mutex::new(vec![key.public()]));
        let (issuer, set) = (Arc::new(Mutex::new(String::new())), Arc::clone(&keys));
        let answered = Arc::clone(&issuer);
        let provider = Elsewhere::answering(move |asked| match asked.path.as_str() {
            "/farm/.well-known/openid-configuration" => {
                let issuer = answered.lock().expect("no panic").clone();
                axum::Json(json!({ "issuer": issuer, "jwks_uri": format!("{issuer}/keys") })).into_response()
            }
            "/farm/keys" => axum::Json(json!({ "keys": *set.lock().expect("no panic") })).into_response(),
            _ => http::StatusCode::NOT_FOUND.into_response(),
        })
        .await;
        let address = format!("{}/farm", provider.address);
        issuer.lock().expect("no panic").clone_from(&address);
        let issuer = format!("oidc_issuer={address}");
        let app = TestApp::with(&[&[issuer.as_str(), "oidc_audience=cager"], settings].concat());
        let place = Self { provider, keys, key, app };
        let token = place.key.sign(&place.claims());
        eventually("the keys", async || (place.status(&token).await == 200).then_some(())).await;
        place
    }

    fn claims(&self) -> Value {
        json!({ "iss": format!("{}/farm", self.provider.address), "aud": "cager", "sub": "user-7", "exp": now() + 300,
                "tenant": "studio-a", "scope": "openid cager:write" })
    }

    fn with(&self, changed: &Value) -> Value {
        let mut claims = self.claims();
        for (name, value) in changed.as_object().expect("an object") {
            claims[name] = value.clone();
        }
        claims
    }

    async fn status(&self, token: &str) -> u16 {
        self.app.caller(Some(token)).get("/v1/sessions").await.status
    }
}

#[tokio::test]
async fn the_claims_say_which_tenant_it_is_and_what_it_may_do() {
    let place = Place::new(&[]).await;
    let anna = place.app.caller(Some(&place.key.sign(&place.claims())));
    let session = anna.ready(Capture::tiny()).await;
    let same =
        place.key.sign(&place.with(&json!({ "sub": "user-8", "scope": "cager:read", "aud": ["other", "cager"] })));
    let reader = place.app.caller(Some(&same));
    assert_eq!(reader.session(&session.id).await.id, session.id, "the same tenant");
    reader.delete(&format!("/v1/sessions/{}", session.id)).await.problem(403, "forbidden");
    let other = place.key.sign(&place.with(&json!({ "tenant": "studio-b", "scp": ["cager:admin"], "scope": null })));
    place.app.caller(Some(&other)).get(&format!("/v1/sessions/{}", session.id)).await.problem(404, "not-found");
    assert!(place.app.log().contains("user-7") && place.app.log().contains("studio-a"), "the log says who it was");
}

#[tokio::test]
async fn tokens_that_are_not_to_be_believed_are_refused() {
    let place = Place::new(&[]).await;
    let stranger = Key::new("first");
    let header = json!({ "alg": "none", "typ": "JWT" });
    let unsigned = format!("{}.{}.", encoded(header.to_string()), encoded(place.claims().to_string()));
    let secret = |claims: &Value| {
        // The public key as if it were a shared secret.
        let header = json!({ "alg": "HS256", "kid": "first" });
        let message = format!("{}.{}", encoded(header.to_string()), encoded(claims.to_string()));
        let key = ring::hmac::Key::new(ring::hmac::HMAC_SHA256, place.key.pair.public_key().as_ref());
        format!("{message}.{}", encoded(ring::hmac::sign(&key, message.as_bytes())))
    };
    let good = place.key.sign(&place.claims());
    let other_claims = place.with(&json!({ "tenant": "studio-b" }));
    let parts: Vec<&str> = good.split('.').collect();
    let changed = format!("{}.{}.{}", parts[0], encoded(other_claims.to_string()), parts[2]);
    for (what, token, why) in [
        ("another key", stranger.sign(&place.claims()), "not valid"),
        ("no signature", unsigned, "not valid"),
        ("a shared secret", secret(&place.claims()), "not valid"),
        ("changed claims", changed, "not valid"),
        ("not a token", "a.b.c-aaaaaaaaaaaaaaaaaaaa".to_owned(), "not valid"),
        (
            "something critical",
            place
                .key
                .sign_as(&json!({ "alg": "ES256", "kid": "first", "crit": ["b64"], "b64": true }), &place.claims()),
            "not valid",
        ),
        (
            "another algorithm",
            place.key.sign_as(&json!({ "alg": "EdDSA", "kid": "first" }), &place.claims()),
            "not valid",
        ),
        ("expired", place.key.sign(&place.with(&json!({ "exp": now() - 120 }))), "expired"),
        ("no expiry", place.key.sign(&place.with(&json!({ "exp": null }))), "not"),
        ("not yet", place.key.sign(&place.with(&json!({ "nbf": now() + 300 }))), "not valid"),
        ("another service", place.key.sign(&place.with(&json!({ "aud": "render" }))), "iss or aud"),
        ("another provider", place.key.sign(&place.with(&json!({ "iss": "https://elsewhere.example" }))), "iss or aud"),
        ("no tenant", place.key.sign(&place.with(&json!({ "tenant": null }))), "tenant"),
        ("a tenant that is a path", place.key.sign(&place.with(&json!({ "tenant": "../b" }))), "tenant"),
        ("no scope", place.key.sign(&place.with(&json!({ "scope": "openid" }))), "scope"),
    ] {
        let problem = place.app.caller(Some(&token)).get("/v1/sessions").await.problem(401, "unauthorized");
        assert!(problem.detail.contains(why), "{what}: {}", problem.detail);
    }
    place.app.caller(None).get("/v1/sessions").await.problem(401, "unauthorized");
    assert_eq!(place.status(&good).await, 200);
}

#[tokio::test]
async fn keys_that_the_provider_changes_are_fetched_when_they_are_met() {
    let place = Place::new(&[]).await;
    let next = Key::new("second");
    // What is not understood stands in nobody's way.
    let odd = json!({ "kty": "EC", "crv": "P-256", "kid": 7, "x": "AA", "y": "AA" });
    *place.keys.lock().expect("no panic") =
        vec![odd, Value::Null, json!({ "kty": "OKP", "crv": "X25519", "x": "AA" }), next.public()];
    let token = next.sign(&place.claims());
    let got = eventually("the new key", async || (place.status(&token).await == 200).then_some(())).await;
    assert_eq!(got, ());
    let old = place.key.sign(&place.claims());
    eventually("that the old one is there no more", async || (place.status(&old).await == 401).then_some(())).await;
}

#[tokio::test]
async fn what_was_begun_with_a_token_ends_when_it_expires() {
    let place = Place::new(&[]).await;
    let session = place.app.caller(Some(&place.key.sign(&place.claims()))).ready(Capture::tiny()).await;
    // Clocks may differ by a minute.
    let token = place.key.sign(&place.with(&json!({ "exp": now() - 57 })));
    let mut followed =
        place.app.caller(Some(&token)).open(&format!("/v1/sessions/{}/cages?follow=true", session.id)).await;
    let end = within("the end of the stream", Duration::from_secs(10), async {
        loop {
            match followed.chunk().await {
                Ok(Some(_)) => {}
                end => return end,
            }
        }
    });
    assert!(end.await.is_err(), "it is cut, not ended as if all had come");
}

#[tokio::test]
async fn a_provider_that_is_not_there_is_no_reason_to_let_anybody_in() {
    let provider = Elsewhere::with(&[500; 9]).await;
    let issuer = format!("oidc_issuer={}", provider.address);
    let app = TestApp::with(&[&issuer, "oidc_audience=cager"]);
    let token = Key::new("first").sign(&json!({ "iss": provider.address, "aud": "cager", "exp": now() + 300 }));
    let reply = app.caller(Some(&token)).get("/v1/sessions").await;
    assert!(reply.problem(503, "busy").detail.contains("keys"), "{}", reply.text());
    app.caller(None).get("/v1/sessions").await.problem(401, "unauthorized");
    eventually("a line in the log", async || app.log().contains("cannot be fetched").then_some(())).await;
}
