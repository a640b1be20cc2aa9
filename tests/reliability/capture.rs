//! Small captures with everything that a service should answer about them, computed in this process.

use cager_capture::capture::{CaptureWriter, Encoding, StoredError};
use cager_capture::encode::Encode;
use cager_client::{MeshFile, NewSession, messages::SessionOptions};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_core::inversion::{Rows, Solver, SolverOptions};
use cager_demo::{Capture, Options};
use cager_formats::{FrameReader, MeshFormat, Target, read_model_bytes, write_model};
use cager_geometry::mesh::{Model, TriMesh};
use std::path::Path;

const SPECTRUM: usize = 12;

/// What a frame's record should say, to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Errors {
    pub(crate) l2: u32,
    pub(crate) linf: u32,
}

/// A capture and its encoding.
pub(crate) struct Reference {
    pub(crate) rest_obj: Vec<u8>,
    pub(crate) cage_obj: Vec<u8>,
    pub(crate) points: usize,
    pub(crate) unknowns: usize,
    pub(crate) handles: Vec<u32>,
    /// Positions of every frame in single precision.
    pub(crate) frames: Vec<Vec<f32>>,
    pub(crate) cages: Vec<Vec<f32>>,
    pub(crate) errors: Vec<Errors>,
    /// The container where all rows were sent.
    pub(crate) container: Vec<u8>,
    /// The container where only handle rows were sent.
    pub(crate) handles_container: Vec<u8>,
}

impl Reference {
    pub(crate) fn new(points: usize, cage_vertices: usize, frames: usize) -> Self {
        let capture = Capture::new(&Options { points, frames, cage_vertices });
        let folder = tempfile::tempdir().expect("a folder");
        let rest_obj = obj(folder.path(), &capture.rest);
        let cage_obj = obj(folder.path(), &capture.cage.clone().into());
        // As the service reads them.
        let rest = read_model_bytes(MeshFormat::Obj, Path::new("rest.obj"), &rest_obj).expect("the rest pose");
        let cage = read_model_bytes(MeshFormat::Obj, Path::new("cage.obj"), &cage_obj).expect("the cage");
        let cage = Cage::new(TriMesh::from(&cage)).expect("a cage");
        let options = SolverOptions { spectrum: SPECTRUM, ..SolverOptions::default() };

        let mut wide = Vec::new();
        let frames: Vec<Vec<f32>> = (0..frames)
            .map(|t| {
                capture.frame(t, &mut wide);
                wide.iter().map(|&x| x as f32).collect()
            })
            .collect();

        let output = folder.path().join("out.cager");
        let mut reader = Narrow { frames: &frames, points: rest.points.len(), next: 0 };
        let encoded = Encode::new(&rest, &cage).solver(options).run(&mut reader, &Target::from(&output));
        encoded.expect("an encoding").commit().expect("the container");
        let container = std::fs::read(&output).expect("the container");

        let solver = Solver::prepare(&MeanValue, &cage, &rest.points, options).expect("a solver");
        let encoding = Encoding {
            rest: &rest,
            cage: &cage,
            system: &MeanValue,
            options,
            solver: &solver,
            frame_rate: None,
            origin: None,
            units: cager_formats::Units::UNKNOWN,
        };
        let mut writer = CaptureWriter::new(Vec::new(), &encoding, None).expect("a container");
        let (mut cages, mut errors) = (Vec::new(), Vec::new());
        for frame in &frames {
            // One by one: what is solved together must not matter.
            let cage = solver.invert(Rows::All, None, &[frame]).remove(0).cage;
            let error = StoredError::new(&solver.decoder().measure(&[&cage], &[frame])[0], solver.diagonal());
            errors.push(Errors { l2: error.l2.to_bits(), linf: error.linf.to_bits() });
            writer.write_frame(&cage, &StoredError::NOT_MEASURED).expect("a frame");
            cages.push(cage);
        }
        let handles_container = writer.finish().expect("a container").0;
        let (points, unknowns) = (rest.points.len(), solver.decoder().unknowns());
        let handles = solver.handles().to_vec();
        Self { rest_obj, cage_obj, points, unknowns, handles, frames, cages, errors, container, handles_container }
    }

    /// A wish for a session; what `mark` says goes into the rest pose as a comment, so that it is prepared anew.
    pub(crate) fn session(&self, name: &str, mark: Option<&str>) -> NewSession {
        let mut rest = self.rest_obj.clone();
        if let Some(mark) = mark {
            rest.extend_from_slice(format!("# {mark}\n").as_bytes());
        }
        NewSession {
            rest: MeshFile::new("rest.obj", rest),
            cage: Some(MeshFile::new("cage.obj", self.cage_obj.clone())),
            options: SessionOptions {
                name: Some(name.to_owned()),
                spectrum: Some(SPECTRUM as u32),
                ..SessionOptions::default()
            },
            regularizer_matrix: None,
            idempotency_key: Some(name.to_owned()),
        }
    }

    pub(crate) fn count(&self) -> u32 {
        self.frames.len() as u32
    }

    /// A frame's bytes as they are sent.
    pub(crate) fn bytes(&self, frame: u32) -> Vec<u8> {
        le_bytes(&self.frames[frame as usize])
    }

    /// The bytes of many frames, back to back.
    pub(crate) fn many(&self, frames: std::ops::Range<u32>) -> Vec<u8> {
        frames.flat_map(|frame| self.bytes(frame)).collect()
    }

    /// A frame's handle rows.
    pub(crate) fn handle_rows(&self, frame: u32) -> Vec<f32> {
        let positions = &self.frames[frame as usize];
        self.handles.iter().flat_map(|&h| positions[3 * h as usize..][..3].to_vec()).collect()
    }
}

pub(crate) fn le_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn obj(folder: &Path, model: &Model) -> Vec<u8> {
    let path = folder.join("model.obj");
    write_model(&path, model).expect("a model");
    std::fs::read(path).expect("a model")
}

struct Narrow<'a> {
    frames: &'a [Vec<f32>],
    points: usize,
    next: usize,
}

impl FrameReader for Narrow<'_> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, cager_formats::Error> {
        out.clear();
        let Some(frame) = self.frames.get(self.next) else { return Ok(false) };
        out.extend(frame.iter().map(|&x| f64::from(x)));
        self.next += 1;
        Ok(true)
    }
}
