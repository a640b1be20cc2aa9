//! `cager cage`: generates, designs and improves cages.

use super::cage_args::{CageArgs, GeneralArg};
use super::cage_file::{dropped_of_cage, read_welded_cage};
use super::cage_outputs::{Targets, cage_bytes, complete_file};
use super::checks::{check_capture, checked_files, warn_of_departures};
use super::design;
use super::dry_run::{read_files, tell_dry_run};
use super::{grouped, progress, read_with_units, tell, warn};
use anyhow::{Result, bail};
use cager_cages::{BoundingShape, DesignOptions, EncloseError, EncloseOptions, Style, bounding_shape, enclose};
use cager_capture::design::default_vertices;
use cager_capture::design::{read_frames, report as design_report};
use cager_capture::frames::CaptureFiles;
use cager_formats::{Target, Units, commit_together};
use cager_geometry::mesh::{Model, TriMesh};
use cager_proto::report::DesignReport;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Farthest that a cage may be asked to keep from the points, as a fraction of the diagonal.
const MAX_CLEARANCE: f64 = 0.5;

/// What is written about a cage that was made.
#[derive(Serialize)]
struct CageReport {
    vertices: usize,
    faces: usize,
    /// How it was designed, where frames were given.
    #[serde(skip_serializing_if = "Option::is_none")]
    design: Option<DesignReport>,
    /// Points of the model outside the cage.
    points_outside: usize,
    /// Pairs of faces that cut each other.
    self_intersections: usize,
    seconds: f64,
    warnings: Vec<String>,
}

pub(super) fn run(args: &CageArgs) -> Result<()> {
    let clock = Instant::now();
    let targets = Targets::new(args)?;
    let prims = &args.checks.prim;
    let read: Vec<(Model, Units)> =
        args.rest.iter().map(|path| read_with_units(path, prims)).collect::<Result<_, _>>()?;
    let units = read[0].1;
    let models: Vec<Model> = read.into_iter().map(|(model, _)| model).collect();
    if models.len() > 1 && args.general.is_none() {
        bail!("--rest: was given {} times; only --general takes several models", models.len());
    }
    let rest = &models[0];
    if rest.points.iter().all(|p| *p == rest.points[0]) {
        bail!(
            "{}: {}",
            args.rest[0].display(),
            if rest.points.is_empty() { EncloseError::Empty } else { EncloseError::NoExtent }
        );
    }
    if args.check.is_some() || args.repair.is_some() {
        return super::diagnosis::run(args, &targets, (rest, units));
    }
    if let Some(clearance) = args.clearance
        && !(0.0..=MAX_CLEARANCE).contains(&clearance)
    {
        bail!("--clearance: is {clearance}; give a fraction of the rest pose's diagonal from 0 to {MAX_CLEARANCE}");
    }
    let Some(output) = &targets.output else { bail!("-o: say which file to write") };
    if args.outputs.dry_run {
        if let Some(frames) = &args.frames {
            read_files(&Motion::new(args, (rest, units), frames)?.files)?;
        }
        return tell_dry_run(output, "a cage", &[targets.report.clone(), targets.picture.clone()]);
    }
    let vertices = args.vertices.map_or(default_vertices(rest.points.len()), |n| n as usize);
    let mut warnings = Vec::new();
    let most = if args.general.is_some() || args.frames.is_some() { vertices } else { rest.points.len().max(4) };
    if vertices > most {
        warnings.push(format!(
            "--vertices: the {most} points of the model tell no more than {most} vertices apart, \
             which the cage gets at the most"
        ));
    }
    let vertices = vertices.min(most);
    warnings.extend(args.improve.as_deref().and_then(dropped_of_cage));
    let (cage, report) = match (&args.frames, args.general) {
        (Some(frames), None) => designed(args, (rest, units), frames, &mut warnings)?,
        (_, Some(shape)) => {
            let shape = match shape {
                GeneralArg::Box => BoundingShape::Box,
                GeneralArg::Sphere => BoundingShape::Sphere,
                GeneralArg::Hull => BoundingShape::Hull,
            };
            let all: Vec<&Model> = models.iter().collect();
            (Model::from(bounding_shape(&all, shape, vertices).map_err(|e| name_file(&e, args))?), None)
        }
        (None, None) => {
            let options = EncloseOptions { vertices, clearance: args.clearance, per_part: args.per_part };
            let bar = progress::ticking("enclosing the rest pose");
            let cage = enclose(rest, &options);
            bar.finish_and_clear();
            (Model::from(cage.map_err(|e| name_file(&e, args))?), None)
        }
    };
    finish(args, (output, &targets), &models, &cage, report, warnings, clock)
}

/// What a cage is designed from, checked.
struct Motion<'a> {
    /// The cage to improve.
    start: Option<(&'a PathBuf, Model)>,
    options: DesignOptions,
    files: CaptureFiles,
}

impl<'a> Motion<'a> {
    fn new(args: &'a CageArgs, (rest, units): (&Model, Units), frames: &Path) -> Result<Self> {
        let start =
            args.improve.as_ref().map(|path| read_welded_cage(path, units).map(|model| (path, model))).transpose()?;
        let options = DesignOptions {
            goal: design::goal(args.vertices, args.mean_error, rest.points.len())?,
            style: args.style.unwrap_or(Style::Editable),
            seed: args.seed,
            time_limit: args.time_limit,
            keep_connectivity: start.is_some(),
            symmetry: args.symmetry.map(|axis| axis as usize),
        };
        let no_frames = args.rest.iter().chain(&args.improve);
        let mut files = checked_files(&args.checks, frames, rest.points.len(), no_frames);
        files.rest_units = units;
        check_capture(&mut files, (&args.rest[0], rest), &args.checks)?;
        Ok(Self { start, options, files })
    }
}

/// A cage from the motion: a new one, or an artist's with its vertices moved.
fn designed(
    args: &CageArgs,
    (rest, units): (&Model, Units),
    frames_path: &Path,
    warnings: &mut Vec<String>,
) -> Result<(Model, Option<DesignReport>)> {
    let Motion { start, options, files } = Motion::new(args, (rest, units), frames_path)?;
    let frames = read_frames(&files)?;
    warn_of_departures(&files);
    let mesh = start.as_ref().map(|(_, model)| TriMesh::from(model));
    let start_mesh = start.as_ref().zip(mesh.as_ref()).map(|((path, _), mesh)| (path.as_path(), mesh));
    let found = design::design((&args.rest[0], rest), (frames_path, &frames), start_mesh, None, &options)?;
    let report = design_report(&found, &options, frames.len());
    warnings.extend(found.warnings);
    // An artist's cage keeps its quads.
    let cage = match start {
        Some((_, model)) => Model { points: found.cage.vertices, faces: model.faces, ..Model::default() },
        None => Model::from(found.cage),
    };
    Ok((cage, Some(report)))
}

fn finish(
    args: &CageArgs,
    (output, targets): (&Target, &Targets),
    models: &[Model],
    cage: &Model,
    design: Option<DesignReport>,
    warnings: Vec<String>,
    clock: Instant,
) -> Result<()> {
    let mesh = TriMesh::from(cage);
    let points_outside: usize = models.iter().map(|m| cager_geometry::spatial::outside(&mesh, &m.points).len()).sum();
    let report = CageReport {
        vertices: mesh.vertices.len(),
        faces: mesh.triangles.len(),
        points_outside,
        self_intersections: cager_geometry::spatial::self_intersections(&mesh).len(),
        design,
        seconds: clock.elapsed().as_secs_f64(),
        warnings,
    };
    let mut complete = vec![complete_file(output, &cage_bytes(output, cage)?)?];
    complete.extend(targets.complete(&report, (args, &together(models), &mesh))?);
    commit_together(complete)?;
    warn(&report.warnings);
    tell(&summary(&report, output.path()))
}

fn together(models: &[Model]) -> TriMesh {
    let mut all = TriMesh::default();
    for model in models {
        let mesh = TriMesh::from(model);
        let first = all.vertices.len() as u32;
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        all.vertices.extend(mesh.vertices);
    }
    all
}

fn name_file(error: &EncloseError, args: &CageArgs) -> anyhow::Error {
    match error {
        EncloseError::TooFewVertices { .. } => anyhow::anyhow!("--vertices: {error}"),
        _ => anyhow::anyhow!("{}: {error}", args.rest[0].display()),
    }
}

/// The error of a designed cage where nothing of it was chosen, or where that is not known, the nearest to it.
pub(super) fn judged(design: &DesignReport) -> String {
    match design.unseen_error {
        Some(error) => format!(
            "L2 {:.4} % of the diagonal on {} frames, in stretches of time that neither the design nor its choice saw",
            100.0 * error,
            grouped(design.unseen_frames)
        ),
        None => format!(
            "L2 {:.4} % of the diagonal on the frames between those it was made from, which chose it: there are too \
             few to hold stretches of time back",
            100.0 * design.held_back_error
        ),
    }
}

fn summary(report: &CageReport, output: &Path) -> String {
    let mut text =
        format!("{}: {} vertices, {} triangles\n", output.display(), grouped(report.vertices), grouped(report.faces));
    if let Some(design) = &report.design {
        let first = design.stages.first().map_or(design.held_back_error, |stage| stage.held_back_error);
        let times = first / design.held_back_error;
        // A search for the smallest cage may end with fewer vertices than the first one, and more error.
        let better = if times >= 1.05 { format!(", {times:.1} times below the first cage's") } else { String::new() };
        text += &format!(
            "  error   {} ({:.4} % on those it was made from){better}\n",
            judged(design),
            100.0 * design.designed_error,
        );
    }
    let tidy = match (report.points_outside, report.self_intersections) {
        (0, 0) => "encloses every point and does not cut itself".to_owned(),
        (0, cuts) => format!("encloses every point; {} pairs of faces cut each other", grouped(cuts)),
        (outside, cuts) => {
            format!("{} points lie outside; {} pairs of faces cut each other", grouped(outside), grouped(cuts))
        }
    };
    text + &format!("  shape   {tidy}\n  time    {:.3} s\n", report.seconds)
}
