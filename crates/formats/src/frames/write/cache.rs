//! All frames in one file.

use std::io::Write;

use cager_geometry::mesh::Point;

use super::super::widen::Scalar;
use super::super::{CacheFormat, mdd, npy, pc2};
use super::maya::Blocks;
use super::output::{Announced, FrameOptions, Output, check_precision};
use crate::atomic::{AtomicFile, Target, commit_together};
use crate::error::{Error, Fault};

pub(super) struct CacheWriter {
    file: AtomicFile,
    scalar: Scalar,
    /// What is added to all positions, in double precision.
    origin: Option<Point>,
    bytes: Vec<u8>,
    /// What a cache of Maya has around the positions of frames, and the text beside it.
    maya: Option<(Blocks, AtomicFile)>,
    /// What is lost.
    notes: Vec<String>,
}

impl CacheWriter {
    pub(super) fn create(
        announced: &Announced,
        target: &Target,
        format: CacheFormat,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let (path, is_double) = (&announced.path, options.origin.is_some());
        let (mut maya, mut notes) = (None, Vec::new());
        let (scalar, header) = match format {
            CacheFormat::Npy => {
                let scalar = if is_double { Scalar::F64Little } else { Scalar::F32Little };
                (scalar, npy::header(announced.points, announced.frames, scalar.size()))
            }
            CacheFormat::Mcx | CacheFormat::Mc => {
                let is_wide = format == CacheFormat::Mcx;
                let blocks = Blocks::new(announced, is_wide, options).map_err(|fault| fault.at(path))?;
                let mut text = AtomicFile::create(target.beside("xml"))?;
                let written = text.write_all(blocks.text(options).as_bytes());
                written.map_err(|cause| Error::write(&path.with_extension("xml"), cause))?;
                let header = blocks.header();
                maya = Some((blocks, text));
                (if is_double { Scalar::F64Big } else { Scalar::F32Big }, header)
            }
            _ => {
                check_precision(options, path)?;
                let (Ok(points), Ok(frames)) = (i32::try_from(announced.points), i32::try_from(announced.frames))
                else {
                    let what = format!("cannot count more than {} frames or points; write .npy instead", i32::MAX);
                    return Err(Fault::unsupported(what).at(path));
                };
                if format == CacheFormat::Mdd {
                    let times = (0..announced.frames).map(|k| (options.number(k) / options.fps) as f32);
                    (Scalar::F32Big, mdd::header(points, frames, times))
                } else {
                    let step = options.even_step();
                    if step.is_none() {
                        notes.push(
                            "holds one distance between all frames, so that these, which are not evenly spaced, \
                             play at other times; .mdd, .mcx, .abc and .usdc keep them"
                                .to_owned(),
                        );
                    }
                    let header = pc2::header(points, frames, options.number(0) as f32, step.unwrap_or(1.0) as f32);
                    (Scalar::F32Little, header)
                }
            }
        };
        let mut file = AtomicFile::create(target)?;
        file.write_all(&header).map_err(|cause| Error::write(path, cause))?;
        Ok(Self { file, scalar, origin: options.origin, bytes: Vec::new(), maya, notes })
    }
}

impl Output for CacheWriter {
    fn write(&mut self, announced: &Announced, positions: &[f32]) -> Result<(), Error> {
        let (bytes, is_moved) = (&mut self.bytes, self.origin.is_some());
        bytes.clear();
        if let Some((blocks, _)) = &self.maya {
            bytes.extend(blocks.before(announced.written));
        }
        let origin = self.origin.unwrap_or_default();
        // Adding zero would turn −0 into 0.
        let moved = |(&x, origin): (&f32, &f64)| if is_moved { f64::from(x) + origin } else { x.into() };
        let values = positions.iter().zip(origin.iter().cycle()).map(moved);
        match self.scalar {
            Scalar::F64Little => bytes.extend(values.flat_map(f64::to_le_bytes)),
            Scalar::F64Big => bytes.extend(values.flat_map(f64::to_be_bytes)),
            Scalar::F32Big => bytes.extend(values.flat_map(|x| (x as f32).to_be_bytes())),
            _ => bytes.extend(values.flat_map(|x| (x as f32).to_le_bytes())),
        }
        if let Some((blocks, _)) = &self.maya {
            bytes.extend(blocks.behind());
        }
        self.file.write_all(bytes).map_err(|cause| Error::write(&announced.path, cause))
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn finish(self: Box<Self>, _: &Announced) -> Result<(), Error> {
        // The cache first, as the text says that it is there.
        commit_together([self.file].into_iter().chain(self.maya.map(|(_, text)| text)).collect())
    }
}
