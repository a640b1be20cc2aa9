//! All frames in one file.

use std::io::{self, Write};

use cager_geometry::mesh::{Point, Polygons};

use super::super::CacheFormat;
use super::super::{mdd, npy, pc2};
use super::maya::{Blocks, ticks};
use super::output::{Announced, FrameOptions, FrameWriter, check_precision};
use super::scene::name;
use crate::atomic::{AtomicFile, Target, commit_together};
use crate::error::{Error, Fault};

pub(super) struct CacheWriter {
    announced: Announced,
    file: AtomicFile,
    numbers: Numbers,
    /// What is added to all positions, in double precision.
    origin: Option<Point>,
    bytes: Vec<u8>,
    /// What a cache of Maya has around the positions of frames, and the text beside it.
    maya: Option<(Blocks, AtomicFile)>,
    /// What is lost.
    note: Option<String>,
}

/// How positions are stored.
enum Numbers {
    Single,
    SingleBigEndian,
    Double,
    DoubleBigEndian,
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
            let (numbers, bytes) = if options.origin.is_some() { (Numbers::Double, 8) } else { (Numbers::Single, 4) };
            let header = npy::header(points, frames, bytes);
            return Self::begin(announced, target, (numbers, options.origin), |file| file.write_all(&header));
        }
        if matches!(format, CacheFormat::Mcx | CacheFormat::Mc) {
            return Self::create_maya(announced, target, format == CacheFormat::Mcx, options);
        }
        check_precision(options, &announced.path)?;
        let (Ok(points), Ok(frames)) = (i32::try_from(points), i32::try_from(frames)) else {
            let what = format!("cannot count more than {} frames or points; write .npy instead", i32::MAX);
            return Err(Fault::unsupported(what).at(&announced.path));
        };
        if format == CacheFormat::Pc2 {
            let lost = options.even_step().is_none().then(|| {
                format!(
                    "{}: holds one distance between all frames, so that these, which are not evenly spaced, play at other times; .mdd, .mcx, .abc and .usdc keep them",
                    announced.path.display()
                )
            });
            let writer = Self::begin(announced, target, (Numbers::Single, options.origin), |file| {
                file.write_all(&pc2::header(
                    points,
                    frames,
                    options.number(0) as f32,
                    options.even_step().unwrap_or(1.0) as f32,
                ))
            })?;
            return Ok(Self { note: lost, ..writer });
        }
        Self::begin(announced, target, (Numbers::SingleBigEndian, options.origin), |file| {
            file.write_all(&mdd::header(points, frames))?;
            let time = |k: i32| (options.number(k as usize) / options.fps) as f32;
            (0..frames).try_for_each(|k| file.write_all(&time(k).to_be_bytes()))
        })
    }

    fn create_maya(
        announced: Announced,
        target: &Target,
        is_wide: bool,
        options: &FrameOptions,
    ) -> Result<Self, Error> {
        let Announced { path, points, frames, .. } = &announced;
        if !is_wide && *points > i32::MAX as usize / 24 {
            let what = "cannot hold so many points, as its blocks have no room for more than 2 GiB; write .mcx instead";
            return Err(Fault::unsupported(what).at(path));
        }
        let (ticks, is_double) = (ticks(*frames, options).map_err(|fault| fault.at(path))?, options.origin.is_some());
        let name = format!("{}Shape", name(path));
        let blocks = Blocks { is_wide, name, points: *points as u32, is_double, ticks };
        let beside = path.with_extension("xml");
        let target_beside = if target.replaces() { Target::Replacing(beside) } else { Target::New(beside) };
        let mut text = AtomicFile::create(&target_beside)?;
        let written = text.write_all(blocks.text(options).as_bytes());
        written.map_err(|cause| Error::write(target_beside.path(), cause))?;
        let numbers = if is_double { Numbers::DoubleBigEndian } else { Numbers::SingleBigEndian };
        let header = blocks.header();
        let writer = Self::begin(announced, target, (numbers, options.origin), |file| file.write_all(&header))?;
        Ok(Self { maya: Some((blocks, text)), ..writer })
    }

    fn begin(
        announced: Announced,
        target: &Target,
        (numbers, origin): (Numbers, Option<Point>),
        header: impl FnOnce(&mut AtomicFile) -> io::Result<()>,
    ) -> Result<Self, Error> {
        let mut file = AtomicFile::create(target)?;
        header(&mut file).map_err(|cause| Error::write(&announced.path, cause))?;
        Ok(Self { announced, file, numbers, origin, bytes: Vec::new(), maya: None, note: None })
    }
}

impl FrameWriter for CacheWriter {
    fn write_frame(&mut self, positions: &[f32]) -> Result<(), Error> {
        self.announced.admit(positions)?;
        self.bytes.clear();
        if let Some((blocks, _)) = &self.maya {
            self.bytes.extend(blocks.before(self.announced.written));
        }
        let moved: Option<Vec<f64>> = self
            .origin
            .map(|origin| positions.iter().zip(origin.iter().cycle()).map(|(&x, o)| f64::from(x) + o).collect());
        let singles: Option<Vec<f32>> = moved.as_ref().map(|moved| moved.iter().map(|&x| x as f32).collect());
        let singles = singles.as_deref().unwrap_or(positions);
        match self.numbers {
            Numbers::Single => self.bytes.extend(singles.iter().flat_map(|x| x.to_le_bytes())),
            Numbers::SingleBigEndian => self.bytes.extend(singles.iter().flat_map(|x| x.to_be_bytes())),
            Numbers::Double => self.bytes.extend(moved.iter().flatten().flat_map(|x| x.to_le_bytes())),
            Numbers::DoubleBigEndian => self.bytes.extend(moved.iter().flatten().flat_map(|x| x.to_be_bytes())),
        }
        if let Some((blocks, _)) = &self.maya {
            self.bytes.extend(blocks.behind());
        }
        self.file.write_all(&self.bytes).map_err(|cause| Error::write(&self.announced.path, cause))?;
        self.announced.written += 1;
        Ok(())
    }

    fn notes(&self) -> Vec<String> {
        self.note.iter().cloned().collect()
    }

    fn change_mesh(&mut self, _: usize, _: &Polygons, _: &FrameOptions) -> Result<(), Error> {
        Err(self.announced.one_mesh())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        self.announced.check_complete()?;
        // The cache first, as the text says that it is there.
        commit_together([self.file].into_iter().chain(self.maya.map(|(_, text)| text)).collect())
    }
}
