//! Sections of whole numbers: meshes, groups of cages and what is added to their positions, by the `cager-codec` crate.

use super::codec::CODED;
use super::contents::Entry;
use super::reader::ContainerReader;
use super::section::SectionHeader;
use super::{Error, tag};
use cager_codec::{
    CageBasis, Hierarchy, MOST_ROWS, Residual, decode_cages, decode_faces, decode_positions, is_rotated,
};
use cager_core::cage::Cage;
use cager_core::coordinates::{self, ElementPlan, supports_definition};
use cager_core::mesh::{Point, Polygons};
use std::io::{Read, Seek};

/// What decoding groups needs, computed where the first is read.
#[derive(Default)]
pub(super) struct Groups {
    basis: Option<CageBasis>,
    hierarchy: Option<Hierarchy>,
    /// The residual decoded last, by its first frame.
    residual: Option<(usize, Residual)>,
}

/// The bytes of a section.
pub(super) struct CodedSection {
    pub(super) offset: u64,
    payload: Vec<u8>,
}

impl CodedSection {
    pub(super) fn faces(&self, points: usize, count: usize, corners: usize) -> Result<Polygons, Error> {
        decode_faces(&self.payload, points, count, corners).map_err(|e| self.damaged(&e))
    }

    pub(super) fn positions(&self, faces: &Polygons, count: usize) -> Result<Vec<Point>, Error> {
        let points = decode_positions(&self.payload, faces, count).map_err(|e| self.damaged(&e))?;
        match points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            Some(k) => Err(Error::corrupt(self.offset, format!("position {k} is not finite"))),
            None => Ok(points),
        }
    }

    fn damaged(&self, error: &cager_codec::Error) -> Error {
        Error::corrupt(self.offset, error.to_string())
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// A section's bytes where it is coded.
    pub(super) fn coded(&mut self, tag: [u8; 4]) -> Result<Option<CodedSection>, Error> {
        let entry = self.entry(tag)?;
        if entry.header.codec == CODED { self.coded_entry(entry).map(Some) } else { Ok(None) }
    }

    fn coded_entry(&mut self, entry: Entry) -> Result<CodedSection, Error> {
        self.check_limit(entry)?;
        Ok(CodedSection { offset: entry.offset, payload: self.payload(entry)? })
    }

    /// Faces are decoded before the positions that say how many points there can be.
    pub(super) fn limit_points(&self, tag: [u8; 4]) -> Result<(), Error> {
        self.check_limit(self.entry(tag)?)
    }

    /// The cages of a coded group, as the bytes of an uncoded one.
    pub(super) fn group(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        let section = self.coded_entry(entry)?;
        let rotated = is_rotated(&section.payload).map_err(|e| section.damaged(&e))?;
        if self.groups.basis.as_ref().is_none_or(|basis| basis.rotated() != rotated) {
            self.groups.basis = Some(self.basis(&section, rotated)?);
        }
        let Some(basis) = &self.groups.basis else {
            return Err(Error::corrupt(entry.offset, "a group without a basis"));
        };
        let frames = entry.header.count as usize;
        let cages = decode_cages(basis, frames, &section.payload).map_err(|e| section.damaged(&e))?;
        Ok(cages.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
    }

    fn basis(&mut self, section: &CodedSection, rotated: bool) -> Result<CageBasis, Error> {
        let header = self.header().clone();
        let unsupported = |what: String| Error::UnknownSection(what);
        let Some(system) = coordinates::by_name(&header.coordinates) else {
            return Err(unsupported(format!("coordinates {}", header.coordinates)));
        };
        if !supports_definition(header.coordinates_definition) {
            return Err(unsupported(format!("coordinates of definition {}", header.coordinates_definition)));
        }
        let corrupt = |what: String| Error::corrupt(section.offset, what);
        let points = self.rest()?.points;
        let cage = Cage::new(self.cage()?).map_err(|e| corrupt(e.to_string()))?;
        if system.unknowns(&cage) != header.rows_per_frame as usize || system.unknowns(&cage) > MOST_ROWS {
            return Err(corrupt(format!("a frame has {} rows", header.rows_per_frame)));
        }
        let plan = self.elements()?.map(ElementPlan::from_bytes);
        CageBasis::of(system, &cage, &points, plan.as_ref(), Some(rotated))
            .map_err(|e| corrupt(e.to_string()))?
            .ok_or_else(|| corrupt("the coordinates have no basis".to_owned()))
    }

    /// Whether the file holds more of the positions than its cages say.
    pub fn has_residual(&self) -> bool {
        self.sections_of(tag::RESIDUAL).next().is_some()
    }

    /// Adds what the cages of these frames leave of their positions, points × 3 each; nothing where the file has none of it.
    ///
    /// # Errors
    /// A frame that does not exist; damage.
    pub fn add_residual(&mut self, frames: &[usize], positions: &mut [Vec<f32>]) -> Result<(), Error> {
        let mut done = 0;
        while let Some(&frame) = frames.get(done) {
            let Some(entry) = self.load_residual(frame)? else {
                done += 1;
                continue;
            };
            let first = entry.header.first as usize;
            let follows = |k: usize| frames[k] == frame + (k - done) && covers(&entry.header, frames[k]);
            let end = (done + 1..frames.len()).find(|&k| !follows(k)).unwrap_or(frames.len());
            if let Some((_, residual)) = &self.groups.residual {
                residual.add(frame - first, &mut positions[done..end]);
            }
            done = end;
        }
        Ok(())
    }

    /// Decodes the residual of a frame's group, if there is one.
    pub(super) fn load_residual(&mut self, frame: usize) -> Result<Option<Entry>, Error> {
        let found = self.sections_of(tag::RESIDUAL).find(|entry| covers(&entry.header, frame));
        let Some(entry) = found else { return Ok(None) };
        let first = entry.header.first as usize;
        if self.groups.residual.as_ref().is_none_or(|(of, _)| *of != first) {
            self.groups.residual = None;
            self.groups.residual = Some((first, self.residual(entry)?));
        }
        Ok(Some(entry))
    }

    fn residual(&mut self, entry: Entry) -> Result<Residual, Error> {
        if self.groups.hierarchy.is_none() {
            let rest = self.rest()?;
            self.groups.hierarchy = Some(Hierarchy::new(&rest.faces, rest.points.len()));
        }
        let section = CodedSection { offset: entry.offset, payload: self.payload(entry)? };
        let Some(hierarchy) = &self.groups.hierarchy else { return Err(Error::corrupt(entry.offset, "no mesh")) };
        let most = most_residual_numbers(self.file_bytes);
        Residual::decode(hierarchy, entry.header.count as usize, &section.payload, most)
            .map_err(|e| section.damaged(&e))
    }

    /// Reads every residual.
    pub(super) fn verify_residuals(&mut self) -> Result<(), Error> {
        let entries: Vec<Entry> = self.sections_of(tag::RESIDUAL).collect();
        for entry in entries {
            self.residual(entry)?;
        }
        Ok(())
    }
}

/// Most numbers of a residual's components in a file of so many bytes: what reading them takes four times.
pub fn most_residual_numbers(file_bytes: u64) -> usize {
    (1usize << 26).saturating_add(usize::try_from(file_bytes).unwrap_or(usize::MAX).saturating_mul(64))
}

fn covers(header: &SectionHeader, frame: usize) -> bool {
    let first = header.first as usize;
    (first..first + header.count as usize).contains(&frame)
}
