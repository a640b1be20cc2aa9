//! Arguments of `cager decode` for morph targets.

use cager_formats::{CacheFormat, MorphOptions};
use clap::Args;
use std::path::Path;

/// How a .glb holds frames: as morph targets, which are the principal components of all frames.
#[derive(Args, Debug)]
pub(crate) struct MorphArgs {
    /// Morph targets of a .glb at the most; what they lose is told [default: 64, or 255 with --max-error].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(1..), hide_default_value = true,
          conflicts_with = "cages")]
    targets: Option<u8>,

    /// As few morph targets of a .glb as keep every point of every frame within E, a fraction of
    /// the rest pose's diagonal.
    #[arg(long, value_name = "E", value_parser = share, allow_negative_numbers = true, conflicts_with = "cages")]
    max_error: Option<f64>,

    /// Positions of a .glb as floats instead of whole numbers of 16 bits (KHR_mesh_quantization):
    /// larger, and more exact.
    #[arg(long, conflicts_with = "cages")]
    float: bool,

    /// Normals in a .glb as well, of the mean shape and of each morph target: smooth shading, and
    /// 12 bytes more for each point of them.
    #[arg(long, conflicts_with = "cages")]
    normals: bool,
}

impl MorphArgs {
    /// Refuses what another file than a .glb would ignore.
    pub(super) fn check(&self, output: &Path) -> anyhow::Result<()> {
        let asked = [
            ("--targets", self.targets.is_some()),
            ("--max-error", self.max_error.is_some()),
            ("--float", self.float),
            ("--normals", self.normals),
        ];
        let is_gltf = || matches!(CacheFormat::from_path(output), Some(CacheFormat::Glb | CacheFormat::Gltf));
        match asked.into_iter().find(|(_, is_given)| *is_given) {
            Some((name, _)) if !is_gltf() => {
                anyhow::bail!("{name} is for a .glb, and {} is none; leave it out, or write a .glb", output.display())
            }
            _ => Ok(()),
        }
    }

    pub(super) fn options(&self) -> MorphOptions {
        MorphOptions {
            targets: self.targets.map(usize::from),
            max_error: self.max_error,
            is_guarantee: false,
            diagonal: None,
            floats: self.float,
            normals: self.normals,
        }
    }
}

fn share(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|share: &f64| share.is_finite() && *share > 0.0);
    found.ok_or_else(|| "give a positive fraction of the diagonal, such as 0.001".to_owned())
}
