//! Arguments of `cager decode` other than its files, and of `cager edit`.

use super::outputs::OutputArgs;
use super::tell;
use anyhow::{Result, bail};
use cager_formats::FrameRange;
use clap::Args;
use std::path::{Path, PathBuf};

/// What is decoded, where it is not every frame of the file's own model and cages.
#[derive(Args, Debug)]
pub(crate) struct TransferArgs {
    /// Write the cages instead of the model, and the rest cage with its faces beside them (OUT.cage.obj).
    #[arg(long, conflicts_with_all = ["with_cages", "model"])]
    pub(crate) cages: bool,

    /// Move the model by these cages instead: those of --cages, edited; folder, quoted glob or numbered name of mesh files, .npy,
    /// .pc2, .mdd, .mcx, .abc or .usdc, of any number of frames.
    #[arg(long, value_name = "EDITED")]
    pub(crate) with_cages: Option<PathBuf>,

    /// Keep the cage beside the model, as a second mesh that programs show as a guide and do not render; .usdc and .usdz alone.
    #[arg(long, conflicts_with = "cages")]
    pub(crate) with_cage: bool,

    /// Move another model instead, which lies in the same rest cage: another resolution, garments, eyes; .obj .ply .off .stl .glb .abc .usdc.
    #[arg(long, value_name = "OTHER")]
    pub(crate) model: Option<PathBuf>,

    /// Only frame K, counted from 0.
    #[arg(long, value_name = "K", conflicts_with = "range", allow_negative_numbers = true)]
    pub(crate) frame: Option<i64>,

    /// Only frames A to B, both included, every STEP-th; counted from 0.
    #[arg(long, value_name = "A-B[xSTEP]", allow_hyphen_values = true)]
    pub(crate) range: Option<FrameRange>,
}

impl TransferArgs {
    /// The frames that are taken of so many in `source`, which have these numbers there; all where none is given.
    pub(crate) fn range(&self, frames: usize, numbers: &[f64], source: &Path) -> Result<Option<FrameRange>> {
        let only = match self.frame.map(|frame| (frame, usize::try_from(frame))) {
            Some((_, Ok(frame))) => Some(FrameRange::only(frame)),
            Some((frame, Err(_))) => bail!(
                "{}: --frame {frame}: frames are counted from 0, and the last one of {frames} is frame {}; give that number",
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

/// Write a .cager file again with edited cages.
///
/// `cager decode --cages` writes the cages to edit. Errors of the frames that changed are not measured: the capture is not there.
/// Example: cager edit walk.cager --with-cages edited.npy -o edited.cager
#[derive(Args, Debug)]
pub(crate) struct EditArgs {
    /// File to read.
    #[arg(value_name = "IN.cager")]
    pub(crate) input: PathBuf,

    /// Edited cages: folder, quoted glob or numbered name of mesh files, .npy, .pc2, .mdd, .mcx, .abc or .usdc, of any number of frames.
    #[arg(long, value_name = "EDITED")]
    pub(crate) with_cages: PathBuf,

    /// File to write, or - for standard output; it appears whole or not at all.
    #[arg(short, long, value_name = "OUT.cager")]
    pub(crate) output: PathBuf,

    #[command(flatten)]
    pub(crate) outputs: OutputArgs,
}
