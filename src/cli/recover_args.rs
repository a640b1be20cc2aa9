//! Arguments of `cager recover`.

use super::checks::TimingArgs;
use super::coding_args::CodingArgs;
use super::outputs::OutputArgs;
use super::service_args::ServiceArgs;
use super::stretches::KeyTemplate;
use cager_geometry::units::Up;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Recover one animation of a template from meshes or point clouds that have no correspondence:
/// scans, reconstructions, visual hulls.
///
/// Every frame is a surface of its own, with other points and other faces. The template is laid
/// onto each by its cage, as rigid as the surfaces allow, and the result is one .cager file as
/// encode writes it. The template should stand about as the first frame does. Example: cager
/// recover --template scan_0001.ply --frames 'scan_*.ply' -o dance.cager
#[derive(Args)]
pub(crate) struct RecoverArgs {
    /// Mesh that is to move: .obj .ply .off .stl .glb .abc .usdc, with faces; one of the frames
    /// will do. Where the topology changes for good, go on with another one from that frame:
    /// --template first.obj --template 120:second.obj. Then out-1.cager, out-2.cager and a list of
    /// them, out.stretches.json, are written.
    #[arg(long, value_name = "[FRAME:]TEMPLATE", required = true,
          value_parser = OsStringValueParser::new().map(KeyTemplate::from))]
    pub(super) template: Vec<KeyTemplate>,

    /// Surfaces, in the order of their numbers: a folder, quoted glob or numbered name
    /// (scan.%04d.ply) of mesh files or of point clouds with or without normals.
    #[arg(long, value_name = "FRAMES")]
    pub(super) frames: PathBuf,

    /// Closed cage around the template, a mesh or a .cager file, or one for each template in their
    /// order [default: one of about 350 vertices is made].
    #[arg(long, value_name = "CAGE", hide_default_value = true, conflicts_with = "rig")]
    pub(super) cage: Vec<PathBuf>,

    /// Follow a person by this rig, as `cager rig` writes it for the template: for noisy, partial or fast surfaces.
    #[arg(long, value_name = "RIG.json", requires = "manifold")]
    pub(super) rig: Option<PathBuf>,

    /// Poses that are usual, as `cager manifold` writes them.
    #[arg(long, value_name = "MANIFOLD.json", requires = "rig")]
    pub(super) manifold: Option<PathBuf>,

    /// With --rig, paper: as Duveau et al. 2012 print it, for comparison.
    #[arg(long, value_enum, value_name = "METHOD", requires = "rig", default_value = "robust")]
    pub(super) method: PersonMethod,

    /// With --rig, write where its joints are in every frame: .csv or .bvh, at 30 frames per second without --fps.
    #[arg(long, value_name = "JOINTS", requires = "rig")]
    pub(super) joints: Option<PathBuf>,

    /// With --rig, draw how high ankles and toes are over time: .svg.
    #[arg(long, value_name = "GAIT.svg", requires = "rig", conflicts_with = "server")]
    pub(super) gait: Option<PathBuf>,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(super) output: PathBuf,

    #[command(flatten)]
    pub(super) outputs: OutputArgs,

    /// Let points of the template leave the cage to meet the surfaces, smoothly; give an error
    /// (--max-error) to store where they are.
    #[arg(long)]
    pub(super) offsets: bool,

    /// Give the template the colours of the surfaces, each point the mean of what is seen at it.
    #[arg(long, conflicts_with = "server")]
    pub(super) colors: bool,

    /// auto: turn and move the template onto the first surface before it is followed.
    #[arg(long, value_enum, value_name = "ALIGN", default_value = "none")]
    pub(super) align: Align,

    /// auto: scale the template to the first surface, and turn and move it as with --align auto.
    #[arg(long, value_enum, value_name = "SCALE", default_value = "none")]
    pub(super) scale: Align,

    /// Axis that points up in the frames, where the other of y and z does in the template: the template is turned.
    #[arg(long = "up", id = "frames_up", value_name = "AXIS", value_parser = super::checks::up)]
    pub(super) up: Option<Up>,

    /// Points of each surface that are looked at.
    #[arg(long, value_name = "N", default_value_t = 15_000,
          value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub(super) points: u32,

    #[command(flatten)]
    pub(super) timing: TimingArgs,

    #[command(flatten)]
    pub(super) coding: CodingArgs,

    /// Write how every frame was found and how far it lies from its surface as JSON.
    #[arg(long, value_name = "REPORT.json")]
    pub(super) report: Option<PathBuf>,

    #[command(flatten)]
    pub(super) service: ServiceArgs,

    /// Go on past files that hold no surface, and where the template seems turned or of another size.
    #[arg(long)]
    pub(super) force: bool,
}

/// Whether something is found automatically.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Align {
    None,
    Auto,
}

/// How a person is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum PersonMethod {
    Robust,
    Paper,
}

/// How joints are written.
#[derive(Clone, Copy)]
pub(super) enum JointsKind {
    Csv,
    Bvh,
}

impl JointsKind {
    /// Their name among a service's results.
    pub(super) fn result(self) -> &'static str {
        match self {
            Self::Csv => "joints.csv",
            Self::Bvh => "joints.bvh",
        }
    }
}
