//! A folder to work in, the program to run there, and small captures to run it on.

use cager_capture::decode;
use cager_demo::{Capture, Options};
use cager_formats::{FrameOptions, create_frames, open_frames, write_model};
use cager_geometry::mesh::{Model, Point, Polygons, TriMesh, diagonal};
use cager_geometry::vector;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// What most tests encode, in a folder made by [`Dir::with_capture`].
pub(crate) const ENCODE: &str = "encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager --overwrite";

/// Whether the program holds the page of its reports, which is built where Node is.
pub(crate) fn has_report_page() -> bool {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("web/dist/report/report.html").exists()
}

/// A folder of its own for one test.
pub(crate) struct Dir(TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// With the small capture as `rest.obj`, `cage.obj` and `frames.npy`.
    pub(crate) fn with_capture() -> (Self, Small) {
        Self::with(Small::new())
    }

    /// With another capture.
    pub(crate) fn with(small: Small) -> (Self, Small) {
        let dir = Self::new();
        dir.model("rest.obj", &small.rest);
        dir.model("cage.obj", &as_model(&small.cage));
        dir.frames("frames.npy", &small.frames);
        (dir, small)
    }

    /// With the small capture and its encoding, `out.cager` and `report.json`.
    pub(crate) fn with_encoded() -> (Self, Small) {
        let (dir, small) = Self::with_capture();
        dir.cager(&format!("{ENCODE} --report report.json")).succeeds();
        (dir, small)
    }

    /// With a copy of a folder of `tests/cases`.
    pub(crate) fn with_case(name: &str) -> Self {
        let (dir, from) = (Self::new(), Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name));
        let mut files = BTreeMap::new();
        collect(&from, &mut files);
        for (path, bytes) in files.iter().filter(|(path, _)| path.is_file()) {
            dir.write(path.strip_prefix(&from).expect("a file of the case").to_str().expect("UTF-8"), bytes);
        }
        dir
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder for the file");
        fs::write(path, bytes).expect(name);
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).expect(name)
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).expect(name)
    }

    /// What a page of a report holds; checks that it is one file that asks for no other.
    pub(crate) fn report_page(&self, name: &str) -> Value {
        let html = String::from_utf8(self.read(name)).expect("UTF-8");
        assert!(
            html.starts_with("<!doctype html>") && html.contains("content=\"default-src 'none'; script-src 'sha256-")
        );
        // Outside its two scripts.
        let mut markup = html.clone();
        while let Some(start) = markup.find("<script type=") {
            let end = start + markup[start..].find("</script>").expect("the end of a script");
            markup.replace_range(start..end + "</script>".len(), "");
        }
        for reference in ["<script", "</script", "src=", "href=", "http:", "https:", "url(", "<b>"] {
            assert!(!markup.contains(reference), "{reference} in {markup}");
        }
        let (_, rest) = html.split_once("<script type=\"application/json\" id=\"report\">").expect("the report");
        serde_json::from_str(rest.split_once("</script>").expect("its end").0).expect("JSON")
    }

    pub(crate) fn model(&self, name: &str, model: &Model) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder for the model");
        write_model(&path, model).expect(name);
    }

    /// Writes frames as `f32` in the format that the name stands for.
    pub(crate) fn frames(&self, name: &str, frames: &[Vec<f64>]) {
        let points = frames[0].len() / 3;
        let options = FrameOptions::default();
        let mut writer = create_frames(self.path(name), points, frames.len(), &Polygons::new(), &options).expect(name);
        for frame in frames {
            let narrow: Vec<f32> = frame.iter().map(|&x| x as f32).collect();
            writer.write_frame(&narrow).expect(name);
        }
        writer.finish().expect(name);
    }

    /// Everything in the folder, hidden files and folders too, with the bytes of the files.
    pub(crate) fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        collect(self.0.path(), &mut found);
        found
    }

    /// Names of what lies in one folder, hidden files too, in order.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect(folder);
        let mut names: Vec<String> =
            entries.map(|e| e.expect(folder).file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// The program in this folder, with the words of `line` as arguments; no shell sees them.
    pub(crate) fn cager(&self, line: &str) -> TestCommand {
        self.command(env!("CARGO_BIN_EXE_cager"), line.split_whitespace())
    }

    /// Any program in this folder.
    pub(crate) fn command<A: AsRef<OsStr>>(&self, program: &str, args: impl IntoIterator<Item = A>) -> TestCommand {
        let mut command = Command::new(program);
        command.args(args).current_dir(self.0.path()).stdin(Stdio::null());
        TestCommand(command)
    }
}

fn collect(folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, found);
            found.insert(path, Vec::new());
        } else {
            found.insert(path.clone(), fs::read(&path).expect("a file"));
        }
    }
}

/// A command about to be run.
pub(crate) struct TestCommand(Command);

/// What a command said.
#[derive(Debug)]
pub(crate) struct Output {
    pub(crate) status: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl TestCommand {
    pub(crate) fn env(mut self, key: &str, value: &str) -> Self {
        self.0.env(key, value);
        self
    }

    pub(crate) fn arg(mut self, arg: impl AsRef<OsStr>) -> Self {
        self.0.arg(arg);
        self
    }

    /// Runs it in another folder.
    pub(crate) fn within(mut self, folder: &Path) -> Self {
        self.0.current_dir(folder);
        self
    }

    /// Starts it and lets it work; what it says is lost.
    #[cfg(target_os = "linux")]
    pub(crate) fn spawn(mut self) -> std::process::Child {
        self.0.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program runs")
    }

    pub(crate) fn run(mut self) -> Output {
        let done = self.0.output().expect("the program runs");
        Output {
            status: done.status.code(),
            stdout: String::from_utf8(done.stdout).expect("stdout is UTF-8"),
            stderr: String::from_utf8(done.stderr).expect("stderr is UTF-8"),
        }
    }

    /// Runs it, expects exit status 0 and gives the bytes that it wrote to stdout, and what it said on stderr.
    pub(crate) fn streams(mut self) -> (Vec<u8>, String) {
        let done = self.0.output().expect("the program runs");
        let said = String::from_utf8(done.stderr).expect("stderr is UTF-8");
        assert_eq!(done.status.code(), Some(0), "{said}");
        (done.stdout, said)
    }

    /// Runs it and expects exit status 0.
    pub(crate) fn succeeds(self) -> Output {
        let done = self.run();
        assert_eq!(done.status, Some(0), "{}", done.stderr);
        done
    }
}

/// A capture that encodes in milliseconds. The coordinates of its frames are exact in `f32`.
pub(crate) struct Small {
    pub(crate) rest: Model,
    pub(crate) cage: TriMesh,
    pub(crate) frames: Vec<Vec<f64>>,
}

impl Small {
    pub(crate) fn new() -> Self {
        Self::of(600)
    }

    /// With so many points.
    pub(crate) fn of(points: usize) -> Self {
        let capture = Capture::new(&Options { points, frames: 20, cage_vertices: 60 });
        let frames = (0..capture.frames())
            .map(|t| {
                let mut frame = Vec::new();
                capture.frame(t, &mut frame);
                frame.iter().map(|&x| f64::from(x as f32)).collect()
            })
            .collect();
        Self { rest: capture.rest, cage: capture.cage, frames }
    }

    /// One frame as a mesh.
    pub(crate) fn posed(&self, frame: usize) -> Model {
        Model { points: self.frames[frame].as_chunks().0.to_vec(), faces: self.rest.faces.clone(), ..Model::default() }
    }

    /// The cage drawn towards its centre, so that it leaves points outside.
    pub(crate) fn shrunk_cage(&self) -> TriMesh {
        let centre = vector::mean(&self.cage.vertices);
        let shrink = |v: &Point| vector::along(centre, 0.9, vector::sub(*v, centre));
        TriMesh { vertices: self.cage.vertices.iter().map(shrink).collect(), triangles: self.cage.triangles.clone() }
    }
}

/// A mesh as files hold it.
pub(crate) fn as_model(mesh: &TriMesh) -> Model {
    mesh.clone().into()
}

pub(crate) fn polygons(all: impl IntoIterator<Item = Vec<u32>>) -> Polygons {
    let mut faces = Polygons::new();
    for face in all {
        faces.push(&face);
    }
    faces
}

/// A box around points, of six quads.
pub(crate) fn quad_box(points: &[Point]) -> Model {
    let (low, high) = cager_geometry::mesh::bounds(points);
    let margin = 0.05 * diagonal(points);
    let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 0 { low[k] - margin } else { high[k] + margin });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Model { points: (0..8).map(corner).collect(), faces: polygons(quads.map(|q| q.to_vec())), ..Model::default() }
}

/// A NumPy file by hand, so that any type and order can be made.
pub(crate) fn npy(kind: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while !(10 + text.len() + 1).is_multiple_of(64) {
        text.push(' ');
    }
    text.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((text.len() as u16).to_le_bytes());
    file.extend(text.bytes());
    file.extend(data);
    file
}

/// Every face with corners of its own, as flat shading exports it; and the points that they came from.
pub(crate) fn split(model: &Model) -> (Model, Vec<usize>) {
    let mut faces = Vec::new();
    let mut from = Vec::new();
    for face in model.faces.iter() {
        faces.push((from.len() as u32..(from.len() + face.len()) as u32).collect());
        from.extend(face.iter().map(|&v| v as usize));
    }
    let points = from.iter().map(|&v| model.points[v]).collect();
    let colors = from.iter().filter_map(|&v| model.colors.get(v).copied()).collect();
    (Model { points, faces: polygons(faces), colors, ..Model::default() }, from)
}

pub(crate) fn npy_f64(frames: &[Vec<f64>]) -> Vec<u8> {
    let data: Vec<u8> = frames.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    npy("<f8", false, &format!("({}, {}, 3)", frames.len(), frames[0].len() / 3), &data)
}

/// All frames of a capture on disk.
pub(crate) fn read_frames(path: &Path, points: usize) -> Vec<Vec<f64>> {
    let mut reader = open_frames(path, points).expect("frames");
    let mut frames = Vec::new();
    let mut frame = Vec::new();
    while reader.read_next(&mut frame).expect("a frame") {
        frames.push(frame.clone());
    }
    frames
}

/// The cages in a container, each m × 3.
pub(crate) fn read_cages(path: &Path) -> Vec<Vec<f32>> {
    let mut container = decode::open(path).expect("a container");
    let mut cage = Vec::new();
    (0..container.frames())
        .map(|frame| {
            container.read_frame(frame, &mut cage).expect("a cage");
            cage.clone()
        })
        .collect()
}

/// Errors of a decoded capture, measured here and not by the program.
pub(crate) struct Measured {
    pub(crate) l2: Vec<f64>,
    pub(crate) linf: Vec<f64>,
    pub(crate) kg_percent: f64,
}

pub(crate) fn measure(rest: &[Point], truth: &[Vec<f64>], found: &[Vec<f64>]) -> Measured {
    assert_eq!(truth.len(), found.len());
    let (size, n) = (diagonal(rest), rest.len() as f64);
    let mut measured = Measured { l2: Vec::new(), linf: Vec::new(), kg_percent: 0.0 };
    let (mut squared, mut spread) = (0.0, 0.0);
    for (a, b) in truth.iter().zip(found) {
        let (a, b): (&[Point], &[Point]) = (a.as_chunks().0, b.as_chunks().0);
        let squares: Vec<f64> = a.iter().zip(b).map(|(&p, &q)| vector::distance(p, q).powi(2)).collect();
        measured.l2.push((squares.iter().sum::<f64>() / n).sqrt() / size);
        measured.linf.push(squares.iter().fold(0.0, |x: f64, &y| x.max(y)).sqrt() / size);
        let mean = vector::mean(a);
        squared += squares.iter().sum::<f64>();
        spread += a.iter().map(|&p| vector::distance(p, mean).powi(2)).sum::<f64>();
    }
    measured.kg_percent = 100.0 * (squared / spread).sqrt();
    measured
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, &b| a.max(b))
}

/// The relative difference, which must not exceed `limit`.
#[track_caller]
pub(crate) fn close(what: &str, found: f64, expected: f64, limit: f64) -> f64 {
    let difference = (found - expected).abs() / expected.abs();
    assert!(difference <= limit, "{what}: {found:e} where {expected:e} is expected, {difference:.2e} apart");
    difference
}
