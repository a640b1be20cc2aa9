//! `cager rig` and `cager manifold`: what `cager recover` needs to follow people.

use super::outputs::{OutputArgs, Outputs};
use super::{grouped, human_bytes, progress, read_model, tell, warn};
use anyhow::{Context, Result, bail};
use cager_capture::decode::{self, Animation, DecodeError};
use cager_formats::biovision::{Clip, read_bvh};
use cager_formats::{AtomicFile, Target};
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_geometry::units::Up;
use cager_geometry::vector::{add, distance};
use cager_motion::recover::{manifold_of, rig_of};
use cager_shape::people::manifold::{Examples, Kind, Manifold};
use cager_shape::people::poses::{Naming, SkeletonPoses};
use cager_shape::people::rig::{
    CAGE_FACES, CAGE_VERTICES, Corrected, PlacedRig, PlacementOptions, QUAD_NAMES, Rig, correct, place,
};
use clap::{Args, ValueEnum};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Place a rig of oriented quads in a person: the cage that `recover --rig` poses.
///
/// The person should stand upright in a T- or A-pose. The rig is a JSON file that may be corrected
/// by hand: 21 quads with the joints that they turn about. After a first recovery, --motion puts
/// joints where the parts of the body turn about them. Example: cager rig body.obj -o rig.json
#[derive(Args, Debug)]
pub(crate) struct RigArgs {
    /// Mesh of a person: .obj .ply .off .stl .glb .abc .usdc, with faces.
    #[arg(value_name = "TEMPLATE")]
    template: PathBuf,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "RIG.json")]
    output: PathBuf,

    #[command(flatten)]
    outputs: OutputArgs,

    /// Axis that points up.
    #[arg(long = "up", id = "rig_up", value_name = "AXIS", value_parser = super::checks::up, default_value = "y",
          conflicts_with = "rig")]
    up: Up,

    /// Axis that the person looks along: x, -x, y, -y, z or -z [default: as the feet tell].
    #[arg(long, value_name = "AXIS", value_parser = axis, allow_hyphen_values = true, hide_default_value = true,
          conflicts_with = "rig")]
    forward: Option<Point>,

    /// Distance between the person and the cage, where there is room, as a fraction of the height.
    #[arg(long, value_name = "F", default_value_t = 0.003, value_parser = margin, allow_negative_numbers = true)]
    margin: f64,

    /// Correct joints by how this template moves: a .cager file of it, as a first `recover` writes
    /// it. Learn the manifold anew for the corrected rig.
    #[arg(long, value_name = "FIRST.cager")]
    motion: Option<PathBuf>,

    /// With --motion, the rig to correct [default: one that is placed as without].
    #[arg(long, value_name = "RIG.json", requires = "motion", hide_default_value = true)]
    rig: Option<PathBuf>,
}

/// Learn which poses are usual from motion capture: the manifold of `recover --manifold`.
///
/// Clips are BVH files whose joints are named as CMU's or Mixamo's, or by --names. Example: cager
/// manifold walk.bvh --rig rig.json -o walk.manifold.json
#[derive(Args, Debug)]
pub(crate) struct ManifoldArgs {
    /// Motion capture: .bvh files.
    #[arg(value_name = "BVH", required = true)]
    clips: Vec<PathBuf>,

    /// Rig whose poses are learned, as `cager rig` writes it.
    #[arg(long, value_name = "RIG.json")]
    rig: PathBuf,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "MANIFOLD.json")]
    output: PathBuf,

    #[command(flatten)]
    outputs: OutputArgs,

    /// Dimensions of the manifold.
    #[arg(long, value_name = "D", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=100))]
    dims: u16,

    /// pca: linear; gplvm: curved, slower to learn.
    #[arg(long, value_enum, value_name = "KIND", default_value = "pca")]
    kind: ManifoldKind,

    /// Poses that are learned from, spread evenly over each clip, in all.
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(2..=2000))]
    poses: u32,

    /// Names of the joints that the rig's bones follow, as JSON: an object of {"joint": …, "end": …} by bone.
    #[arg(long, value_name = "NAMES.json")]
    names: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ManifoldKind {
    Pca,
    Gplvm,
}

fn axis(text: &str) -> Result<Point, String> {
    let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
    let place = ["x", "y", "z"].iter().position(|axis| *axis == name);
    place
        .map(|place| std::array::from_fn(|k| if k == place { sign } else { 0.0 }))
        .ok_or_else(|| "give x, -x, y, -y, z or -z".to_owned())
}

fn margin(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|margin: &f64| (0.0..=0.1).contains(margin));
    found.ok_or_else(|| "give a fraction from 0 to 0.1".to_owned())
}

pub(super) fn run(args: &RigArgs) -> Result<()> {
    let inputs = [&args.template].into_iter().chain(&args.motion).chain(&args.rig);
    let mut outputs = Outputs::new(args.outputs, inputs)?;
    let output = outputs.text(&args.output)?;
    let template = read_model(&args.template)?;
    let mesh = TriMesh::from(&template);
    let mut placed = match &args.rig {
        Some(path) => {
            let rig = read_rig(path)?;
            PlacedRig { enclosure: rig.enclosure(&mesh), rig }
        }
        None => {
            let up = if args.up == Up::Z { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
            let options = PlacementOptions { up, forward: args.forward, margin: args.margin };
            place(&mesh, &options).with_context(|| args.template.display().to_string())?
        }
    };
    let mut moved = String::new();
    if let Some(path) = &args.motion {
        let Corrected { placed: corrected, shifts } =
            correct(&placed.rig, &mesh, &frames_of(path, &args.template, &template)?, args.margin);
        placed = corrected;
        let named = QUAD_NAMES.iter().zip(shifts).filter(|(_, shift)| *shift >= TOLD);
        let told: Vec<String> = named.map(|(name, shift)| format!("{name} by {:.1} %", 100.0 * shift)).collect();
        moved = match told[..] {
            [] => "; no joint moved".to_owned(),
            _ => format!("; joints moved, of the height: {}", told.join(", ")),
        };
    }
    let outside = placed.enclosure.outside.len();
    if outside > 0 {
        warn(&[format!(
            "{}: {} of {} points lie outside of the rig's cage, by up to {:.2} % of the height; move the quads there \
             outwards in the file, or go on",
            args.template.display(),
            grouped(outside),
            grouped(template.points.len()),
            100.0 * placed.enclosure.farthest
        )]);
    }
    let text = placed.rig.to_json();
    write(
        &output,
        args.outputs,
        text.as_bytes(),
        &format!("{CAGE_VERTICES} vertices and {CAGE_FACES} triangles in 21 quads{moved}"),
    )
}

/// Shifts of joints that are told, as shares of the height.
const TOLD: f64 = 0.001;
/// Share of the diagonal by which points of a template may be stored elsewhere.
const NEAR: f64 = 1e-4;
/// Frames that joints are corrected by at the most, and coordinates of them.
const MAX_FRAMES: usize = 300;
const MAX_COORDINATES: usize = 30_000_000;

/// Some frames of a container, spread evenly, whose points are those of a template.
fn frames_of(path: &Path, template_path: &Path, template: &Model) -> Result<Vec<Vec<Point>>> {
    let mut container = decode::open(path)?;
    let (frames, points) = (container.frames(), container.header().points);
    let origin = container.header().origin.unwrap_or_default();
    let rest = container.rest().map_err(|cause| DecodeError::container(path, cause))?;
    drop(container);
    if points != template.points.len() as u64 {
        bail!(
            "{}: has {} points, and {} has {}; give a recovery of this template",
            path.display(),
            grouped(points),
            template_path.display(),
            grouped(template.points.len())
        );
    }
    let near = NEAR * diagonal(&template.points);
    let other = rest.points.iter().zip(&template.points).position(|(a, b)| distance(add(*a, origin), *b) > near);
    if let Some(point) = other {
        bail!(
            "{}: its rest pose is not {}: point {point} is elsewhere; give the template that this was recovered with, \
             in its units and place",
            path.display(),
            template_path.display()
        );
    }
    let most = (MAX_COORDINATES / (3 * template.points.len())).clamp(2, MAX_FRAMES);
    let some: Vec<usize> = (0..frames).step_by(frames.div_ceil(most).max(1)).collect();
    let mut positions = Animation::open(path)?;
    let bar = progress::frames("decoding", some.len());
    let mut all = Vec::with_capacity(some.len());
    for &frame in &some {
        let found = positions.read(&[frame])?;
        all.extend(found.iter().map(|frame| {
            let at = |p: &[f32; 3]| add(p.map(f64::from), origin);
            frame.as_chunks().0.iter().map(at).collect::<Vec<Point>>()
        }));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(all)
}

pub(super) fn learn(args: &ManifoldArgs) -> Result<()> {
    let inputs = args.clips.iter().chain([&args.rig]).chain(&args.names);
    let mut outputs = Outputs::new(args.outputs, inputs)?;
    let output = outputs.text(&args.output)?;
    let rig = read_rig(&args.rig)?;
    let naming = args.names.as_ref().map(|path| named(path, Naming::from_json(&read(path)?))).transpose()?;
    let share = (args.poses as usize).div_ceil(args.clips.len());
    let mut poses = Vec::new();
    for path in &args.clips {
        poses.extend(poses_of(path, &rig, naming.as_ref(), share)?);
    }
    let clock = progress::ticking("learning");
    let kind = if args.kind == ManifoldKind::Pca { Kind::Pca } else { Kind::Gplvm };
    let learned = Examples::new(&rig, &poses).and_then(|examples| Manifold::learn(&examples, kind, args.dims.into()));
    clock.finish_and_clear();
    let text = learned.context("--dims, --poses or the clips")?.to_json();
    let what = format!("a manifold of {} dimensions from {} poses", args.dims, grouped(poses.len()));
    write(&output, args.outputs, text.as_bytes(), &what)
}

/// Poses of a clip, spread evenly.
fn poses_of(path: &Path, rig: &Rig, naming: Option<&Naming>, most: usize) -> Result<Vec<Vec<f64>>> {
    let Clip { skeleton, motion } = read_bvh(path)?;
    let naming = naming.map_or_else(|| named(path, Naming::of(&skeleton)), |naming| Ok(naming.clone()))?;
    let skeleton_poses = named(path, SkeletonPoses::new(&skeleton, &naming, rig))?;
    let frames = motion.frames();
    let count = most.min(frames);
    let frame = |k: usize| k * (frames - 1) / (count - 1).max(1);
    Ok((0..count).map(|k| skeleton_poses.pose(&skeleton.pose(motion.frame(frame(k))))).collect())
}

pub(super) fn read_rig(path: &Path) -> Result<Rig> {
    of_file(path, rig_of(&read(path)?))
}

pub(super) fn read_manifold(path: &Path, rig: &Rig) -> Result<Manifold> {
    of_file(path, manifold_of(&read(path)?, rig))
}

fn of_file<T>(path: &Path, result: Result<T, String>) -> Result<T> {
    result.map_err(|what| anyhow::anyhow!("{}: {what}", path.display()))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| path.display().to_string())
}

fn named<T, E: std::error::Error + Send + Sync + 'static>(path: &Path, result: Result<T, E>) -> Result<T> {
    result.with_context(|| path.display().to_string())
}

fn write(output: &Target, args: OutputArgs, bytes: &[u8], what: &str) -> Result<()> {
    if args.dry_run {
        return super::dry_run::tell_dry_run(output, what, &[]);
    }
    if bytes.is_empty() {
        bail!("{}: nothing to write", output.path().display());
    }
    let mut file = AtomicFile::create(output)?;
    file.write_all(bytes)?;
    file.commit()?;
    tell(&format!("{}: {what}, {}\n", output.path().display(), human_bytes(bytes.len() as u64)))
}
