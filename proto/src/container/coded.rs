//! Sections of whole numbers by `cager-codec`: groups of cages, and their residuals.

use super::reader::ContainerReader;
use super::section::{CODED, CODED_STATIC, Entry};
use super::{Error, tag};
use cager_codec::{BasisRecord, CageBasis, Hierarchy, MAX_ROWS, Residual, basis_record, decode_cages};
use cager_core::cage::Cage;
use cager_core::coordinates::{self, CoordinateSystem, Coordinates, DEFINITION, ElementPlan};
use cager_geometry::mesh::Point;
use std::io::{Read, Seek};
use std::ops::Range;

/// What the basis of coded cages is computed from.
struct Binding {
    system: &'static dyn CoordinateSystem,
    cage: Cage,
    points: Vec<Point>,
    plan: Option<ElementPlan>,
    offset: u64,
}

impl Binding {
    fn basis(&self, record: &BasisRecord) -> Result<(CageBasis, Option<Coordinates>), Error> {
        let corrupt = |what: String| Error::corrupt(self.offset, what);
        CageBasis::of(self.system, &self.cage, &self.points, self.plan.as_ref(), Some(record))
            .map_err(|e| corrupt(e.to_string()))?
            .ok_or_else(|| corrupt("the coordinates have no basis".to_owned()))
    }
}

/// A section of whole numbers.
pub(super) struct CodedSection {
    pub(super) entry: Entry,
    payload: Vec<u8>,
}

impl CodedSection {
    pub(super) fn decode<T>(&self, decode: impl FnOnce(&[u8]) -> Result<T, cager_codec::Error>) -> Result<T, Error> {
        decode(&self.payload).map_err(|error| Error::corrupt(self.entry.offset, error.to_string()))
    }

    fn residual(&self, hierarchy: &Hierarchy, most: usize) -> Result<(Entry, Residual), Error> {
        let frames = self.entry.header.count as usize;
        Ok((self.entry, self.decode(|bytes| Residual::decode(hierarchy, frames, bytes, most))?))
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// The section of a mesh or of errors where it is coded.
    pub(super) fn coded(&mut self, tag: [u8; 4]) -> Result<Option<CodedSection>, Error> {
        let entry = self.entry(tag)?;
        if entry.header.codec == CODED_STATIC { self.coded_section(entry).map(Some) } else { Ok(None) }
    }

    fn coded_section(&mut self, entry: Entry) -> Result<CodedSection, Error> {
        self.check_limit(entry)?;
        Ok(CodedSection { entry, payload: self.payload(entry)? })
    }

    /// The cages of a coded group, as the bytes of an uncoded one.
    pub(super) fn group(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        let section = self.coded_section(entry)?;
        let record = section.decode(basis_record)?;
        if self.groups.basis(&record).is_none() {
            if !self.groups.may_begin() {
                return Err(Error::corrupt(entry.offset, "the groups have too many bases"));
            }
            let basis = self.binding(entry.offset)?.basis(&record)?.0;
            self.groups.keep_basis(basis);
        }
        let Some(basis) = self.groups.basis(&record) else {
            return Err(Error::corrupt(entry.offset, "a group without a basis"));
        };
        let frames = entry.header.count as usize;
        let cages = section.decode(|bytes| decode_cages(basis, frames, bytes))?;
        Ok(cages.iter().flatten().flat_map(|x| x.to_le_bytes()).collect())
    }

    fn binding(&mut self, offset: u64) -> Result<Binding, Error> {
        let header = self.header().clone();
        let unsupported = |what: String| Error::UnknownSection(what);
        let Some(system) = coordinates::by_name(&header.coordinates) else {
            return Err(unsupported(format!("coordinates {}", header.coordinates)));
        };
        if header.coordinates_definition != DEFINITION {
            return Err(unsupported(format!("coordinates of definition {}", header.coordinates_definition)));
        }
        let corrupt = |what: String| Error::corrupt(offset, what);
        let points = self.rest()?.points;
        let cage = self.checked_cage()?;
        let rows = system.values(&cage).unknowns();
        if rows != header.rows_per_frame as usize || rows > MAX_ROWS {
            return Err(corrupt(format!("a frame has {} rows", header.rows_per_frame)));
        }
        let plan = self.elements()?.map(ElementPlan::from_bytes);
        // Computed before any of it is taken.
        let needed =
            system.working_bytes(&cage, plan.as_ref()).saturating_add(basis_bytes(system, &cage, points.len()));
        if needed > self.coordinates_bytes {
            return Err(Error::Memory { needed, most: self.coordinates_bytes });
        }
        Ok(Binding { system, cage, points, plan, offset })
    }

    /// Decodes what a frame of a coded file needs before its cage is read, the coordinates of the
    /// model beside the residual of its group. Returns the coordinates where the basis of the cages
    /// took all points; binding the model reports why there are none.
    pub fn read_ahead(&mut self, frame: usize) -> Result<Option<Coordinates>, Error> {
        let entry = self.chunk_of(frame)?;
        if entry.header.codec != CODED {
            return Ok(None);
        }
        let record = self.coded_section(entry)?.decode(basis_record)?;
        let Ok(binding) = self.binding(entry.offset) else { return Ok(None) };
        let section = self.residual_entry(frame).map(|entry| self.coded_section(entry)).transpose()?;
        let most = most_residual_numbers(self.file_bytes);
        // Two of them would be more than a reader may take.
        self.groups.residuals.clear();
        let faces = self.rest()?.faces;
        let points = binding.points.len();
        let (basis, residual) = rayon::join(
            || binding.basis(&record),
            || {
                section.map(|section| {
                    let hierarchy = Hierarchy::new(&faces, points);
                    section.residual(&hierarchy, most).map(|residual| (hierarchy, residual))
                })
            },
        );
        let Ok((basis, coordinates)) = basis else { return Ok(None) };
        self.groups.keep_basis(basis);
        if let Some((hierarchy, residual)) = residual.transpose()? {
            self.groups.hierarchy = Some(hierarchy);
            self.groups.residuals = vec![residual];
        }
        Ok(coordinates.filter(|found| found.phi.nrows() == points))
    }

    /// Whether the file holds more of the positions than its cages say.
    pub fn has_residual(&self) -> bool {
        self.sections_of(tag::RESIDUAL).next().is_some()
    }

    /// Adds the residual, if there is one, to the positions of these frames, points × 3 each.
    pub fn add_residual(&mut self, frames: &[usize], positions: &mut [Vec<f32>]) -> Result<(), Error> {
        let mut done = 0;
        while let Some(&frame) = frames.get(done) {
            let first = done;
            done += 1;
            let Some(entry) = self.load_residual(frame)? else { continue };
            let group = entry.header.frames();
            while frames.get(done).is_some_and(|&next| next == frame + (done - first) && group.contains(&next)) {
                done += 1;
            }
            if let Some((_, residual)) = self.groups.residuals.iter().find(|(of, _)| of.offset == entry.offset) {
                residual.add(frame - group.start, &mut positions[first..done]);
            }
        }
        Ok(())
    }

    /// It comes right before the frames that it belongs to.
    fn residual_entry(&self, frame: usize) -> Option<Entry> {
        let before = self.place_of(frame)?.checked_sub(1)?;
        self.entries.get(before).filter(|entry| entry.header.tag == tag::RESIDUAL).copied()
    }

    /// Decodes the residual of a frame's group, if there is one.
    pub(super) fn load_residual(&mut self, frame: usize) -> Result<Option<Entry>, Error> {
        let Some(entry) = self.residual_entry(frame) else { return Ok(None) };
        if self.groups.residuals.iter().all(|(of, _)| of.offset != entry.offset) {
            // A caller that goes on from group to group is likely to read the next one too.
            let Range { start, end } = entry.header.frames();
            let goes_on = self.groups.residuals.last().is_some_and(|(last, _)| last.header.frames().end == start);
            self.groups.residuals.clear();
            let section = self.coded_section(entry)?;
            // Damage there is told when it is its turn.
            let after = self.residual_entry(end).filter(|_| goes_on).and_then(|entry| self.coded_section(entry).ok());
            let most = most_residual_numbers(self.file_bytes);
            let hierarchy = self.hierarchy()?;
            let (residual, after) = rayon::join(
                || section.residual(hierarchy, most),
                || after?.residual(hierarchy, most.min(MAX_AHEAD)).ok(),
            );
            self.groups.residuals.push(residual?);
            self.groups.residuals.extend(after);
        }
        Ok(Some(entry))
    }

    fn hierarchy(&mut self) -> Result<&Hierarchy, Error> {
        let made = match self.groups.hierarchy.take() {
            Some(hierarchy) => hierarchy,
            None => {
                let rest = self.rest()?;
                Hierarchy::new(&rest.faces, rest.points.len())
            }
        };
        Ok(self.groups.hierarchy.insert(made))
    }

    /// Reads every residual.
    pub(super) fn verify_residuals(&mut self) -> Result<(), Error> {
        let entries: Vec<Entry> = self.sections_of(tag::RESIDUAL).collect();
        let most = most_residual_numbers(self.file_bytes);
        for entry in entries {
            self.coded_section(entry)?.residual(self.hierarchy()?, most)?;
        }
        Ok(())
    }
}

/// Bytes that a basis takes: the coordinates of its points twice, and ten matrices of the rows.
fn basis_bytes(system: &dyn CoordinateSystem, cage: &Cage, points: usize) -> u64 {
    let values = system.values(cage);
    let (columns, rows) = (values.columns() as u64, values.unknowns() as u64);
    let sampled = points.min(CageBasis::SAMPLE) as u64;
    80 * rows * rows + 16 * sampled * columns
}

/// Most numbers of a residual that is decoded ahead: all of any group that this program writes.
const MAX_AHEAD: usize = 1 << 24;

/// Most numbers of a residual's components in a file of so many bytes.
pub fn most_residual_numbers(file_bytes: u64) -> usize {
    (1usize << 26).saturating_add(usize::try_from(file_bytes).unwrap_or(usize::MAX).saturating_mul(64))
}
