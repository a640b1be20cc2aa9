//! `cager explore`: shapes between poses.

use super::cage_file::read_cage;
use super::dry_run::tell_dry_run;
use super::outputs::{OutputArgs, Outputs, folder_of};
use super::poses::{PoseFile, Poses};
use super::solver_options::with_input_name;
use super::{counted, grouped, progress, tell};
use anyhow::{Context, Result, bail};
use cager_capture::origin::{MAX_ROUNDING_ERROR, move_to, own_origin};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::reject_far_points;
use cager_formats::{FrameOptions, create_frames, frames_path};
use cager_geometry::mesh::{Point, TriMesh, diagonal};
use cager_motion::pose_cage::around;
use cager_shape::ShapeError;
use cager_shape::interpolate::{CagedShapes, ShapePath, ShapeSpace};
use clap::{Args, ValueEnum};
use faer::Mat;
use std::path::{Path, PathBuf};

/// Find shapes between poses of one model, and beyond them.
///
/// The poses have the same points and faces in the same order: meshes, or frames of .cager files,
/// of which walk.cager@12 is frame 12, counted from 0. They give a path from each to the next one,
/// or one shape by --weights.
///
/// Example: cager explore stand.obj sit.obj --steps 24 -o between.npy
#[derive(Args)]
pub(crate) struct ExploreArgs {
    /// Poses, two or more: .obj .ply .off .stl .glb .abc .usdc, the first one with faces, or IN.cager@FRAME.
    #[arg(value_name = "POSE", required = true, num_args = 2..)]
    poses: Vec<PathBuf>,

    /// mesh: exact; cage: through a cage, in a millisecond a shape.
    #[arg(long, value_enum, value_name = "ON", default_value = "mesh")]
    on: On,

    /// With --on cage, a closed cage, a mesh or that of a .cager file, around the first pose, or
    /// around the rest pose of its .cager file [default: that of the .cager file, or one that is
    /// made].
    #[arg(long, value_name = "CAGE", hide_default_value = true)]
    cage: Option<PathBuf>,

    /// Shapes from each pose to the next one, both ends included.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=100_000),
          conflicts_with = "weights")]
    steps: u32,

    /// One shape: a weight for each pose, with commas between them, which sum to 1; below 0 and
    /// above 1 they lead beyond the poses.
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = weight)]
    weights: Option<Vec<f64>>,

    /// Where to write: .npy .pc2 .mdd .mcx .abc .usdc .glb, a folder (OUT/) of .obj files, or for
    /// one shape .obj .ply .off .stl.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,

    #[command(flatten)]
    outputs: OutputArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum On {
    Mesh,
    Cage,
}

/// Weights sum to one but for this.
const MAX_SUM_ERROR: f64 = 1e-6;

fn weight(text: &str) -> Result<f64, String> {
    text.trim().parse().ok().filter(|weight: &f64| weight.is_finite()).ok_or_else(|| "give a number".to_owned())
}

pub(super) fn run(args: &ExploreArgs) -> Result<()> {
    let files = args.poses.iter().map(|word| PoseFile::named(word)).collect::<Result<Vec<_>>>()?;
    let mut outputs = Outputs::new(args.outputs, files.iter().map(PoseFile::path).chain(&args.cage))?;
    let output = outputs.frames(&args.output)?;
    if args.cage.is_some() && args.on == On::Mesh {
        bail!("--cage: belongs to --on cage; leave it out, or add that");
    }
    let count = count(args, files.len())?;
    refuse_one_mesh(&args.output, count)?;
    let poses = Poses::open(files)?;
    let cage = if args.on == On::Cage { given_cage(args, &poses)? } else { None };
    let what = format!("{} of {} points", counted(count, "shape"), grouped(poses.model.points.len()));
    if args.outputs.dry_run {
        return tell_dry_run(&output, &what, &[]);
    }
    let points = poses.points(folder_of(&output))?;
    let bound = if args.on == On::Cage { Some(bind(cage, &poses)?) } else { None };
    let steps = args.steps as usize - 1;
    // A path is found leg by leg.
    let named = |error, shape: usize| named(&error, shape.saturating_sub(1) / steps, &poses);
    let triangles = TriMesh::from(&poses.model).triangles;
    let faces = &poses.model.faces;
    let origin = own_origin(&poses.model.points);
    let rounding = MAX_ROUNDING_ERROR * diagonal(&poses.model.points);
    let surface = poses.model.surface.clone();
    let options = FrameOptions { origin, rounding, units: poses.units, surface, ..FrameOptions::default() };
    let mut writer = create_frames(output, poses.model.points.len(), count, faces, &options)?;
    let bar = progress::frames("shaping", count);
    let shapes = shapes(args, &triangles, points, bound.as_ref()).map_err(|error| named(error, 0))?;
    for (k, shape) in shapes.enumerate() {
        let mut shape = shape.map_err(|error| named(error, k))?;
        move_to(origin, &mut shape);
        let positions: Vec<f32> = shape.as_flattened().iter().map(|&x| x as f32).collect();
        writer.write_frame(&positions)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let notes = writer.notes();
    writer.finish()?;
    notes.iter().try_for_each(|note| tell(&format!("{note}\n")))?;
    tell(&format!("{}: {what}\n", args.output.display()))
}

/// How many shapes there will be; weights are checked.
fn count(args: &ExploreArgs, poses: usize) -> Result<usize> {
    let Some(weights) = &args.weights else { return Ok(poses.saturating_sub(1) * (args.steps as usize - 1) + 1) };
    if weights.len() != poses {
        let [weights, poses] = [counted(weights.len(), "weight"), counted(poses, "pose")];
        bail!("--weights: {weights} for {poses}; give one for each");
    }
    let sum: f64 = weights.iter().sum();
    if (sum - 1.0).abs() > MAX_SUM_ERROR {
        bail!("--weights: sum to {}, not to 1; give numbers that do", (1e6 * sum).round() / 1e6);
    }
    Ok(1)
}

/// A file of one mesh cannot hold several shapes.
fn refuse_one_mesh(output: &Path, count: usize) -> Result<()> {
    let extension = output.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    let is_mesh = matches!(extension.as_deref(), Some("obj" | "ply" | "off" | "stl"));
    if count > 1 && is_mesh && frames_path(output) == output && !output.is_dir() {
        let folder = output.with_extension("");
        bail!(
            "{}: holds one mesh, and there are {} shapes; give --weights for one shape, or name a folder for all, such \
             as {}",
            output.display(),
            grouped(count),
            folder.join("").display()
        );
    }
    Ok(())
}

/// The cage that is given, or that comes with the first pose; its model lies about in it.
fn given_cage(args: &ExploreArgs, poses: &Poses) -> Result<Option<Cage>> {
    let Some(path) = &args.cage else { return poses.cage() };
    let cage = read_cage(path, (None, poses.units))?;
    let far = reject_far_points(&cage, &poses.model.points);
    far.map_err(|error| with_input_name(&error, poses.file(0).path(), path))?;
    Ok(Some(cage))
}

type Shapes = Box<dyn Iterator<Item = Result<Vec<Point>, ShapeError>>>;

/// The shape that the weights name, or those on the path.
fn shapes(
    args: &ExploreArgs,
    triangles: &[[u32; 3]],
    poses: Vec<Vec<Point>>,
    bound: Option<&(Cage, Mat<f64>)>,
) -> Result<Shapes, ShapeError> {
    let steps = args.steps as usize;
    Ok(match (&args.weights, bound) {
        (Some(weights), None) => Box::new(std::iter::once(ShapeSpace::new(triangles, &poses)?.shape(weights))),
        (Some(weights), Some((cage, phi))) => {
            Box::new(std::iter::once(CagedShapes::new(cage, phi.clone(), &poses)?.shape(weights)))
        }
        (None, None) => Box::new(ShapePath::on_mesh(triangles, poses, steps)?),
        (None, Some((cage, phi))) => Box::new(ShapePath::on_cage(cage, phi.clone(), &poses, steps)?),
    })
}

/// The cage, or one that is made around the model, and coordinates in it.
fn bind(cage: Option<Cage>, poses: &Poses) -> Result<(Cage, Mat<f64>)> {
    let named = || poses.file(0).to_string();
    let cage = cage.map_or_else(|| around(&poses.model).with_context(named), Ok)?;
    let phi = MeanValue.coordinates(&cage, &poses.model.points, None).with_context(named)?.phi;
    Ok((cage, phi))
}

/// Names the pose that caused an error: the one it tells of, or the first of the leg.
fn named(error: &ShapeError, leg: usize, poses: &Poses) -> anyhow::Error {
    let pose = match error {
        ShapeError::OtherPoints { pose, .. } | ShapeError::NotFinite { pose, .. } => *pose,
        _ => leg,
    };
    anyhow::anyhow!("{}: {error}", poses.file(pose))
}
