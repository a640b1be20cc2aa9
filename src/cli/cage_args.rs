//! Arguments of `cager cage`.

use super::checks::CheckArgs;
use super::names;
use super::outputs::OutputArgs;
use cager_cages::Style;
use cager_compare::report_page::Up;
use clap::{ArgGroup, Args, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// Make a cage around a model, design one from its motion, or check, repair or improve one.
///
/// With --rest alone, a closed cage around the rest pose. With --frames too, a cage whose vertices
/// lie where the motion needs them: several times more accurate. With --check, --repair or
/// --improve, what becomes of a cage of your own. Example: cager cage --rest rest.obj --frames
/// walk.npy -o cage.obj
#[derive(Args, Debug)]
#[command(group(ArgGroup::new("work").args(["check", "repair", "improve", "general"])))]
pub(crate) struct CageArgs {
    /// Model in its rest pose: .obj .ply .off .stl .glb .abc .usdc; a point cloud will do. More
    /// than once with --general: one cage around all.
    #[arg(long, value_name = "REST", required = true)]
    pub(crate) rest: Vec<PathBuf>,

    /// Capture to design the cage from, as for encode: a folder or quoted glob of mesh files, .npy,
    /// .pc2, .mdd, .mcx, .abc, .usdc or animated .glb.
    #[arg(long, value_name = "FRAMES")]
    pub(crate) frames: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) checks: CheckArgs,

    /// Cage to write, .obj or .ply, or - for .obj on standard output.
    #[arg(short, long, value_name = "CAGE.obj", required_unless_present = "check")]
    pub(crate) output: Option<PathBuf>,

    /// Most vertices [default: 350].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..=100_000))]
    pub(crate) vertices: Option<u32>,

    /// The smallest cage whose mean L2 error is at most E, a fraction of the rest pose's diagonal; needs --frames.
    #[arg(long, value_name = "E", requires = "frames", conflicts_with = "vertices", allow_negative_numbers = true)]
    pub(crate) mean_error: Option<f64>,

    /// What the designed cage is for; needs --frames [default: editable].
    #[arg(long, value_parser = names::style(), value_name = "STYLE", requires = "frames")]
    pub(crate) style: Option<Style>,

    /// Least distance of the model's points to the cage, as a fraction of the rest pose's diagonal [default: chosen].
    #[arg(long, value_name = "D", conflicts_with = "frames", allow_negative_numbers = true)]
    pub(crate) clearance: Option<f64>,

    /// One closed surface for each connected part of the model.
    #[arg(long, conflicts_with_all = ["frames", "work"])]
    pub(crate) per_part: bool,

    /// Make a cage of a general shape around all models instead.
    #[arg(long, value_enum, value_name = "SHAPE", conflicts_with_all = ["frames", "clearance"])]
    pub(crate) general: Option<GeneralArg>,

    /// Say whether this cage is usable, and why not.
    #[arg(long, value_name = "CAGE", conflicts_with_all = ["output", "frames", "vertices", "clearance"])]
    pub(crate) check: Option<PathBuf>,

    /// Repair this cage without changing what it is meant to be, and list what was changed.
    #[arg(long, value_name = "CAGE", conflicts_with_all = ["frames", "vertices", "clearance"])]
    pub(crate) repair: Option<PathBuf>,

    /// Move the vertices of this cage, a mesh or that of a .cager file, to where the motion needs
    /// them; its faces, quads among them, stay. Needs --frames.
    #[arg(long, value_name = "CAGE", requires = "frames", conflicts_with_all = ["vertices", "mean_error"])]
    pub(crate) improve: Option<PathBuf>,

    /// Keep the improved cage symmetric across the plane of this axis.
    #[arg(long, value_enum, value_name = "AXIS", requires = "improve")]
    pub(crate) symmetry: Option<Up>,

    /// Seed of what a design draws at random: the same seed gives the same cage.
    #[arg(long, value_name = "SEED", default_value_t = 0, requires = "frames")]
    pub(crate) seed: u64,

    /// End a design with the best cage so far after so many seconds.
    #[arg(long, value_name = "S", value_parser = names::seconds, requires = "frames")]
    pub(crate) time_limit: Option<Duration>,

    /// Write a page for a browser, in which model and cage turn.
    #[arg(long, value_name = "PICTURE.html")]
    pub(crate) picture: Option<PathBuf>,

    /// Axis that points up on that page [default: y, or z where the model stands along it].
    #[arg(long, value_enum, requires = "picture")]
    pub(crate) up: Option<Up>,

    /// Write what was found out as JSON.
    #[arg(long, value_name = "REPORT.json")]
    pub(crate) report: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,
}

/// Cages that are no closer to a model than their shape allows.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GeneralArg {
    /// The bounding box.
    Box,
    /// A sphere of triangles.
    Sphere,
    /// The convex hull, simplified and enlarged.
    Hull,
}
