//! Arguments of `cager decode` other than its files, and of `cager edit`.

use super::checks::up;
use super::coding_args::Unit;
use super::outputs::OutputArgs;
use super::tell;
use anyhow::{Result, bail};
use cager_formats::{FrameRange, Units};
use cager_geometry::units::Up;
use cager_proto::container::MAX_LAYER_NAME;
use clap::{ArgGroup, Args};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// What is decoded, where it is not every frame of the file's own model and cages.
#[derive(Args, Debug)]
pub(crate) struct TransferArgs {
    /// Write the cages instead of the model, and the rest cage with its faces beside them (OUT.cage.obj).
    #[arg(long, conflicts_with_all = ["with_cages", "model"])]
    pub(crate) cages: bool,

    /// Move the model by these cages instead: those of --cages, edited; folder, quoted glob or
    /// numbered name of mesh files, .npy, .pc2, .mdd, .mcx, .abc or .usdc, of any number of frames.
    #[arg(long, value_name = "EDITED")]
    pub(crate) with_cages: Option<PathBuf>,

    /// Keep the cage beside the model, as a second mesh that programs show as a guide and do not
    /// render; .usdc and .usdz alone.
    #[arg(long, conflicts_with = "cages")]
    pub(crate) with_cage: bool,

    /// Move another model instead, which lies in the same rest cage: another resolution, garments,
    /// eyes; .obj .ply .off .stl .glb .abc .usdc.
    #[arg(long, value_name = "OTHER")]
    pub(crate) model: Option<PathBuf>,

    /// Only frame K, counted from 0.
    #[arg(long, value_name = "K", conflicts_with = "range", allow_negative_numbers = true)]
    pub(crate) frame: Option<i64>,

    /// Only frames A to B, both included, every STEP-th; counted from 0.
    #[arg(long, value_name = "A-B[xSTEP]", allow_hyphen_values = true)]
    pub(crate) range: Option<FrameRange>,

    #[command(flatten)]
    pub(crate) meaning: MeaningArgs,
}

/// Unit and axis of what is written.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct MeaningArgs {
    /// Turn positions so that this axis points up, y or z [default: as the file has it; y in glTF].
    #[arg(long, value_name = "AXIS", value_parser = up)]
    pub(crate) up: Option<Up>,

    /// Scale positions to this unit [default: as the file has it; metres in glTF].
    #[arg(long, value_name = "UNIT", value_enum, hide_default_value = true)]
    pub(crate) unit: Option<Unit>,
}

impl MeaningArgs {
    pub(crate) fn units(self) -> Units {
        Units { up: self.up, metres_per_unit: self.unit.map(Unit::metres) }
    }
}

impl TransferArgs {
    /// The frames that are taken of so many in `source`, which have these numbers there; all where none is given.
    pub(crate) fn range(&self, frames: usize, numbers: &[f64], source: &Path) -> Result<Option<FrameRange>> {
        let only = match self.frame.map(|frame| (frame, usize::try_from(frame))) {
            Some((_, Ok(frame))) => Some(FrameRange::only(frame)),
            Some((frame, Err(_))) => bail!(
                "{}: --frame {frame}: frames are counted from 0, and the last one of {frames} is frame {}; give that \
                 number",
                source.display(),
                frames.saturating_sub(1)
            ),
            None => None,
        };
        let range = only.or(self.range);
        let Some(range) = range else { return Ok(None) };
        let number = |frame: usize| numbers.get(frame).copied().unwrap_or(frame as f64);
        range.check(frames, number, source)?;
        if let Some(note) = range.numbered(number) {
            tell(&format!("{}: {note}\n", source.display()))?;
        }
        Ok(Some(range))
    }
}

/// Add edited cages to a .cager file as a layer, or take layers back, switch them and write them into the cages.
///
/// `cager decode --cages` writes the cages to edit. A layer says by how much vertices of the cage
/// are moved in which frames; all else in the file stays as it is, details beside the cages too, so
/// that a layer can be taken back. Example: cager edit walk.cager --with-cages edited.npy --name
/// smile -o edited.cager
#[derive(Args, Debug)]
#[command(group = ArgGroup::new("what").required(true).multiple(true).args(["with_cages", "flatten", "remove", "on", "off", "up", "unit"]))]
pub(crate) struct EditArgs {
    /// File to read.
    #[arg(value_name = "IN.cager")]
    pub(crate) input: PathBuf,

    /// Edited cages: folder, quoted glob or numbered name of mesh files, .npy, .pc2, .mdd, .mcx,
    /// .abc or .usdc. Of another number of frames than the file has, they take the place of all its
    /// frames.
    #[arg(long, value_name = "EDITED")]
    pub(crate) with_cages: Option<PathBuf>,

    /// What the layer is called, in at most 256 bytes.
    #[arg(long, requires = "with_cages", conflicts_with = "flatten", value_parser = layer_name)]
    pub(crate) name: Option<String>,

    /// Take only frames A to B of the file, both included, counted from 0; EDITED has all frames, or these.
    #[arg(long, value_name = "A-B", requires = "with_cages", allow_hyphen_values = true)]
    pub(crate) frames_range: Option<FrameRange>,

    /// Write the layers that are on into the cages, and none beside them.
    #[arg(long)]
    pub(crate) flatten: bool,

    /// Take back the last layer, the one with this number (from 1), or all.
    #[arg(long, value_name = "LAYER|all", num_args = 0..=1, default_missing_value = "last",
          conflicts_with_all = ["with_cages", "flatten", "on", "off"])]
    pub(crate) remove: Option<LayerChoice>,

    /// Switch the layer with this number on.
    #[arg(long, value_name = "LAYER", conflicts_with_all = ["with_cages", "flatten"])]
    pub(crate) on: Option<usize>,

    /// Switch the layer with this number off: it is kept and not applied.
    #[arg(long, value_name = "LAYER", conflicts_with_all = ["with_cages", "flatten"])]
    pub(crate) off: Option<usize>,

    /// The axis that points up in EDITED, y or z, where its file does not say it: it is turned to
    /// that of IN. Without --with-cages, the one in IN, which keeps it.
    #[arg(long, value_name = "AXIS", value_parser = up, conflicts_with_all = ["flatten", "remove", "on", "off"])]
    pub(crate) up: Option<Up>,

    /// The unit of EDITED, where its file does not say it: it is scaled to that of IN. Without
    /// --with-cages, the one of IN, which keeps it.
    #[arg(long, value_name = "UNIT", value_enum, conflicts_with_all = ["flatten", "remove", "on", "off"])]
    pub(crate) unit: Option<Unit>,

    /// File to write, or - for standard output; it appears whole or not at all. With --overwrite it may be IN.cager.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,
}

impl EditArgs {
    pub(crate) fn units(&self) -> Units {
        MeaningArgs { up: self.up, unit: self.unit }.units()
    }
}

/// Layers that are taken back.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LayerChoice {
    Last,
    Number(usize),
    All,
}

impl FromStr for LayerChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "last" => Ok(Self::Last),
            "all" => Ok(Self::All),
            number => number
                .parse()
                .map(Self::Number)
                .map_err(|_| "is no layer; give the number that `cager inspect` shows, or all".to_owned()),
        }
    }
}

fn layer_name(text: &str) -> Result<String, String> {
    let fits = text.len() <= MAX_LAYER_NAME;
    fits.then(|| text.to_owned()).ok_or_else(|| format!("has {} bytes, more than {MAX_LAYER_NAME}", text.len()))
}
