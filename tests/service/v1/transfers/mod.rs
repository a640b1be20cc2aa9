//! `/v1/transfers`: the motion of one model moved onto another.

mod life;
mod refused;
mod restart;
mod whole;

use crate::support::{Api, Capture, Mesh, Reply, eventually, file, text, usd};
use cager_geometry::mesh::{Model, Polygons};
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::Transfer;
use reqwest::multipart::Form;
use serde_json::Value;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Longer than any transfer here takes, also on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);
/// What corresponds: the target has the source's points first. One pair is a little off, so that it shows.
const PAIRS: &str = "0 0 # as they are\n100 100\n200,215\n";
/// Vertices of the cages that are designed.
const CAGE_VERTICES: u32 = 60;
/// Frames of the motion.
const FRAMES: u32 = 5;

/// The built-in figure in motion, and the same figure with other points and faces.
struct Motion {
    capture: Capture,
    frames: Vec<u8>,
    target: Vec<u8>,
    /// The same in a file that says what its positions mean.
    usd_target: Vec<u8>,
    target_points: u32,
}

fn motion() -> &'static Motion {
    static MOTION: OnceLock<Motion> = OnceLock::new();
    MOTION.get_or_init(|| {
        let capture = Capture::new(400, 40, FRAMES as usize);
        let rest = &capture.rest.model;
        // Every quad split at its centre.
        let mut target = Model { points: rest.points.clone(), ..Model::default() };
        let mut faces = Polygons::new();
        for face in rest.faces.iter() {
            let centre =
                [0, 1, 2].map(|k| face.iter().map(|&v| rest.points[v as usize][k]).sum::<f64>() / face.len() as f64);
            let middle = target.points.len() as u32;
            target.points.push(centre);
            (0..face.len()).for_each(|k| faces.push(&[face[k], face[(k + 1) % face.len()], middle]));
        }
        target.faces = faces;
        let usd_target = usd(&target);
        let (target_points, target) = (target.points.len() as u32, Mesh::new(target).obj);
        let frames = capture.npy(0..FRAMES);
        Motion { capture, frames, target, usd_target, target_points }
    })
}

impl Motion {
    /// A request with these options; its cage is small, and soon designed, where they do not say otherwise.
    fn form(&self, options: &Value) -> Form {
        let mut options = options.clone();
        options.as_object_mut().expect("options").entry("cage_vertices").or_insert(CAGE_VERTICES.into());
        Form::new()
            .part("options", text(&options))
            .part("source_rest", file("rest.obj", &self.capture.rest.obj))
            .part("source_frames", file("frames.npy", &self.frames))
            .part("target", file("copy.obj", &self.target))
    }

    /// What the command line makes of it, with these arguments.
    fn moved(&self, more: &str) -> Vec<u8> {
        self.moved_from("--source-rest rest.obj --source-frames frames.npy", &[], more)
    }

    /// As [`Self::moved`], of another source.
    fn moved_from(&self, source: &str, container: &[u8], more: &str) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        let files = [
            ("rest.obj", &self.capture.rest.obj[..]),
            ("frames.npy", &self.frames),
            ("copy.obj", &self.target),
            ("in.cager", container),
            ("pairs.txt", PAIRS.as_bytes()),
            ("copy.usda", &self.usd_target),
        ];
        files.iter().for_each(|(name, bytes)| std::fs::write(folder.path().join(name), bytes).expect("a file"));
        let size =
            if more.contains("--cage-vertices") { String::new() } else { format!("--cage-vertices {CAGE_VERTICES}") };
        let target = if more.contains("--target ") { "" } else { "--target copy.obj" };
        let done = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args(format!("transfer {source} {target} -o out.cager {more} {size}").split_whitespace())
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("the program runs");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        std::fs::read(folder.path().join("out.cager")).expect("a container")
    }
}

async fn create(api: &Api, form: Form, key: Option<&str>) -> Reply {
    let request = api.request(http::Method::POST, "/v1/transfers").multipart(form);
    api.send(match key {
        Some(key) => request.header("idempotency-key", key),
        None => request,
    })
    .await
}

pub(super) async fn created(api: &Api, options: &Value) -> Transfer {
    create(api, motion().form(options), None).await.is(202)
}

async fn transfer(api: &Api, id: &str) -> Transfer {
    api.get(&format!("/v1/transfers/{id}")).await.is(200)
}

/// Waits until a transfer runs.
async fn running(api: &Api, id: &str) {
    eventually("it runs", async || (transfer(api, id).await.state == JobState::Running).then_some(())).await;
}

/// Waits until a transfer is over.
async fn ended(api: &Api, id: &str) -> Transfer {
    let clock = Instant::now();
    loop {
        let found = transfer(api, id).await;
        if found.state.is_final() {
            return found;
        }
        assert!(clock.elapsed() < PATIENCE, "{found:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Waits until a transfer is completed; its container.
async fn completed(api: &Api, id: &str) -> Vec<u8> {
    let found = ended(api, id).await;
    assert_eq!(found.state, JobState::Completed, "{found:?}");
    api.get(&format!("/v1/transfers/{id}/capture.cager")).await.expect(200).body.to_vec()
}
