//! What a geometry cache of Maya has beside positions, and the text that Maya opens it by.

use super::super::maya::{EXACT_RATE, TICKS};
use super::output::{Announced, FrameOptions};
use super::scene::name;
use crate::error::Fault;

/// Header and blocks of a cache of one channel.
pub(super) struct Blocks {
    /// Whether sizes have 64 bits, as in `.mcx`.
    is_wide: bool,
    /// The channel, as Maya calls the shape.
    name: String,
    points: u32,
    /// Whether positions are in double precision.
    is_double: bool,
    /// When frames are.
    ticks: Vec<i32>,
}

impl Blocks {
    pub(super) fn new(announced: &Announced, is_wide: bool, options: &FrameOptions) -> Result<Self, Fault> {
        let Announced { path, points, frames, .. } = announced;
        if !is_wide && *points > i32::MAX as usize / 24 {
            let what = "cannot hold so many points, as its blocks have no room for more than 2 GiB; write .mcx instead";
            return Err(Fault::unsupported(what));
        }
        let (ticks, name) = (ticks(*frames, options)?, format!("{}Shape", name(path)));
        Ok(Self { is_wide, name, points: *points as u32, is_double: options.origin.is_some(), ticks })
    }

    pub(super) fn header(&self) -> Vec<u8> {
        let chunks = [self.chunk(b"VRSN", b"0.1\0"), self.chunk(b"STIM", &[0; 4]), self.chunk(b"ETIM", &[0, 0, 0, 1])];
        self.group(b"CACH", &chunks.concat(), 0)
    }

    /// What comes before the positions of a frame.
    pub(super) fn before(&self, frame: usize) -> Vec<u8> {
        let chunks = [
            self.chunk(b"TIME", &self.ticks[frame].to_be_bytes()),
            self.chunk(b"CHNM", format!("{}\0", self.name).as_bytes()),
            self.chunk(b"SIZE", &self.points.to_be_bytes()),
            self.head(if self.is_double { b"DVCA" } else { b"FVCA" }, self.size()),
        ];
        self.group(b"MYCH", &chunks.concat(), self.size() + self.padding(self.size()).len())
    }

    /// What comes behind them.
    pub(super) fn behind(&self) -> &'static [u8] {
        self.padding(self.size())
    }

    /// Bytes of the positions of a frame.
    fn size(&self) -> usize {
        self.points as usize * if self.is_double { 24 } else { 12 }
    }

    fn padding(&self, size: usize) -> &'static [u8] {
        &[0; 8][..size.next_multiple_of(if self.is_wide { 8 } else { 4 }) - size]
    }

    fn group(&self, kind: &[u8], chunks: &[u8], more: usize) -> Vec<u8> {
        let tag = if self.is_wide { b"FOR8" } else { b"FOR4" };
        [&self.head(tag, kind.len() + chunks.len() + more), kind, chunks].concat()
    }

    fn chunk(&self, tag: &[u8; 4], payload: &[u8]) -> Vec<u8> {
        [&self.head(tag, payload.len()), payload, self.padding(payload.len())].concat()
    }

    fn head(&self, tag: &[u8; 4], size: usize) -> Vec<u8> {
        let size = (size as u64).to_be_bytes();
        if self.is_wide { [tag, &[0; 4], &size[..]].concat() } else { [tag, &size[4..]].concat() }
    }

    pub(super) fn text(&self, options: &FrameOptions) -> String {
        let ticks_of = |frames: f64| (frames * TICKS / options.fps).round().max(1.0);
        let rate = options.fps;
        let (name, first, last) = (&self.name, self.ticks[0], self.ticks[self.ticks.len() - 1]);
        let (frame, step) = (ticks_of(1.0), ticks_of(options.even_step().unwrap_or(1.0)));
        let sampling = if options.even_step().is_some() { "Regular" } else { "Irregular" };
        let kind = if self.is_double { "Double" } else { "Float" };
        let format = if self.is_wide { "mcx" } else { "mcc" };
        format!(
            r#"<?xml version="1.0"?>
<Autodesk_Cache_File>
  <cacheType Type="OneFile" Format="{format}"/>
  <time Range="{first}-{last}"/>
  <cacheTimePerFrame TimePerFrame="{frame}"/>
  <cacheVersion Version="2.0"/>
  {EXACT_RATE}{rate:?}</extra>
  <Channels>
    <channel0 ChannelName="{name}" ChannelType="{kind}VectorArray" ChannelInterpretation="positions" SamplingType="{sampling}" SamplingRate="{step}" StartTime="{first}" EndTime="{last}"/>
  </Channels>
</Autodesk_Cache_File>
"#
        )
    }
}

/// The times of frames, which Maya counts in whole ticks.
fn ticks(frames: usize, options: &FrameOptions) -> Result<Vec<i32>, Fault> {
    let all: Vec<f64> = (0..frames).map(|frame| (options.number(frame) * TICKS / options.fps).round()).collect();
    if all.iter().any(|tick| tick.abs() > f64::from(i32::MAX)) || all.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(Fault::unsupported(
            "counts times in 6000ths of a second up to four days, which cannot tell these frames apart; give another \
             --fps or --start, or write .abc",
        ));
    }
    Ok(all.into_iter().map(|tick| tick as i32).collect())
}
