//! Command-line arguments: one definition gives parsing, help and shell completions.

use super::cage_args::CageArgs;
use super::checks::{CaptureArgs, CheckArgs, TimingArgs};
use super::coding_args::CodingArgs;
use super::explore::ExploreArgs;
use super::morph_args::MorphArgs;
use super::motion_args::TransferMotionArgs;
use super::names;
use super::outputs::OutputArgs;
use super::recover_args::RecoverArgs;
use super::rig::{ManifoldArgs, RigArgs};
use super::service::ServiceCommand;
use super::transfer_args::{EditArgs, TransferArgs};
use cager_cages::Style;
use cager_capture::decode::Layer;
use cager_capture::design::PerPart;
use cager_capture::memory::Memory;
use cager_capture::sizes::bytes;
use cager_compare::report_page::Up;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use cager_formats::FrameRange;
use clap::{Args, Parser, Subcommand};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// Turns animated mesh captures into light, editable, streamable cages.
///
/// A capture is the same mesh in every frame; a cage is a coarse closed mesh around its rest pose.
/// `encode` recovers the cage of every frame and writes one small .cager file; `decode` turns it
/// back into positions. Try `cager demo` first: it needs no files.
#[derive(Parser)]
#[command(name = "cager", version = env!("CAGER_VERSION"), max_term_width = 100, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) global_args: GlobalArgs,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Options of every command.
#[derive(Args, Debug)]
pub(crate) struct GlobalArgs {
    /// Threads to work on [default: one for each processor].
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Say nothing but warnings, errors and what was asked for: no summary, no progress.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,

    /// Say how long each step took, too.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Encode(Box<EncodeArgs>),
    Decode(DecodeArgs),
    Recover(Box<RecoverArgs>),
    Transfer(Box<TransferMotionArgs>),
    Explore(ExploreArgs),
    Rig(RigArgs),
    Manifold(ManifoldArgs),
    Edit(EditArgs),
    Inspect(InspectArgs),
    Cage(Box<CageArgs>),
    Compare(CompareArgs),
    #[command(flatten)]
    Service(ServiceCommand),
    Health(HealthArgs),
    /// List the file formats of meshes and captures: whether they are written as well as read, and
    /// what they say of units and times.
    ///
    /// Example: cager formats
    Formats,
    Completions(CompletionsArgs),
    Man(ManArgs),
}

/// Recover the cage of every frame of a capture and write a .cager file.
///
/// Without --cage, a cage is designed from the capture first.
/// Example: cager encode --rest rest.obj --frames 'walk/*.obj' -o walk.cager
#[derive(Args)]
pub(crate) struct EncodeArgs {
    /// Model in its rest pose: .obj .ply .off .stl .glb .abc .usdc; a point cloud will do.
    #[arg(long, value_name = "REST")]
    pub(crate) rest: PathBuf,

    /// Closed cage around the rest pose, same formats, polygons are triangulated; or the .cager
    /// file of another take, whose cage is taken [default: one is designed from the capture].
    #[arg(long, value_name = "CAGE", hide_default_value = true)]
    pub(crate) cage: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) design: DesignArgs,

    /// Capture, points in the order of the rest pose: a folder, quoted glob or numbered name
    /// (walk.%04d.obj, walk.####.obj, frame_%04d/mesh.obj) of mesh files (2.obj comes before
    /// 10.obj) or of one .npy a frame, .npy (frames × points × 3), .npz, .pc2, .mdd, .mcx, .abc,
    /// .usdc, .usda or animated .glb.
    #[arg(long, value_name = "FRAMES")]
    pub(crate) frames: PathBuf,

    /// Take only frames A to B, both included, every STEP-th; counted from 0 in the order of FRAMES.
    #[arg(long, value_name = "A-B[xSTEP]", allow_hyphen_values = true)]
    pub(crate) frames_range: Option<FrameRange>,

    #[command(flatten)]
    pub(crate) capture: CaptureArgs,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,

    #[command(flatten)]
    pub(crate) solver: SolverArgs,

    /// Memory for frames and coordinates, such as 1GB; what does not fit is computed in parts, to
    /// the same result, but groups of coded frames are shorter where a whole one does not fit. The
    /// model itself and its analysis, half a gigabyte with a cage of 350 vertices, come on top
    /// [default: half of what is free].
    #[arg(long, value_name = "SIZE", value_parser = memory, hide_default_value = true)]
    pub(crate) memory: Option<Memory>,

    #[command(flatten)]
    pub(crate) coding: CodingArgs,

    /// link: the pictures of materials stay the files that the rest pose names; embed: their bytes
    /// are taken in, and decode writes them beside its output.
    #[arg(long, value_enum, value_name = "HOW", default_value = "link")]
    pub(crate) textures: Textures,

    /// Write sizes, errors per frame, spectrum and times as JSON.
    #[arg(long, value_name = "REPORT.json")]
    pub(crate) report: Option<PathBuf>,

    /// Turn all faces of the cage around: for cages whose normals point inwards.
    #[arg(long, requires = "cage")]
    pub(crate) flip_cage: bool,

    /// Have a service compute: its address, such as http://127.0.0.1:8080. Frames are sent in
    /// single precision and numbered from 0.
    #[arg(long, value_name = "URL")]
    pub(crate) server: Option<String>,

    /// Token to show to the service [default: the environment's CAGER_TOKEN, which other users of
    /// this machine do not see].
    #[arg(long, value_name = "T", requires = "server", hide_default_value = true)]
    pub(crate) token: Option<String>,

    /// Go on with a session whose upload broke: what it has is not sent again, but compared. Give
    /// the files and options that it was made with.
    #[arg(long, value_name = "ID", requires = "server")]
    pub(crate) session: Option<String>,

    /// Connections to the service that send frames at the same time, where one is slower than the way there.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16))]
    pub(crate) connections: u8,
}

/// What happens to the pictures of materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Textures {
    Link,
    Embed,
}

/// How the cage is designed where none is given.
#[derive(Args, Debug)]
pub(crate) struct DesignArgs {
    /// Most vertices of the designed cage [default: 350].
    #[arg(long, value_name = "N", conflicts_with_all = ["cage", "mean_error"],
          value_parser = clap::value_parser!(u32).range(4..=1_500))]
    pub(crate) cage_vertices: Option<u32>,

    /// Whether the designed cage has components that carry a part of the model each.
    #[arg(long, value_parser = names::per_part(), value_name = "HOW", default_value = "auto", conflicts_with = "cage")]
    pub(crate) per_part: PerPart,

    /// What the designed cage is for [default: free with mean value coordinates, editable with others].
    #[arg(long, value_parser = names::style(), value_name = "STYLE", conflicts_with = "cage")]
    pub(crate) style: Option<Style>,

    /// Seed of what a design draws at random: the same seed gives the same cage [default: 0].
    #[arg(long, value_name = "SEED", conflicts_with = "cage")]
    pub(crate) seed: Option<u64>,

    /// End the design with the best cage so far after so many seconds.
    #[arg(long, value_name = "S", conflicts_with = "cage", value_parser = names::seconds)]
    pub(crate) time_limit: Option<Duration>,
}

#[derive(Args)]
pub(crate) struct SolverArgs {
    /// Cage coordinates that bind the points to the cage.
    #[arg(long, value_parser = names::coordinates(), default_value = "mvc")]
    pub(crate) coordinates: &'static dyn CoordinateSystem,

    /// Points the inversion reads [default: spread; all where frames are coded, except with green].
    #[arg(long, value_parser = names::handles())]
    pub(crate) handles: Option<Handles>,

    /// How many points rectangular and spread read: from the number of the cage's unknowns to that
    /// of the model's points
    /// [default: twice the unknowns].
    #[arg(long, value_name = "K")]
    pub(crate) handle_count: Option<usize>,

    /// Treatment of the unstable end of the spectrum.
    #[arg(long, value_parser = names::regularizer(), default_value = Regularizer::default().name())]
    pub(crate) regularizer: Regularizer,

    /// The matrix of --regularizer matrix: sparse, in the Matrix Market format (coordinate), one
    /// column per vertex of the cage in its order.
    #[arg(long, value_name = "FILE.mtx")]
    pub(crate) regularizer_matrix: Option<PathBuf>,

    /// Spectrum threshold: how many of the last singular directions are regularised; "all" of them;
    /// or "auto": as many as
    /// --spectrum-bound allows, measured on frames of the capture [default: 20, or a sixteenth of
    /// the unknowns where that is less; where frames are coded, except with green, all with a λ of
    /// 0.001, unless λ or another regulariser is given].
    #[arg(long, value_name = "S", value_parser = spectrum, allow_negative_numbers = true)]
    pub(crate) spectrum: Option<SpectrumArg>,

    /// Largest extra L2 error of --spectrum auto, as a fraction of the error at threshold 0 [default: 0.05].
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    pub(crate) spectrum_bound: Option<f64>,

    /// Weight of the regularisation beside the mean square error of the points, whichever points
    /// are read; 0 is the same as --spectrum 0 (for tikhonov it is the damping α) [default: 1; with
    /// the default spectrum of frames that are coded 0.001].
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    pub(crate) lambda: Option<f64>,
}

/// Turn a .cager file back into positions, or into its cages; move other models by them.
///
/// Example: cager decode walk.cager -o walk.pc2
#[derive(Args, Debug)]
pub(crate) struct DecodeArgs {
    /// File to read, or a list of them that recover wrote, which is decoded as one sequence.
    #[arg(value_name = "IN.cager")]
    pub(crate) input: PathBuf,

    /// Where to write: .npy, .pc2, .mdd, .mcx (with its .xml), .abc, .usdc, .glb or .gltf (morph
    /// targets), OUT.vat/ (textures for engines), or a folder that is to hold one .obj per frame
    /// ('FOLDER/*.ply' for .ply, FOLDER/walk.%04d.obj or FOLDER/walk.####.obj for names of your
    /// own), of one frame (--frame) .obj, .ply, .off or .stl, or - for .npy on standard output.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,

    #[command(flatten)]
    pub(crate) timing: TimingArgs,

    /// Memory for frames and coordinates, such as 1GB; what does not fit is computed in parts, to
    /// the same result [default: half of what is free].
    #[arg(long, value_name = "SIZE", value_parser = memory, hide_default_value = true)]
    pub(crate) memory: Option<Memory>,

    /// cages: what the cages say alone, fast and coarse; all: with the residual of files that have one.
    #[arg(long, value_enum, value_name = "LAYER", default_value = "all", conflicts_with = "cages")]
    pub(crate) layer: Layer,

    /// Write a layer of USD on top of this file, which the capture came from: the points of its
    /// meshes in each frame alone, so that materials, groups and bindings stay those of the file.
    #[arg(long, value_name = "SOURCE.usd", conflicts_with_all = ["cages", "model"])]
    pub(crate) onto: Option<PathBuf>,

    /// Write these parts of the model alone: their paths, names, or globs of these, such as 'eye*';
    /// may be given several times.
    #[arg(long, value_name = "NAME", conflicts_with = "cages")]
    pub(crate) part: Vec<String>,

    /// Decode what can be of a file that is damaged or was cut: frames that cannot are left out and named.
    #[arg(long, conflicts_with_all = ["cages", "with_cages"])]
    pub(crate) salvage: bool,

    #[command(flatten)]
    pub(crate) morphs: MorphArgs,

    #[command(flatten)]
    pub(crate) transfer: TransferArgs,
}

/// Show what a .cager file holds: sizes, spectrum, errors.
///
/// Every checksum is compared on the way. Example: cager inspect walk.cager
///
/// Of a list that recover wrote, each file is shown.
#[derive(Args, Debug)]
pub(crate) struct InspectArgs {
    /// File to read.
    #[arg(value_name = "IN.cager")]
    pub(crate) input: PathBuf,

    /// Print JSON with the keys of the encode report that the file keeps.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compare ways to invert a capture, with the figures of the paper, in one HTML file.
///
/// Every method is run on the capture: the report shows its errors, how smoothly its cages move,
/// spectra, times and pictures, and which options the figures advise. On two cores, 120 frames of
/// 20,000 points in a cage of 330 vertices take some minutes with all coordinates, and 10 seconds
/// with --coordinates mvc. Example: cager compare --rest rest.obj --cage cage.obj --frames walk.npy
/// -o walk.html
#[derive(Args)]
pub(crate) struct CompareArgs {
    /// Model in its rest pose: .obj .ply .off .stl .glb .abc .usdc; a point cloud will do.
    #[arg(long, value_name = "REST")]
    pub(crate) rest: PathBuf,

    /// Closed cage around the rest pose, same formats, polygons are triangulated; or a .cager file,
    /// whose cage is taken.
    #[arg(long, value_name = "CAGE")]
    pub(crate) cage: PathBuf,

    /// Capture, points in the order of the rest pose, as for encode: a folder or quoted glob of
    /// mesh files, .npy, .npz, .pc2, .mdd, .mcx, .abc, .usdc or animated .glb.
    #[arg(long, value_name = "FRAMES")]
    pub(crate) frames: PathBuf,

    /// Report to write, or - for standard output; it appears whole or not at all, and needs no
    /// other file and no network to be read.
    #[arg(short, long, value_name = "REPORT.html")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,

    /// Write all figures as JSON.
    #[arg(long, value_name = "FIGURES.json")]
    pub(crate) json: Option<PathBuf>,

    /// Cage coordinates to compare, separated by commas [default: all].
    #[arg(long, value_parser = names::coordinates(), value_delimiter = ',', hide_default_value = true)]
    pub(crate) coordinates: Vec<&'static dyn CoordinateSystem>,

    /// Frames to measure at the most: evenly spaced ones, each with its neighbours.
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) frames_at_most: u32,

    #[command(flatten)]
    pub(crate) checks: CheckArgs,

    /// Axis that points up in the report [default: y, or z where the model stands along it].
    #[arg(long, value_enum)]
    pub(crate) up: Option<Up>,

    /// Turn all faces of the cage around: for cages whose normals point inwards.
    #[arg(long)]
    pub(crate) flip_cage: bool,
}

/// Ask a service on this machine whether it is ready: exit status 0, or 1 with the reason.
///
/// For containers and scripts that have no curl. For a service with TLS it reports only whether it is alive.
/// Example: cager health --address 127.0.0.1:8080
#[derive(Args, Debug)]
pub(crate) struct HealthArgs {
    /// Address and port [default: the environment's CAGER_LISTEN, or 127.0.0.1:8080; the loopback
    /// address for 0.0.0.0 and [::]].
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) address: Option<SocketAddr>,

    /// Ask only whether it is alive, not whether it is ready.
    #[arg(long)]
    pub(crate) live: bool,

    /// Longest time to wait, in seconds.
    #[arg(long, value_name = "S", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub(crate) timeout_s: u64,
}

/// Print a completion script for a shell.
///
/// Example: cager completions bash > /etc/bash_completion.d/cager
#[derive(Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// The shell.
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// Write the manual pages: cager.1 and one for each command.
///
/// Example: cager man -o /usr/local/share/man/man1
#[derive(Args, Debug)]
pub(crate) struct ManArgs {
    /// Folder for the pages; pages of the same names in it are replaced.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

fn memory(text: &str) -> Result<Memory, String> {
    const MIN_BYTES: u64 = 100_000_000;
    match bytes(text) {
        Some(size) if size >= MIN_BYTES => Ok(Memory::at_most(size)),
        Some(_) => Err("give at least 100MB".to_owned()),
        None => Err("give a size such as 800MB or 2GiB".to_owned()),
    }
}

/// What can be given as the spectrum threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpectrumArg {
    /// So many directions.
    Threshold(usize),
    /// Every direction.
    All,
    /// As many as a bound on the error allows.
    Auto,
}

fn spectrum(text: &str) -> Result<SpectrumArg, String> {
    match text {
        "all" => Ok(SpectrumArg::All),
        "auto" => Ok(SpectrumArg::Auto),
        number => number
            .parse()
            .map(SpectrumArg::Threshold)
            .map_err(|_| "give a whole number of at least 0, all, or auto".to_owned()),
    }
}
