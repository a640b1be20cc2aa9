//! What can be said to `cager transfer`.

use super::args::CodingArgs;
use super::checks::{CheckArgs, TimingArgs};
use super::names;
use super::outputs::OutputArgs;
use crate::report_page::Up;
use crate::transfer::{MethodChoice, Public, similarity};
use anyhow::{Context, Result, bail};
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_explore::alignment::AlignBy;
use cager_explore::public_cage::PublicCage;
use cager_explore::transfer::Pose;
use cager_explore::transfer::rigid::RIGIDITY;
use cager_geometry::mesh::Point;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Move the motion of one model onto another that shares nothing with it: other points, other faces, another body.
///
/// The source's cage is laid onto the target, which says what corresponds to what; the target then follows on its own mesh, and the result is one .cager file as
/// encode writes it, with a cage of the target's own. --method public and rigid are the paper's ways, for comparison.
///
/// Example: cager transfer --source-rest man.obj --source-frames walk.npy --target woman.obj -o walk.cager
#[derive(Args)]
pub(crate) struct TransferMotionArgs {
    /// Source in its rest pose, with faces: .obj .ply .off .stl .glb.
    #[arg(long, value_name = "S0", required_unless_present = "source")]
    pub(super) source_rest: Option<PathBuf>,

    /// Its frames, points in the order of the rest pose: as for encode.
    #[arg(long, value_name = "FRAMES", required_unless_present = "source")]
    pub(super) source_frames: Option<PathBuf>,

    /// Source with its frames, encoded before.
    #[arg(long, value_name = "IN.cager", conflicts_with_all = ["source_rest", "source_frames"])]
    pub(super) source: Option<PathBuf>,

    /// Target in its rest pose; a point cloud will do.
    #[arg(long, value_name = "T0")]
    pub(super) target: PathBuf,

    /// How the motion is moved.
    #[arg(long, value_enum, value_name = "METHOD", default_value = "fitted")]
    method: MethodArg,

    /// Closed cage: with fitted around the source, with public and rigid around both, in the target's space [default: one is made].
    #[arg(long, value_name = "CAGE", hide_default_value = true, conflicts_with = "public")]
    pub(super) cage: Option<PathBuf>,

    /// The cage around both, with --method public or rigid [default: sphere].
    #[arg(long, value_enum, value_name = "SHAPE", hide_default_value = true)]
    public: Option<PublicArg>,

    /// Coordinates in the cage around both, with --method public or rigid [default: mvc].
    #[arg(long, value_parser = names::coordinates())]
    coordinates: Option<&'static dyn CoordinateSystem>,

    /// Weight of the target's rigidity, with --method rigid [default: 0.01].
    #[arg(long, value_name = "MU", value_parser = weight)]
    rigidity: Option<f64>,

    /// Bring the detail of the target at rest, which a cage around both loses, back to every frame, with --method public or rigid.
    #[arg(long)]
    pub(super) detail: bool,

    /// With fitted, relative: what the source does to its rest pose, the target does to its own; absolute: limbs take the source's directions, for like bodies that stand
    /// differently at rest; auto decides by how alike the shapes are [default: auto].
    #[arg(long, value_enum, value_name = "POSE")]
    pose: Option<PoseArg>,

    /// How the source is laid onto the target at first: pca by their surfaces, none as they stand, or a file or list of the 16 numbers, row by row, of the matrix
    /// that turns, scales and moves it there.
    #[arg(long, value_name = "pca|none|MATRIX", default_value = "pca", allow_hyphen_values = true)]
    align: String,

    /// Axis that points up in both: the source is turned about it alone, feet stand on the floor and do not slide.
    #[arg(long, value_enum, value_name = "AXIS")]
    up: Option<Up>,

    /// With fitted, vertices that correspond, where some are known: a text file with a vertex of the source and one of the target on each line, both counted from 0; # begins
    /// a comment.
    #[arg(long, value_name = "PAIRS.txt")]
    pub(super) pairs: Option<PathBuf>,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(super) output: PathBuf,

    #[command(flatten)]
    pub(super) outputs: OutputArgs,

    /// Most vertices of the target's cage, which is designed from its new motion [default: 350].
    #[arg(long, value_name = "N", conflicts_with = "mean_error", value_parser = clap::value_parser!(u32).range(4..=1_500))]
    pub(super) cage_vertices: Option<u32>,

    #[command(flatten)]
    pub(super) checks: CheckArgs,

    #[command(flatten)]
    pub(super) timing: TimingArgs,

    #[command(flatten)]
    pub(super) coding: CodingArgs,

    /// Write how source and target were brought together and what the motion does to the target as JSON.
    #[arg(long, value_name = "REPORT.json")]
    pub(super) report: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MethodArg {
    Fitted,
    Public,
    Rigid,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PublicArg {
    /// 8 vertices.
    Box,
    /// 12 vertices.
    Ico,
    /// 162 vertices.
    Sphere,
    /// The convex hull, 42 vertices.
    Hull,
    /// An offset surface, 350 vertices.
    Offset,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PoseArg {
    Auto,
    Relative,
    Absolute,
}

fn weight(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|weight: &f64| weight.is_finite() && *weight >= 0.0);
    found.ok_or_else(|| "give a number, 0 or more".to_owned())
}

impl TransferMotionArgs {
    /// The axis that points up.
    pub(super) fn axis(&self) -> Option<Point> {
        self.up.map(|up| match up {
            Up::X => [1.0, 0.0, 0.0],
            Up::Y => [0.0, 1.0, 0.0],
            Up::Z => [0.0, 0.0, 1.0],
        })
    }

    /// Which pose the target has at rest.
    pub(super) fn pose(&self) -> Pose {
        match self.pose {
            None | Some(PoseArg::Auto) => Pose::Auto,
            Some(PoseArg::Relative) => Pose::Relative,
            Some(PoseArg::Absolute) => Pose::Absolute,
        }
    }

    /// Coordinates in the cage around both.
    pub(super) fn system(&self) -> &'static dyn CoordinateSystem {
        self.coordinates.unwrap_or(&MeanValue)
    }

    /// How source and target are aligned.
    pub(super) fn alignment(&self) -> Result<AlignBy> {
        alignment(&self.align)
    }

    /// How the motion is moved.
    pub(super) fn method(&self) -> Result<MethodChoice> {
        self.refuse_strangers()?;
        let cage = match (self.public, &self.cage) {
            (None, Some(_)) => Public::Given,
            (shape, _) => Public::Made(match shape.unwrap_or(PublicArg::Sphere) {
                PublicArg::Box => PublicCage::Box,
                PublicArg::Ico => PublicCage::Icosahedron,
                PublicArg::Sphere => PublicCage::Sphere(162),
                PublicArg::Hull => PublicCage::Hull(42),
                PublicArg::Offset => PublicCage::Offset(350),
            }),
        };
        Ok(match self.method {
            MethodArg::Fitted => MethodChoice::Fitted,
            MethodArg::Public => MethodChoice::Public(cage),
            MethodArg::Rigid if self.system().name() == "green" => bail!(
                "--coordinates: with --method rigid, green has normals that follow from the vertices; take mvc or harmonic"
            ),
            MethodArg::Rigid => MethodChoice::Rigid(cage, self.rigidity.unwrap_or(RIGIDITY)),
        })
    }

    /// Refuses what another method is told by.
    fn refuse_strangers(&self) -> Result<()> {
        use MethodArg::{Fitted, Public, Rigid};
        let both: &[MethodArg] = &[Public, Rigid];
        let options: [(&str, bool, &[MethodArg], &str); 6] = [
            ("--public", self.public.is_some(), both, "public and rigid"),
            ("--coordinates", self.coordinates.is_some(), both, "public and rigid"),
            ("--detail", self.detail, both, "public and rigid"),
            ("--rigidity", self.rigidity.is_some(), &[Rigid], "rigid"),
            ("--pose", self.pose.is_some(), &[Fitted], "fitted"),
            ("--pairs", self.pairs.is_some(), &[Fitted], "fitted"),
        ];
        for (option, given, methods, names) in options {
            if given && !methods.contains(&self.method) {
                bail!("{option}: belongs to --method {names}; leave it out, or take that method");
            }
        }
        Ok(())
    }
}

fn alignment(text: &str) -> Result<AlignBy> {
    match text {
        "pca" => return Ok(AlignBy::Surfaces),
        "none" => return Ok(AlignBy::AsTheyStand),
        _ => {}
    }
    let read = if Path::new(text).is_file() {
        std::fs::read_to_string(text).with_context(|| format!("--align: {text}"))?
    } else {
        text.to_owned()
    };
    let words = read.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let Some(m) = numbers.filter(|m| m.len() == 16 && m.iter().all(|x| x.is_finite())) else {
        bail!("--align: {text}: is none of pca and none, and no file or list of 16 numbers");
    };
    let Some(similarity) = <&[f64; 16]>::try_from(&*m).ok().and_then(similarity) else {
        bail!(
            "--align: {text}: does more than turn, scale evenly and move; give a matrix without mirroring and shear, whose last row is 0 0 0 1"
        );
    };
    Ok(AlignBy::Given(similarity))
}
