//! `cager compare`: the paper's comparisons on one capture, as figures and drawings.
//!
//! The analysis of a coordinate system is computed once, and each choice of rows is decomposed
//! once. Frames are processed in batches, each projected once for all methods that read the same
//! rows.

mod estimate;
mod evaluation;
mod figures;
mod geometry;
mod method_groups;
mod methods;
mod noise;
pub mod report_page;
mod sample;
mod system;

pub use estimate::seconds;
pub use figures::Figures;
pub use geometry::Geometry;

use crate::report_page::Up;
use cager_capture::speed::StepClock;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{PrepareContext, PrepareError};
use cager_core::spectral::Analysis;
use cager_formats::FrameReader;
use cager_geometry::mesh::{Model, TriMesh};
use evaluation::Shape;
use figures::{System, claims, recommend};
use geometry::GeometryBuilder;
use sample::{Frame, Sample};
use std::ops::ControlFlow;

/// Why there is no comparison.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// No system can be computed for the rest pose and its cage.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The frames could not be read.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
}

/// What to compare.
pub struct Job<'a> {
    /// Model in its rest pose.
    pub rest: &'a Model,
    /// Checked cage around it.
    pub cage: &'a Cage,
    /// Whether the cage was turned inside out after it was read.
    pub flip_cage: bool,
    /// Begins reading the capture.
    pub open: &'a dyn Fn() -> Result<Box<dyn FrameReader>, cager_formats::Error>,
    /// Frames of the capture.
    pub frames: usize,
    /// Coordinate systems.
    pub systems: &'a [&'static dyn CoordinateSystem],
    /// Frames to measure at the most.
    pub frames_at_most: usize,
    /// The vertical axis, where it is not to be guessed.
    pub up: Option<Up>,
    /// Rest pose, cage and frames as they were given.
    pub names: [String; 3],
}

/// Compares; `progress` is told the name of each step and the fraction of all work that is done.
///
/// # Errors
/// See [`CompareError`]; a system that cannot be computed is part of the result, unless none can.
pub fn compare(job: &Job<'_>, progress: &mut dyn FnMut(&str, f64)) -> Result<(Figures, Geometry), CompareError> {
    let frames = job.frames;
    let sample = Sample::new(frames, job.frames_at_most);
    let shape = Shape::new(job.cage, &job.rest.points);
    let mesh = TriMesh::from(job.rest);
    let mut systems = Vec::new();
    let mut refused = None;
    let mut builder: Option<GeometryBuilder<'_>> = None;
    let mut motion = [f64::NAN; 2];
    let works: Vec<f64> = job.systems.iter().map(|system| estimate::work(job, *system)).collect();
    let all_work: f64 = works.iter().sum();
    for (k, &system) in job.systems.iter().enumerate() {
        let name = system.name();
        let before: f64 = works[..k].iter().sum();
        let mut tell = |step: &str, part: f64| progress(step, (before + part * works[k]) / all_work);
        let mut refuse = |error: PrepareError| {
            systems.push(System { name: name.to_owned(), refused: Some(error.to_string()), figures: None });
            refused.get_or_insert(error);
        };
        tell(&format!("{name}: coordinates"), 0.0);
        let clock = StepClock::default();
        let before_step = |step| {
            clock.begin(step);
            ControlFlow::Continue(())
        };
        let context = PrepareContext { before_step: &before_step, ..PrepareContext::default() };
        let analysis = match Analysis::new(system, job.cage, &job.rest.points, &context) {
            Ok(analysis) => analysis,
            Err(error) => {
                refuse(error);
                continue;
            }
        };
        let seconds = clock.seconds();
        let study = match system::study(job, name, (&analysis, seconds), &sample, &shape, &mut tell) {
            Ok(study) => study,
            Err(CompareError::Prepare(error)) => {
                refuse(error);
                continue;
            }
            Err(error) => return Err(error),
        };
        let geometry = match &mut builder {
            Some(builder) => builder,
            None => {
                motion = study.motion;
                builder.insert(GeometryBuilder::new(job, &mesh, &sample, &study.figures)?)
            }
        };
        tell(&format!("{name}: what is drawn"), 0.9);
        geometry.add(&study)?;
        let figures = Some(Box::new(study.figures));
        systems.push(System { name: name.to_owned(), refused: None, figures });
    }
    let Some(builder) = builder else {
        return Err(refused.unwrap_or(PrepareError::NoSolution { what: "choice of coordinates" }).into());
    };
    let capture = figures::Capture {
        rest: job.names[0].clone(),
        cage: job.names[1].clone(),
        source: job.names[2].clone(),
        flip_cage: job.flip_cage,
        points: job.rest.points.len(),
        triangles: mesh.triangles.len(),
        cage_vertices: job.cage.vertices().len(),
        cage_faces: job.cage.faces().len(),
        frames,
        measured: sample.measured().to_vec(),
        diagonal: shape.diagonal,
        motion_mean: motion[0],
        motion_max: motion[1],
        shown: builder.shown(),
        noise_radius: noise::RADIUS,
    };
    let (recommendation, claims) = (recommend(&systems), claims(&systems));
    let figures = Figures { program: env!("CARGO_PKG_VERSION"), capture, systems, recommendation, claims };
    Ok((figures, builder.finish()))
}

/// Reads these frames, ascending.
fn frames_of(reader: &mut dyn FrameReader, wanted: &[usize]) -> Result<Vec<Frame>, cager_formats::Error> {
    let mut found = Vec::new();
    let mut points = Vec::new();
    for number in 0..=wanted.last().copied().unwrap_or(0) {
        if !reader.read_next(&mut points)? {
            break;
        }
        if wanted.contains(&number) {
            found.push(Frame { number, measured: true, points: std::mem::take(&mut points) });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::coordinates::{CageValues, Coordinates, CoordinatesError, ElementPlan, MeanValue};
    use cager_demo::{Capture, Options};
    use cager_geometry::mesh::Point;

    /// A system that no cage is good enough for.
    struct Never;

    impl CoordinateSystem for Never {
        fn name(&self) -> &'static str {
            "never"
        }

        fn values(&self, cage: &Cage) -> CageValues {
            CageValues::of_vertices(cage)
        }

        fn coordinates(&self, _: &Cage, _: &[Point], _: Option<&ElementPlan>) -> Result<Coordinates, CoordinatesError> {
            Err(CoordinatesError::Outside { system: "never", points: vec![3, 17], distance: 0.02 })
        }
    }

    /// Frames that are made as they are read.
    struct Made(Capture, usize);

    impl FrameReader for Made {
        fn points(&self) -> usize {
            self.0.rest.points.len()
        }

        fn frames(&self) -> usize {
            self.0.frames()
        }

        fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, cager_formats::Error> {
            out.clear();
            if self.1 == self.0.frames() {
                return Ok(false);
            }
            self.0.frame(self.1, out);
            self.1 += 1;
            Ok(true)
        }
    }

    fn run(systems: &[&'static dyn CoordinateSystem]) -> Result<(Figures, Geometry), CompareError> {
        let capture = Capture::new(&Options { points: 400, frames: 5, cage_vertices: 40 });
        let cage = Cage::new(capture.cage.clone()).expect("a cage");
        let open = || Ok(Box::new(Made(capture.clone(), 0)) as Box<dyn FrameReader>);
        let job = Job {
            rest: &capture.rest,
            cage: &cage,
            flip_cage: false,
            open: &open,
            frames: 5,
            systems,
            frames_at_most: 120,
            up: None,
            names: ["rest", "cage", "frames"].map(str::to_owned),
        };
        compare(&job, &mut |_, _| {})
    }

    #[test]
    fn a_system_that_cannot_be_computed_says_why() {
        let (figures, geometry) = run(&[&Never, &MeanValue]).expect("a comparison");
        let refused = figures.systems[0].refused.as_deref().expect("a reason");
        assert!(refused.contains("2 points lie outside the cage (3, 17)"), "{refused}");
        assert!(figures.systems[0].figures.is_none() && figures.systems[1].refused.is_none());
        // What is drawn belongs to the systems that could be computed, in their order.
        let geometry = serde_json::to_value(geometry).expect("JSON");
        assert_eq!(geometry["systems"].as_array().map(Vec::len), Some(1));
    }

    #[test]
    fn nothing_to_compare_is_an_error() {
        assert!(matches!(run(&[&Never]), Err(CompareError::Prepare(PrepareError::Coordinates(_)))));
    }
}
