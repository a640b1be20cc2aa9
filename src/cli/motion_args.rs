//! What can be said to `cager transfer`.

use super::checks::{CheckArgs, TimingArgs};
use super::coding_args::CodingArgs;
use super::names;
use super::outputs::OutputArgs;
use super::service_args::ServiceArgs;
use anyhow::{Context, Result, bail};
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_motion::transfer::{MethodChoice, words};
use cager_proto::transfer_messages::{PublicShape, RestPose, SourceAlignment, TransferMethod, UpAxis};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Move the motion of one model onto another that shares nothing with it: other points, other faces, another body.
///
/// The source's cage is laid onto the target, which says what corresponds to what; the target then
/// follows on its own mesh, and the result is one .cager file as encode writes it, with a cage of
/// the target's own. --method public and rigid are the paper's ways, for comparison.
///
/// Example: cager transfer --source-rest man.obj --source-frames walk.npy --target woman.obj -o walk.cager
#[derive(Args)]
pub(crate) struct TransferMotionArgs {
    /// Source in its rest pose, with faces: .obj .ply .off .stl .glb .abc .usdc.
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
    #[arg(long, value_parser = word::<TransferMethod>(&["fitted", "public", "rigid"]), value_name = "METHOD",
          default_value = "fitted")]
    pub(super) method: TransferMethod,

    /// Closed cage, a mesh or a .cager file: with fitted around the source, with public and rigid
    /// around both, in the target's space [default: one is made].
    #[arg(long, value_name = "CAGE", hide_default_value = true, conflicts_with = "public")]
    pub(super) cage: Option<PathBuf>,

    /// The cage around both, with --method public or rigid: a box, an icosahedron (ico), a sphere
    /// of 162 vertices, the convex hull (42), or an offset surface (350)
    /// [default: sphere].
    #[arg(long, value_parser = word::<PublicShape>(&["box", "ico", "sphere", "hull", "offset"]),
          value_name = "SHAPE", hide_default_value = true)]
    pub(super) public: Option<PublicShape>,

    /// Coordinates in the cage around both, with --method public or rigid [default: mvc].
    #[arg(long, value_parser = names::coordinates())]
    pub(super) coordinates: Option<&'static dyn CoordinateSystem>,

    /// Weight of the target's rigidity, with --method rigid [default: 0.01].
    #[arg(long, value_name = "MU", value_parser = weight)]
    pub(super) rigidity: Option<f64>,

    /// Bring the detail of the target at rest, which a cage around both loses, back to every frame,
    /// with --method public or rigid.
    #[arg(long)]
    pub(super) detail: bool,

    /// With fitted, relative: what the source does to its rest pose, the target does to its own;
    /// absolute: limbs take the source's directions, for like bodies that stand differently at
    /// rest; auto decides by how alike the shapes are [default: auto].
    #[arg(long, value_parser = word::<RestPose>(&["auto", "relative", "absolute"]), value_name = "POSE")]
    pub(super) pose: Option<RestPose>,

    /// How the source is laid onto the target at first: pca by their surfaces, none as they stand,
    /// or a file or list of the 16 numbers, row by row, of the matrix that turns, scales and moves
    /// it there.
    #[arg(long, value_name = "pca|none|MATRIX", default_value = "pca", allow_hyphen_values = true)]
    align: String,

    /// Axis that points up in both: the source is turned about it alone, feet stand on the floor and do not slide.
    #[arg(long, value_parser = word::<UpAxis>(&["x", "y", "z"]), value_name = "AXIS")]
    pub(super) up: Option<UpAxis>,

    /// With fitted, vertices that correspond, where some are known: a text file with a vertex of
    /// the source and one of the target on each line, both counted from 0; # begins a comment.
    #[arg(long, value_name = "PAIRS.txt")]
    pub(super) pairs: Option<PathBuf>,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(super) output: PathBuf,

    #[command(flatten)]
    pub(super) outputs: OutputArgs,

    /// Most vertices of the target's cage, which is designed from its new motion [default: 350].
    #[arg(long, value_name = "N", conflicts_with = "mean_error",
          value_parser = clap::value_parser!(u32).range(4..=1_500))]
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

    #[command(flatten)]
    pub(super) service: ServiceArgs,
}

/// One of the words that the service's options have too.
fn word<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    words: &'static [&'static str],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).try_map(|word| serde_json::from_value(word.into()))
}

fn weight(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|weight: &f64| weight.is_finite() && *weight >= 0.0);
    found.ok_or_else(|| "give a number, 0 or more".to_owned())
}

impl TransferMotionArgs {
    /// Coordinates in the cage around both.
    pub(super) fn system(&self) -> &'static dyn CoordinateSystem {
        self.coordinates.unwrap_or(&MeanValue)
    }

    /// How source and target are aligned, as the service is told it.
    pub(super) fn alignment(&self) -> Result<(Option<SourceAlignment>, Option<[f64; 16]>)> {
        Ok(match &self.align[..] {
            "pca" => (Some(SourceAlignment::Pca), None),
            "none" => (Some(SourceAlignment::None), None),
            text => (None, Some(matrix(text)?)),
        })
    }

    /// How the motion is moved.
    pub(super) fn method(&self) -> Result<MethodChoice> {
        self.refuse_strangers()?;
        if self.method == TransferMethod::Rigid && self.system().name() == "green" {
            bail!(
                "--coordinates: with --method rigid, green has normals that follow from the vertices; take mvc or \
                 harmonic"
            );
        }
        Ok(words::method(self.method, (self.cage.is_some(), self.public), self.rigidity))
    }

    /// Refuses what another method is told by.
    fn refuse_strangers(&self) -> Result<()> {
        use TransferMethod::{Fitted, Public, Rigid};
        let both: &[TransferMethod] = &[Public, Rigid];
        let options: [(&str, bool, &[TransferMethod], &str); 6] = [
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

fn matrix(text: &str) -> Result<[f64; 16]> {
    let read = if Path::new(text).is_file() {
        std::fs::read_to_string(text).with_context(|| format!("--align: {text}"))?
    } else {
        text.to_owned()
    };
    let words = read.split(|c: char| c.is_whitespace() || c == ',').filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|m| m.iter().all(|x| x.is_finite())).and_then(|m| <[f64; 16]>::try_from(m).ok());
    let Some(matrix) = numbers else {
        bail!("--align: {text}: is none of pca and none, and no file or list of 16 numbers");
    };
    if words::align(None, Some(matrix)).is_none() {
        bail!(
            "--align: {text}: does more than turn, scale evenly and move; give a matrix without mirroring and shear, \
             whose last row is 0 0 0 1"
        );
    }
    Ok(matrix)
}
