//! `cager cage`: cages made, designed, improved.

use super::args::UpArg;
use super::cage_args::{CageArgs, GeneralArg};
use super::design::{self, usual_vertices};
use super::{grouped, interrupt, print, warn};
use crate::compare::render::Up;
use crate::design::{DesignReport, read_frames};
use crate::picture;
use anyhow::{Result, bail};
use cager_cages::{DesignOptions, EncloseError, EncloseOptions, General, Style, enclose, general};
use cager_core::mesh::{Model, Polygons, TriMesh};
use cager_formats::{AtomicFile, commit_together, model_bytes, read_model};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Farthest that a cage may be asked to keep from the points, as a fraction of the diagonal.
const MOST_CLEARANCE: f64 = 0.5;

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
    let models: Vec<Model> = args.rest.iter().map(|path| read_model(path)).collect::<Result<_, _>>()?;
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
        return super::doctor::run(args, rest);
    }
    if let Some(clearance) = args.clearance
        && !(0.0..=MOST_CLEARANCE).contains(&clearance)
    {
        bail!("--clearance: is {clearance}; give a fraction of the rest pose's diagonal from 0 to {MOST_CLEARANCE}");
    }
    let Some(output) = &args.output else { bail!("-o: say which file to write") };
    refuse_outputs(args)?;
    interrupt::leaves_nothing()?;
    let files = Outputs::begin(args, output)?;
    let vertices = args.vertices.map_or(usual_vertices(rest.points.len()), |n| n as usize);
    let mut warnings = Vec::new();
    let (cage, report) = match (&args.frames, args.general) {
        (Some(frames), None) => designed(args, rest, frames, &mut warnings)?,
        (_, Some(shape)) => {
            let shape = match shape {
                GeneralArg::Box => General::Box,
                GeneralArg::Sphere => General::Sphere,
                GeneralArg::Hull => General::Hull,
            };
            let all: Vec<&Model> = models.iter().collect();
            (of_triangles(general(&all, shape, vertices).map_err(|e| name_file(&e, args))?), None)
        }
        (None, None) => {
            let options = EncloseOptions { vertices, clearance: args.clearance, per_part: args.per_part };
            (of_triangles(enclose(rest, &options).map_err(|e| name_file(&e, args))?), None)
        }
    };
    finish(args, (output, files), &models, &cage, report, warnings, clock)
}

/// The files to be written, which have no name until all are complete. Made before the work, so that what cannot be written costs none.
struct Outputs {
    cage: AtomicFile,
    report: Option<AtomicFile>,
    picture: Option<AtomicFile>,
}

impl Outputs {
    fn begin(args: &CageArgs, output: &Path) -> Result<Self> {
        // Any model will do to learn whether its name is one of a mesh that is written.
        model_bytes(output, &Model { points: vec![[0.0; 3]], faces: Polygons::new() })?;
        Ok(Self {
            cage: AtomicFile::create(output)?,
            report: args.report.as_ref().map(AtomicFile::create).transpose()?,
            picture: args.picture.as_ref().map(AtomicFile::create).transpose()?,
        })
    }
}

/// A cage from the motion: a new one, or an artist's with its vertices moved.
fn designed(
    args: &CageArgs,
    rest: &Model,
    frames_path: &Path,
    warnings: &mut Vec<String>,
) -> Result<(Model, Option<DesignReport>)> {
    let start = args.improve.as_ref().map(|path| read_model(path).map(|model| (path, model))).transpose()?;
    let options = DesignOptions {
        goal: design::goal(args.vertices, args.mean_error, rest.points.len())?,
        style: args.style.map_or(Style::Editable, Into::into),
        seed: args.seed,
        time_limit: args.time_limit.map(|s| Duration::from_secs(s.into())),
        keep_connectivity: start.is_some(),
        symmetry: args.symmetry.map(|axis| axis as usize),
    };
    let frames = read_frames(frames_path, rest.points.len(), None)?;
    let mesh = start.as_ref().map(|(_, model)| TriMesh::from(model));
    let start_mesh = start.as_ref().zip(mesh.as_ref()).map(|((path, _), mesh)| (path.as_path(), mesh));
    let found = design::design((&args.rest[0], rest), (frames_path, &frames), start_mesh, &options)?;
    let report = DesignReport::new(&found, &options, frames.len());
    warnings.extend(found.warnings);
    // An artist's cage keeps its quads.
    let cage = match start {
        Some((_, model)) => Model { points: found.cage.vertices, faces: model.faces },
        None => of_triangles(found.cage),
    };
    Ok((cage, Some(report)))
}

fn of_triangles(mesh: TriMesh) -> Model {
    let mut faces = Polygons::new();
    for triangle in &mesh.triangles {
        faces.push(triangle);
    }
    Model { points: mesh.vertices, faces }
}

fn finish(
    args: &CageArgs,
    (output, files): (&Path, Outputs),
    models: &[Model],
    cage: &Model,
    design: Option<DesignReport>,
    warnings: Vec<String>,
    clock: Instant,
) -> Result<()> {
    let mesh = TriMesh::from(cage);
    let points_outside: usize = models.iter().map(|m| cager_cages::geometry::outside(&mesh, &m.points).len()).sum();
    let report = CageReport {
        vertices: mesh.vertices.len(),
        faces: mesh.triangles.len(),
        points_outside,
        self_intersections: cager_cages::geometry::self_intersections(&mesh).len(),
        design,
        seconds: clock.elapsed().as_secs_f64(),
        warnings,
    };
    let mut complete = vec![filled(files.cage, &model_bytes(output, cage)?)?];
    if let Some(file) = files.report {
        complete.push(filled(file, &pretty(&report)?)?);
    }
    if let Some(file) = files.picture {
        complete.push(filled(file, &picture_of(args, &together(models), &mesh))?);
    }
    commit_together(complete)?;
    warn(&report.warnings);
    print(&summary(&report, output))
}

/// Writes a repaired cage with what belongs to it.
pub(super) fn finish_repaired(
    args: &CageArgs,
    output: &Path,
    rest: &Model,
    cage: &Model,
    report: &impl Serialize,
) -> Result<()> {
    let mut files = vec![whole(output, &model_bytes(output, cage)?)?];
    if let Some(path) = &args.report {
        files.push(whole(path, &pretty(report)?)?);
    }
    if let Some(path) = &args.picture {
        files.push(whole(path, &picture_of(args, &TriMesh::from(rest), &TriMesh::from(cage)))?);
    }
    Ok(commit_together(files)?)
}

/// A picture of models in a cage, or beside it.
pub(super) fn picture_of(args: &CageArgs, model: &TriMesh, cage: &TriMesh) -> Vec<u8> {
    let up = args.up.map(|up| match up {
        UpArg::X => Up::X,
        UpArg::Y => Up::Y,
        UpArg::Z => Up::Z,
    });
    picture::of_cage(model, cage, up)
}

pub(super) fn pretty(report: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(report)?;
    text.push(b'\n');
    Ok(text)
}

pub(super) fn whole(path: &Path, bytes: &[u8]) -> Result<cager_formats::CompleteFile> {
    filled(AtomicFile::create(path)?, bytes)
}

fn filled(mut file: AtomicFile, bytes: &[u8]) -> Result<cager_formats::CompleteFile> {
    file.write_all(bytes)?;
    Ok(file.complete()?)
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

/// Files that exist stay, unless they may be replaced; inputs always do.
pub(super) fn refuse_outputs(args: &CageArgs) -> Result<()> {
    let inputs = args.rest.iter().chain(&args.frames).chain(&args.improve).chain(&args.repair).chain(&args.check);
    let inputs: Vec<PathBuf> = inputs.filter_map(|path| path.canonicalize().ok()).collect();
    let outputs: Vec<&PathBuf> = args.output.iter().chain(&args.report).chain(&args.picture).collect();
    for (k, output) in outputs.iter().enumerate() {
        if outputs[..k].iter().any(|other| place(other) == place(output)) {
            bail!("{}: cannot hold two outputs; name two files", output.display());
        }
        if output.canonicalize().is_ok_and(|place| inputs.contains(&place)) {
            bail!("{}: is an input, so it cannot be an output; name another file", output.display());
        }
        if output.exists() && !args.overwrite {
            bail!("{}: exists; name another file, or pass --overwrite to replace it", output.display());
        }
    }
    Ok(())
}

/// Where a file is, or will be.
fn place(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    path.canonicalize().ok().or_else(|| Some(folder.canonicalize().ok()?.join(path.file_name()?)))
}

fn name_file(error: &EncloseError, args: &CageArgs) -> anyhow::Error {
    match error {
        EncloseError::TooFewVertices { .. } => anyhow::anyhow!("--vertices: {error}"),
        _ => anyhow::anyhow!("{}: {error}", args.rest[0].display()),
    }
}

fn summary(report: &CageReport, output: &Path) -> String {
    let mut text = format!(
        "{}: {} vertices, {} triangles\n",
        output.display(),
        grouped(report.vertices as u64),
        grouped(report.faces as u64)
    );
    if let Some(design) = &report.design {
        let first = design.stages.first().map_or(design.held_back_error, |stage| stage.held_back_error);
        text += &format!(
            "  error   {:.4} % of the diagonal on frames not seen ({:.4} % on those seen), {:.1} times below the first cage's\n",
            100.0 * design.held_back_error,
            100.0 * design.designed_error,
            first / design.held_back_error
        );
    }
    let tidy = match (report.points_outside, report.self_intersections) {
        (0, 0) => "encloses every point and does not cut itself".to_owned(),
        (0, cuts) => format!("encloses every point; {} pairs of faces cut each other", grouped(cuts as u64)),
        (outside, cuts) => format!(
            "{} points lie outside; {} pairs of faces cut each other",
            grouped(outside as u64),
            grouped(cuts as u64)
        ),
    };
    text + &format!("  shape   {tidy}\n  time    {:.3} s\n", report.seconds)
}
