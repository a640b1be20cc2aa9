//! `cager inspect`.

use crate::support::{Dir, ENCODE, as_model};
use serde_json::Value;

#[test]
fn json_agrees_with_the_report_in_every_key() {
    let (dir, _) = Dir::with_encoded();
    let done = dir.cager("inspect out.cager --json").succeeds();
    let mut found: Value = serde_json::from_str(&done.stdout).expect("JSON");
    let mut report = dir.json("report.json");
    // Which point is worst takes the capture to tell, and exactly how far off it is.
    let worst =
        |json: &mut Value| json["error"].as_object_mut().and_then(|error| error.remove("worst")).expect("worst");
    let (in_file, measured) = (worst(&mut found), worst(&mut report));
    assert_eq!(in_file["frame"], measured["frame"]);
    let (in_file, measured) = (in_file["distance"].as_f64().expect("one"), measured["distance"].as_f64().expect("one"));
    assert!((in_file / measured - 1.0).abs() < 1e-6, "{in_file} where {measured} was reported");
    for (key, value) in report.as_object().expect("an object") {
        // How long encoding took is not in the file.
        if key != "seconds" {
            assert!(agrees(&found[key], value), "{key}: {} where the report has {value}", found[key]);
        }
    }
    let bytes: u64 = found["sections"].as_array().expect("sections").iter().filter_map(|s| s["bytes"].as_u64()).sum();
    let file = dir.read("out.cager").len() as u64;
    assert!(bytes <= file && bytes + 1000 > file, "sections of {bytes} bytes in a file of {file}");
}

/// Equal, but for the last bit of a number, which reading JSON may cost.
fn agrees(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(key, x)| b.get(key).is_some_and(|y| agrees(x, y)))
        }
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(x, y)| agrees(x, y)),
        (Value::Number(x), Value::Number(y)) => match (x.as_f64(), y.as_f64()) {
            (Some(x), Some(y)) => (x - y).abs() <= 1e-15 * y.abs(),
            _ => false,
        },
        _ => a == b,
    }
}

#[test]
fn text_names_the_file_and_its_sizes() {
    let (dir, small) = Dir::with_encoded();
    let text = dir.cager("inspect out.cager").succeeds().stdout;
    assert!(text.starts_with("out.cager: "), "{text}");
    assert!(text.contains(&format!("20 frames of {} points", small.rest.points.len())), "{text}");
    assert!(text.contains(&format!("{} vertices", small.cage.vertices.len())), "{text}");
    assert!(text.contains("L2") && text.contains("mvc") && text.contains("spread"), "{text}");
}

#[test]
fn warnings_of_the_encoding_are_shown_again_on_stderr() {
    let (dir, small) = Dir::with_capture();
    dir.model("cage.obj", &as_model(&small.shrunk_cage()));
    let said = dir.cager(ENCODE).succeeds().stderr;
    let again = dir.cager("inspect out.cager").succeeds();
    assert!(said.contains("outside"));
    assert_eq!(again.stderr, said);
    assert!(!again.stdout.contains("outside"));
    let json: Value = serde_json::from_str(&dir.cager("inspect out.cager --json").succeeds().stdout).expect("JSON");
    assert!(json["warnings"][0].as_str().is_some_and(|w| said.contains(w)));
}
