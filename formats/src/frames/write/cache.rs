//! All frames in one file.

use std::io::{self, Write};

use cager_core::mesh::Point;

use super::super::{mdd, npy, pc2};
use super::{Announced, CacheFormat, FrameOptions, FrameWriter, loses_precision};
use crate::atomic::{AtomicFile, Target};
use crate::error::{Error, Fault};

pub(super) struct CacheWriter {
    announced: Announced,
    file: AtomicFile,
    big_endian: bool,
    /// What is added to all positions, in double precision.
    origin: Option<Point>,
    bytes: Vec<u8>,
}

impl CacheWriter {
    pub(super) fn create(
        announced: Announced,
        target: &Target,
        format: CacheFormat,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let Announced { points, frames, .. } = announced;
        if format == CacheFormat::Npy {
            let bytes = if options.origin.is_some() { 8 } else { 4 };
            let mut writer =
                Self::begin(announced, target, false, |file| file.write_all(&npy::header(points, frames, bytes)))?;
            writer.origin = options.origin;
            return Ok(writer);
        }
        if let Some(origin) = options.origin {
            return Err(loses_precision(origin).at(&announced.path));
        }
        let (Ok(points), Ok(frames)) = (i32::try_from(points), i32::try_from(frames)) else {
            let what = format!("cannot count more than {} frames or points; write .npy instead", i32::MAX);
            return Err(Fault::unsupported(what).at(&announced.path));
        };
        if format == CacheFormat::Pc2 {
            return Self::begin(announced, target, false, |file| {
                file.write_all(&pc2::header(points, frames, options.number(0) as f32, options.step() as f32))
            });
        }
        Self::begin(announced, target, true, |file| {
            file.write_all(&mdd::header(points, frames))?;
            let time = |k: i32| (options.number(k as usize) / options.fps) as f32;
            (0..frames).try_for_each(|k| file.write_all(&time(k).to_be_bytes()))
        })
    }

    fn begin(
        announced: Announced,
        target: &Target,
        big_endian: bool,
        header: impl FnOnce(&mut AtomicFile) -> io::Result<()>,
    ) -> Result<Self, Error> {
        let mut file = AtomicFile::create(target)?;
        header(&mut file).map_err(|cause| Error::write(&announced.path, cause))?;
        Ok(Self { announced, file, big_endian, origin: None, bytes: Vec::new() })
    }
}

impl FrameWriter for CacheWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        self.bytes.clear();
        if let Some(origin) = self.origin {
            let moved = positions.iter().zip(origin.iter().cycle()).map(|(&x, o)| f64::from(x) + o);
            self.bytes.extend(moved.flat_map(f64::to_le_bytes));
        } else if self.big_endian {
            self.bytes.extend(positions.iter().flat_map(|x| x.to_be_bytes()));
        } else {
            self.bytes.extend(positions.iter().flat_map(|x| x.to_le_bytes()));
        }
        self.file.write_all(&self.bytes).map_err(|cause| Error::write(&self.announced.path, cause))?;
        self.announced.written += 1;
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        self.file.commit()
    }
}
