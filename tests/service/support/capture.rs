//! Small captures, as bytes.

use cager_demo::Options;
use cager_formats::{FrameOptions, Units, Up, create_frames, write_model};
use cager_geometry::mesh::{Model, Polygons, TriMesh};
use cager_proto::container::ContainerReader;
use cager_proto::record::{self, Kind};
use std::io::Cursor;
use std::ops::Range;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

/// A capture whose frames are exact in single precision.
pub(crate) struct Capture {
    pub(crate) rest: Mesh,
    pub(crate) cage: Mesh,
    pub(crate) frames: Vec<Vec<f32>>,
}

/// A mesh as a file and as numbers.
#[derive(Clone)]
pub(crate) struct Mesh {
    pub(crate) obj: Vec<u8>,
    pub(crate) model: Model,
}

impl Mesh {
    pub(crate) fn new(model: Model) -> Self {
        let folder = super::folder();
        let path = folder.path().join("mesh.obj");
        write_model(&path, &model).expect("a mesh");
        Self { obj: std::fs::read(path).expect("a mesh"), model }
    }

    pub(crate) fn of(mesh: &TriMesh) -> Self {
        Self::new(mesh.clone().into())
    }
}

/// What [`usd`] says of positions.
pub(crate) const USD_UNITS: Units = Units::new(Up::Z, 0.01);

/// A mesh as a USD file that says what its positions mean.
pub(crate) fn usd(model: &Model) -> Vec<u8> {
    let list = |all: &mut dyn Iterator<Item = String>| all.collect::<Vec<_>>().join(", ");
    let points = list(&mut model.points.iter().map(|[x, y, z]| format!("({x}, {y}, {z})")));
    let counts = list(&mut model.faces.iter().map(|face| face.len().to_string()));
    let corners = list(&mut model.faces.iter().flatten().map(u32::to_string));
    format!(
        "#usda 1.0\n(\n    metersPerUnit = 0.01\n    upAxis = \"Z\"\n)\ndef Mesh \"mesh\"\n{{\n    point3f[] points = [{points}]\n    int[] faceVertexCounts = [{counts}]\n    int[] faceVertexIndices = [{corners}]\n}}\n"
    )
    .into_bytes()
}

/// What a container says of positions.
pub(crate) fn units_of(container: &[u8]) -> Units {
    ContainerReader::open(Cursor::new(container)).expect("a container").header().units
}

impl Capture {
    /// What most tests send: 1,500 points, 60 vertices of the cage, 40 frames.
    pub(crate) fn small() -> &'static Self {
        static SMALL: OnceLock<Capture> = OnceLock::new();
        SMALL.get_or_init(|| Self::new(1500, 60, 40))
    }

    /// Where many sessions or frames matter: 200 points, 32 vertices of the cage, 20 frames.
    pub(crate) fn tiny() -> &'static Self {
        static TINY: OnceLock<Capture> = OnceLock::new();
        TINY.get_or_init(|| Self::new(200, 32, 20))
    }

    pub(crate) fn new(points: usize, cage_vertices: usize, frames: usize) -> Self {
        let capture = cager_demo::Capture::new(&Options { points, frames, cage_vertices });
        let mut wide = Vec::new();
        let frame = |t| {
            capture.frame(t, &mut wide);
            wide.iter().map(|&x| x as f32).collect()
        };
        let frames = (0..frames).map(frame).collect();
        Self { rest: Mesh::new(capture.rest), cage: Mesh::of(&capture.cage), frames }
    }

    pub(crate) fn points(&self) -> usize {
        self.rest.model.points.len()
    }

    pub(crate) fn count(&self) -> u32 {
        self.frames.len() as u32
    }

    /// A frame as it is posted.
    pub(crate) fn frame(&self, frame: u32) -> Vec<u8> {
        self.frames[frame as usize].iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    /// Frames back to back.
    pub(crate) fn raw(&self, frames: Range<u32>) -> Vec<u8> {
        frames.flat_map(|frame| self.frame(frame)).collect()
    }

    /// Handle rows of frames back to back.
    pub(crate) fn handle_rows(&self, frames: Range<u32>, handles: &[u32]) -> Vec<u8> {
        frames.flat_map(|frame| self.rows_of(frame, handles)).flat_map(f32::to_le_bytes).collect()
    }

    fn rows_of(&self, frame: u32, handles: &[u32]) -> Vec<f32> {
        let row = |&handle: &u32| self.frames[frame as usize][3 * handle as usize..][..3].to_vec();
        handles.iter().flat_map(row).collect()
    }

    /// Frame records.
    pub(crate) fn records(&self, frames: impl IntoIterator<Item = u32>) -> Vec<u8> {
        let mut out = Vec::new();
        for frame in frames {
            let rows = &self.frames[frame as usize];
            record::encode(Kind::Positions, frame, f32::NAN, f32::NAN, rows, &mut out).expect("a record");
        }
        out
    }

    /// Frame records of handle rows.
    pub(crate) fn handle_records(&self, frames: impl IntoIterator<Item = u32>, handles: &[u32]) -> Vec<u8> {
        let mut out = Vec::new();
        for frame in frames {
            let rows = self.rows_of(frame, handles);
            record::encode(Kind::HandleRows, frame, f32::NAN, f32::NAN, &rows, &mut out).expect("a record");
        }
        out
    }

    /// Frames as a NumPy array.
    pub(crate) fn npy(&self, frames: Range<u32>) -> Vec<u8> {
        let folder = super::folder();
        let path = folder.path().join("frames.npy");
        let options = FrameOptions::default();
        let mut writer =
            create_frames(path.clone(), self.points(), frames.len(), &Polygons::new(), &options).expect("frames");
        for frame in frames {
            writer.write_frame(&self.frames[frame as usize]).expect("a frame");
        }
        writer.finish().expect("frames");
        std::fs::read(path).expect("frames")
    }

    /// The container that `cager encode` makes of the first frames, without a service.
    pub(crate) fn encoded(&self, frames: u32) -> Vec<u8> {
        self.encoded_with(frames, &[])
    }

    /// As [`Self::encoded`], with more arguments.
    pub(crate) fn encoded_with(&self, frames: u32, more: &[&str]) -> Vec<u8> {
        let folder = super::folder();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("rest.obj"), &self.rest.obj).expect("a rest pose");
        std::fs::write(path("cage.obj"), &self.cage.obj).expect("a cage");
        std::fs::write(path("frames.npy"), self.npy(0..frames)).expect("frames");
        let done = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args("encode --rest rest.obj --cage cage.obj --frames frames.npy -o out.cager".split(' '))
            .args(more)
            .current_dir(folder.path())
            .stdin(Stdio::null())
            .output()
            .expect("the program runs");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        std::fs::read(path("out.cager")).expect("a container")
    }
}
