//! Frames of a capture on disk as a source for uploads.

use cager_capture::frames::CaptureFiles;
use cager_client::FrameSource;
use cager_formats::{Error, FrameReader};
use std::io;

/// The frames of a capture on disk in single precision: a folder or pattern of mesh files, or a point cache.
pub struct FileFrames {
    files: CaptureFiles,
    frames: u32,
    frame_rate: Option<f64>,
    reader: Box<dyn FrameReader>,
    /// The frame that the reader gives next.
    next: u32,
    wide: Vec<f64>,
}

impl FileFrames {
    /// Opens the frames.
    ///
    /// # Errors
    /// Those of [`CaptureFiles::open`]; more frames than a session can have.
    pub fn open(files: CaptureFiles) -> Result<Self, Error> {
        let reader = files.open()?;
        let Ok(frames) = u32::try_from(reader.frames()) else {
            let what = format!("has {} frames, more than a session can have; split it", reader.frames());
            return Err(Error::Unsupported { path: files.path, what });
        };
        let frame_rate = reader.frame_rate();
        Ok(Self { files, frames, frame_rate, reader, next: 0, wide: Vec::new() })
    }

    /// Frames per second, if the files contain it.
    pub fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    /// The original frame numbers.
    pub fn numbers(&self) -> Vec<f64> {
        (0..self.reader.frames()).map(|frame| self.reader.number(frame)).collect()
    }

    fn read_wide(&mut self) -> io::Result<bool> {
        let more = self.reader.read_next(&mut self.wide).map_err(io::Error::other)?;
        self.next += u32::from(more);
        Ok(more)
    }
}

impl FrameSource for FileFrames {
    fn points(&self) -> usize {
        self.files.points
    }

    fn frames(&self) -> Option<u32> {
        Some(self.frames)
    }

    fn seek(&mut self, frame: u32) -> io::Result<()> {
        if frame < self.next {
            self.reader = self.files.open().map_err(io::Error::other)?;
            self.next = 0;
        }
        // Readers go forward only.
        while self.next < frame && self.read_wide()? {}
        Ok(())
    }

    fn read(&mut self, out: &mut Vec<f32>) -> io::Result<bool> {
        let frame = self.next;
        out.clear();
        if !self.read_wide()? {
            return Ok(false);
        }
        out.extend(self.wide.iter().map(|&x| x as f32));
        match out.iter().position(|x| !x.is_finite()) {
            None => Ok(true),
            Some(at) => Err(io::Error::other(Error::Invalid {
                path: self.files.path.clone(),
                what: format!(
                    "frame {frame}: point {} is too large for single precision, in which frames are sent; scale the \
                     capture down",
                    at / 3
                ),
            })),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_formats::{FrameOptions, create_frames};
    use cager_geometry::mesh::Polygons;

    #[test]
    fn frames_are_read_from_anywhere_in_any_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("f.npy");
        let options = FrameOptions::default();
        let mut writer = create_frames(&path, 2, 5, &Polygons::new(), &options).expect("a cache");
        for frame in 0..5 {
            writer.write_frame(&[frame as f32; 6]).expect("a frame");
        }
        writer.finish().expect("a cache");
        let mut frames = FileFrames::open(CaptureFiles::new(&path, 2)).expect("frames");
        assert_eq!((frames.points(), frames.frames()), (2, Some(5)));
        let mut out = Vec::new();
        for frame in [3, 0, 4, 1, 2, 3] {
            frames.seek(frame).expect("there");
            assert!(frames.read(&mut out).expect("a frame"));
            assert_eq!(out, [frame as f32; 6]);
        }
        frames.seek(5).expect("the end");
        assert!(!frames.read(&mut out).expect("nothing"));
        assert!(FileFrames::open(CaptureFiles::new(&path, 3)).is_err());
    }
}
