//! The OpenAPI document.

use cager_service::http::document;
use cager_service::problem;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Path, method and description of every operation.
fn operations(document: &Value) -> Vec<(String, String, Value)> {
    let mut all = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            all.push((path.clone(), method.clone(), operation.clone()));
        }
    }
    all
}

#[test]
fn the_document_is_the_one_in_docs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/openapi.json");
    let now = serde_json::to_string_pretty(&document()).unwrap() + "\n";
    if std::env::var_os("CAGER_UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    let first = now.lines().zip(kept.lines()).position(|(now, kept)| now != kept).map(|k| k + 1);
    assert!(
        now == kept,
        "docs/openapi.json differs from the routes, first in line {first:?}. If clients can live with the change, run `make openapi` and commit it"
    );
}

#[test]
fn every_operation_says_what_it_is_and_has_a_name_of_its_own() {
    let document = document();
    let operations = operations(&document);
    assert_eq!(operations.len(), 57);
    let names: BTreeSet<String> = operations.iter().map(|(_, _, o)| o["operationId"].to_string()).collect();
    assert_eq!(names.len(), operations.len(), "{names:?}");
    for (path, method, operation) in &operations {
        assert!(operation["summary"].as_str().is_some_and(|text| text.len() > 5), "{method} {path}: no summary");
        assert_eq!(
            path.contains("{id}"),
            operation["parameters"].to_string().contains(r#""in":"path""#),
            "{method} {path}"
        );
        for (status, response) in operation["responses"].as_object().unwrap() {
            let place = format!("{method} {path} {status}");
            assert!(response["headers"]["x-request-id"].is_object(), "{place}: no x-request-id");
            let types: Vec<&String> =
                response["content"].as_object().into_iter().flatten().map(|(name, _)| name).collect();
            match status.parse().unwrap() {
                204 | 304 => assert!(types.is_empty(), "{place}: {types:?}"),
                400.. => assert_eq!(types, ["application/problem+json"], "{place}"),
                _ => assert!(!types.is_empty() && response["description"].as_str().is_some(), "{place}"),
            }
        }
    }
}

#[test]
fn every_kind_of_problem_is_described_somewhere() {
    let text = document()["paths"].to_string();
    for kind in problem::ALL {
        assert!(text.contains(&format!("`{}`", kind.word)), "{}", kind.word);
    }
}

#[test]
fn numbers_have_the_range_that_they_have() {
    let document = document();
    let first = &document["paths"]["/v1/sessions/{id}/cages"]["get"]["parameters"][1];
    assert_eq!((&first["name"], &first["schema"]["maximum"]), (&"first".into(), &u32::MAX.into()));
    assert_eq!(document["components"]["schemas"]["Complete"]["properties"]["frames"]["minimum"], 1);
    assert!(!document.to_string().contains("int32"));
}

#[test]
fn headers_that_clients_rely_on_are_described() {
    let document = document();
    let operations = operations(&document);
    let taking = |header: &str| -> Vec<&str> {
        let takes = |operation: &Value| {
            operation["parameters"].as_array().into_iter().flatten().any(|p| p["in"] == "header" && p["name"] == header)
        };
        operations.iter().filter(|(_, _, o)| takes(o)).map(|(path, _, _)| path.rsplit('/').next().unwrap()).collect()
    };
    assert_eq!(taking("Idempotency-Key"), ["cages", "recoveries", "sessions", "shapespaces", "transfers"]);
    assert_eq!(taking("Last-Event-ID"), ["events"; 4]);
    for header in ["Range", "If-Range", "If-None-Match"] {
        let recovered = ["cages", "capture.cager", "joints.bvh", "joints.csv", "report"];
        let files = ["capture.abc", "capture.cager", "capture.glb", "capture.usdc"];
        let sessions = [&["cages"][..], &files, &["coordinates", "export"]].concat();
        let all = [&["cage.obj"][..], &recovered, &sessions, &["capture.cager", "report"]].concat();
        assert_eq!(taking(header), all, "{header}");
    }
    assert_eq!(taking("x-request-id").len(), operations.len());
    let giving = |status: &str, header: &str| {
        operations.iter().filter(|(_, _, o)| o["responses"][status]["headers"][header].is_object()).count()
    };
    assert_eq!([giving("201", "Location"), giving("202", "Location")], [2, 3]);
    assert_eq!([giving("200", "ETag"), giving("206", "Content-Range"), giving("304", "ETag")], [15, 15, 15]);
    assert_eq!(giving("503", "Retry-After"), operations.len());
    assert!(giving("401", "WWW-Authenticate") == 53 && giving("429", "Retry-After") > 0);
}
