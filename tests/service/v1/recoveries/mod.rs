//! `/v1/recoveries`: a template followed through surfaces that are sent one by one.

mod life;
mod person;
mod refused;
mod restart;
mod whole;

use crate::support::{Api, Reply, file, text};
use cager_demo::{Capture, Options};
use cager_formats::model_bytes;
use cager_geometry::mesh::{Model, TriMesh};
use cager_proto::recovery_messages::{Recovery, RecoveryState};
use cager_shape::registration::{Observation, ObservationOptions};
use reqwest::multipart::Form;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Longer than any recovery here takes, also on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);
/// Frames of the sequence.
const FRAMES: u32 = 4;

/// The built-in figure, and clouds of points drawn anew of it in every frame.
struct Scans {
    template: Vec<u8>,
    cage: Vec<u8>,
    /// With names whose numbers do not begin with 0.
    frames: Vec<(String, Vec<u8>)>,
}

fn scans() -> &'static Scans {
    static SCANS: OnceLock<Scans> = OnceLock::new();
    SCANS.get_or_init(|| {
        let capture = Capture::new(&Options { points: 600, frames: 40, cage_vertices: 60 });
        let posed = |frame: usize| {
            let mut numbers = Vec::new();
            capture.frame(frame, &mut numbers);
            Model { points: numbers.as_chunks().0.to_vec(), ..capture.rest.clone() }
        };
        let frames = (0..FRAMES).map(|frame| (format!("scan_{}.ply", 5 + frame), cloud(&posed(frame as usize), frame)));
        let obj = |model: &Model| model_bytes(Path::new("model.obj"), model).expect("a model");
        let cage = Model { points: capture.deformed_cage(0), ..capture.cage.clone().into() };
        Scans { template: obj(&posed(0)), cage: obj(&cage), frames: frames.collect() }
    })
}

fn cloud(model: &Model, seed: u32) -> Vec<u8> {
    let mesh = TriMesh::from(model);
    let options = ObservationOptions { points: 900, seed: u64::from(seed) };
    let (seen, _) = Observation::of_mesh(&mesh.vertices, &mesh.triangles, &options).expect("a surface");
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", seen.points.len());
    ["x", "y", "z", "nx", "ny", "nz"].iter().for_each(|name| writeln!(text, "property float {name}").expect("text"));
    text += "end_header\n";
    for ([x, y, z], [a, b, c]) in seen.points.iter().zip(&seen.normals) {
        writeln!(text, "{x} {y} {z} {a} {b} {c}").expect("text");
    }
    text.into_bytes()
}

impl Scans {
    fn form(&self, options: &Value) -> Form {
        Form::new().part("template", file("rest.obj", &self.template)).part("options", text(options))
    }

    /// With a cage, so that none is made at every beginning.
    fn caged_form(&self, options: &Value) -> Form {
        self.form(options).part("cage", file("cage.obj", &self.cage))
    }

    /// What the command line makes of the first frames, with these arguments.
    fn recovered(&self, more: &str) -> Vec<u8> {
        self.recovered_from(("rest.obj", &self.template), more)
    }

    /// As [`Self::recovered`], from another template.
    fn recovered_from(&self, (name, template): (&str, &[u8]), more: &str) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join(name), template).expect("a file");
        std::fs::write(folder.path().join("cage.obj"), &self.cage).expect("a file");
        for (name, bytes) in &self.frames {
            std::fs::write(folder.path().join(name), bytes).expect("a file");
        }
        let done = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args(format!("recover --template {name} --frames scan_*.ply -o out.cager").split(' '))
            .args(more.split_whitespace())
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("the program runs");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        std::fs::read(folder.path().join("out.cager")).expect("a container")
    }

    /// Files of frames as the parts of a request.
    fn parts(&self, frames: std::ops::Range<u32>) -> Form {
        self.frames[frames.start as usize..frames.end as usize]
            .iter()
            .fold(Form::new(), |form, (name, bytes)| form.part("frame", file(name, bytes)))
    }
}

async fn create(api: &Api, form: Form, key: Option<&str>) -> Reply {
    let request = api.request(http::Method::POST, "/v1/recoveries").multipart(form);
    api.send(match key {
        Some(key) => request.header("idempotency-key", key),
        None => request,
    })
    .await
}

pub(crate) async fn created(api: &Api, options: &Value) -> Recovery {
    create(api, scans().form(options), None).await.is(202)
}

async fn post(api: &Api, id: &str, first: u32, form: Form) -> Reply {
    let path = format!("/v1/recoveries/{id}/frames?first={first}");
    api.send(api.request(http::Method::POST, &path).multipart(form)).await
}

/// Posts the first frame.
pub(crate) async fn post_first(api: &Api, id: &str) -> Reply {
    post(api, id, 0, scans().parts(0..1)).await
}

async fn complete(api: &Api, id: &str, frames: u32) -> Reply {
    api.post_json(&format!("/v1/recoveries/{id}/complete"), &json!({ "frames": frames })).await
}

async fn recovery(api: &Api, id: &str) -> Recovery {
    api.get(&format!("/v1/recoveries/{id}")).await.is(200)
}

/// Waits until a recovery is as wanted; it must not fail meanwhile.
async fn until(api: &Api, id: &str, is_so: impl Fn(&Recovery) -> bool) -> Recovery {
    let clock = Instant::now();
    loop {
        let found = recovery(api, id).await;
        if is_so(&found) {
            return found;
        }
        assert!(!found.state.is_final() && clock.elapsed() < PATIENCE, "{found:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn completed(api: &Api, id: &str) -> Recovery {
    until(api, id, |recovery| recovery.state == RecoveryState::Completed).await
}

/// Waits until a recovery has failed.
async fn failed(api: &Api, id: &str) -> Recovery {
    let clock = Instant::now();
    loop {
        let found = recovery(api, id).await;
        if found.state == RecoveryState::Failed {
            return found;
        }
        assert!(!found.state.is_final() && clock.elapsed() < PATIENCE, "{found:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

async fn container(api: &Api, id: &str) -> Vec<u8> {
    api.get(&format!("/v1/recoveries/{id}/capture.cager")).await.expect(200).body.to_vec()
}
