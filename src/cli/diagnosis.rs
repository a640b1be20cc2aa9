//! `cager cage --check` and `--repair`: what is wrong with a cage, and what of it can be repaired.

use super::cage_args::CageArgs;
use super::cage_file::{dropped_of_cage, read_cage_like, read_welded_cage};
use super::cage_outputs::{Targets, cage_bytes, complete_file};
use super::dry_run::tell_dry_run;
use super::{print, warn};
use anyhow::{Result, bail};
use cager_cages::diagnosis::{Findings, check, repair};
use cager_capture::mismatch::cage_mismatch;
use cager_formats::{Target, Units, commit_together};
use cager_geometry::mesh::{Model, TriMesh};
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// What was found out about a cage. Counts are of what [`cager_cages::diagnosis::Findings`] lists.
#[derive(Serialize)]
pub(super) struct CheckReport {
    /// Whether it may be encoded with.
    usable: bool,
    /// Whether it is also free of self-intersection and known to enclose every point.
    editable: bool,
    vertices: usize,
    faces: usize,
    components: usize,
    open_edges: usize,
    non_manifold_edges: usize,
    inconsistent_edges: usize,
    inward_parts: usize,
    self_intersections: usize,
    duplicate_vertices: usize,
    degenerate_faces: usize,
    loose_vertices: usize,
    idle_vertices: usize,
    /// Whether it was examined if the cage encloses the model.
    enclosure_examined: bool,
    /// Null where it was not.
    points_outside: Option<usize>,
    /// How far the farthest of them is from the cage, as a fraction of the rest pose's diagonal.
    outside_distance: Option<f64>,
    /// Of the mean value coordinates; null where it was not computed, and where they are singular.
    condition_number: Option<f64>,
    /// Whether it was computed, and the coordinates are singular.
    singular: bool,
    /// What was changed, where the cage was repaired.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    changes: Vec<String>,
    /// What is wrong, a sentence each, with what to do.
    findings: Vec<String>,
}

impl CheckReport {
    fn new(found: &Findings, unfit: Option<&String>, changes: Vec<String>) -> Self {
        Self {
            usable: found.usable() && unfit.is_none(),
            editable: found.editable() && unfit.is_none(),
            vertices: found.vertices,
            faces: found.faces,
            components: found.defects.components,
            open_edges: found.defects.open_edges.len(),
            non_manifold_edges: found.defects.non_manifold_edges.len(),
            inconsistent_edges: found.defects.inconsistent_edges.len(),
            inward_parts: found.defects.inward_parts.len(),
            self_intersections: found.self_intersections.len(),
            duplicate_vertices: found.duplicate_vertices.len() + found.touching_vertices.len(),
            degenerate_faces: found.defects.degenerate_faces.len(),
            loose_vertices: found.defects.loose_vertices.len(),
            idle_vertices: found.idle_vertices.len(),
            enclosure_examined: found.enclosure_examined,
            points_outside: found.enclosure_examined.then(|| found.outside.map_or(0, |outside| outside.count)),
            outside_distance: found.outside.map(|outside| outside.distance),
            condition_number: found.condition_number.filter(|condition| condition.is_finite()),
            singular: found.condition_number == Some(f64::INFINITY),
            changes,
            findings: unfit.into_iter().cloned().chain(found.messages()).collect(),
        }
    }
}

pub(super) fn run(args: &CageArgs, targets: &Targets, (rest, units): (&Model, Units)) -> Result<()> {
    match (&args.check, &args.repair, &targets.output) {
        (Some(path), _, _) => check_cage(args, targets, (rest, units), path),
        (None, Some(path), Some(output)) => repair_cage(args, (output, targets), (rest, units), path),
        _ => bail!("-o: say where to write the repaired cage"),
    }
}

/// Exit status 1 for a cage that cannot be encoded with, so that scripts can ask.
fn check_cage(args: &CageArgs, targets: &Targets, (rest, units): (&Model, Units), path: &Path) -> Result<()> {
    let cage = read_welded_cage(path, units)?;
    let mesh = TriMesh::from(&cage);
    let found = check(&mesh, rest);
    let unfit = unfit(&mesh, rest, &found);
    if !args.outputs.dry_run {
        let report = CheckReport::new(&found, unfit.as_ref(), Vec::new());
        commit_together(targets.complete(&report, (args, &TriMesh::from(rest), &mesh))?)?;
    }
    print(&verdict(path, &found, unfit.as_ref()))?;
    match unfit {
        _ if !found.usable() => bail!("{}: cannot be encoded with; try --repair", path.display()),
        Some(_) if mesh.vertices.len() > rest.points.len() => {
            bail!("{}: has more vertices than the rest pose has points; take a coarser cage", path.display())
        }
        Some(_) => {
            bail!("{}: does not fit the rest pose; take the cage of this model, in its units and axes", path.display())
        }
        None => Ok(()),
    }
}

/// Why a rest pose cannot be encoded with a cage that others may be.
fn unfit(mesh: &TriMesh, rest: &Model, found: &Findings) -> Option<String> {
    if !found.usable() {
        return None;
    }
    let (vertices, points) = (mesh.vertices.len(), rest.points.len());
    let too_many = || format!("has {vertices} vertices, more than the {points} points of the rest pose can tell apart");
    (vertices > points).then(too_many).or_else(|| cage_mismatch(mesh, rest))
}

fn repair_cage(
    args: &CageArgs,
    (output, targets): (&Target, &Targets),
    (rest, units): (&Model, Units),
    path: &Path,
) -> Result<()> {
    let repaired = repair(&read_cage_like(path, units)?, rest);
    if !repaired.remaining.usable() {
        bail!(
            "{}: could not be repaired: {}; nothing was written",
            path.display(),
            repaired.remaining.messages().join("; ")
        );
    }
    let mesh = TriMesh::from(&repaired.cage);
    let unfit = unfit(&mesh, rest, &repaired.remaining);
    let report = CheckReport::new(&repaired.remaining, unfit.as_ref(), repaired.changes.clone());
    if args.outputs.dry_run {
        return tell_dry_run(output, "a repaired cage", &[targets.report.clone(), targets.picture.clone()]);
    }
    let mut files = vec![complete_file(output, &cage_bytes(output, &repaired.cage)?)?];
    files.extend(targets.complete(&report, (args, &TriMesh::from(rest), &mesh))?);
    commit_together(files)?;
    warn(dropped_of_cage(path).as_slice());
    let mut text = String::new();
    for change in &repaired.changes {
        let _ = writeln!(text, "  changed  {change}");
    }
    if repaired.changes.is_empty() {
        let is_sound = unfit.is_none() && repaired.remaining.messages().is_empty();
        text += if is_sound {
            "  changed  nothing: there was nothing to repair\n"
        } else {
            "  changed  nothing: what was found stays, and is nothing that repairing can mend\n"
        };
    }
    print(&format!("{}{text}", verdict(output.path(), &repaired.remaining, unfit.as_ref())))
}

fn verdict(path: &Path, found: &Findings, unfit: Option<&String>) -> String {
    let sentence = match (found.usable() && unfit.is_none(), found.editable()) {
        (true, true) => "usable, free of self-intersection and around every point",
        (true, false) => "usable, but not for every purpose",
        (false, _) if unfit.is_some() => "not usable for this rest pose",
        (false, _) => "not usable",
    };
    let mut text = format!(
        "{}: {sentence}\n  cage     {} vertices, {} triangles, {} part{}",
        path.display(),
        found.vertices,
        found.faces,
        found.defects.components,
        if found.defects.components == 1 { "" } else { "s" }
    );
    if let Some(condition) = found.condition_number.filter(|condition| condition.is_finite()) {
        let _ = write!(text, ", condition number {condition:.1}");
    }
    text.push('\n');
    for sentence in unfit.into_iter().cloned().chain(found.messages()) {
        let _ = writeln!(text, "  found    {sentence}");
    }
    text
}
