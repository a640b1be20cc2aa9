//! Sections of whole numbers: meshes, groups of cages and what is added to their positions, by the `cager-codec` crate.

use super::codec::{CODED, CODED_STATIC};
use super::reader::{ContainerReader, check_finite};
use super::section::{Entry, SectionHeader};
use super::{Error, tag};
use cager_codec::{
    BasisRecord, CageBasis, Hierarchy, MAX_ROWS, Residual, basis_record, decode_cages, decode_errors, decode_faces,
    decode_positions,
};
use cager_core::cage::Cage;
use cager_core::coordinates::{self, CoordinateSystem, Coordinates, DEFINITION, ElementPlan};
use cager_geometry::mesh::{Point, Polygons};
use std::io::{Read, Seek};

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
        check_finite(points, self.offset)
    }

    pub(super) fn errors(&self, frames: usize) -> Result<Vec<[f32; 2]>, Error> {
        decode_errors(&self.payload, frames).map_err(|e| self.damaged(&e))
    }

    fn basis_record(&self) -> Result<BasisRecord, Error> {
        basis_record(&self.payload).map_err(|e| self.damaged(&e))
    }

    fn residual(&self, hierarchy: &Hierarchy, frames: u32, most: usize) -> Result<Residual, Error> {
        Residual::decode(hierarchy, frames as usize, &self.payload, most).map_err(|e| self.damaged(&e))
    }

    fn damaged(&self, error: &cager_codec::Error) -> Error {
        Error::corrupt(self.offset, error.to_string())
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// The bytes of a mesh or of errors where they are coded.
    pub(super) fn coded(&mut self, tag: [u8; 4]) -> Result<Option<CodedSection>, Error> {
        let entry = self.entry(tag)?;
        if entry.header.codec == CODED_STATIC { self.coded_entry(entry).map(Some) } else { Ok(None) }
    }

    fn coded_entry(&mut self, entry: Entry) -> Result<CodedSection, Error> {
        self.check_limit(entry)?;
        self.coded_payload(entry)
    }

    /// Faces are decoded before the positions that say how many points there can be.
    pub(super) fn limit_points(&self, tag: [u8; 4]) -> Result<(), Error> {
        self.check_limit(self.entry(tag)?)
    }

    /// The cages of a coded group, as the bytes of an uncoded one.
    pub(super) fn group(&mut self, entry: Entry) -> Result<Vec<u8>, Error> {
        let section = self.coded_entry(entry)?;
        let record = section.basis_record()?;
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
        let cages = decode_cages(basis, frames, &section.payload).map_err(|e| section.damaged(&e))?;
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
        let cage = Cage::new(self.cage()?).map_err(|e| corrupt(e.to_string()))?;
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

    /// Decodes what a frame of a coded file needs before its cage is read, the coordinates of the model beside the residual of its group: these are most
    /// of the work, and each keeps a processor busy. The coordinates of all points, where the basis of the cages took them all; nothing where there are no
    /// coordinates, which whoever binds the model can say best.
    ///
    /// # Errors
    /// A frame that does not exist; damage.
    pub fn read_ahead(&mut self, frame: usize) -> Result<Option<Coordinates>, Error> {
        let entry = self.chunk_of(frame)?;
        if entry.header.codec != CODED {
            return Ok(None);
        }
        let record = self.coded_entry(entry)?.basis_record()?;
        let Ok(binding) = self.binding(entry.offset) else { return Ok(None) };
        let rest = self.rest()?;
        let residual = match self.residual_entry(frame) {
            Some(entry) => Some((entry, self.coded_payload(entry)?)),
            None => None,
        };
        let most = most_residual_numbers(self.file_bytes);
        // Two of them would be more than a reader may take.
        self.groups.residuals.clear();
        let (basis, residual) = rayon::join(
            || binding.basis(&record),
            || {
                residual.map(|(entry, section)| {
                    let hierarchy = Hierarchy::new(&rest.faces, rest.points.len());
                    let residual = section.residual(&hierarchy, entry.header.count, most)?;
                    Ok::<_, Error>((hierarchy, (entry, residual)))
                })
            },
        );
        let Ok((basis, coordinates)) = basis else { return Ok(None) };
        self.groups.keep_basis(basis);
        if let Some(found) = residual {
            let (hierarchy, residual) = found?;
            self.groups.hierarchy = Some(hierarchy);
            self.groups.residuals = vec![residual];
        }
        Ok(coordinates.filter(|found| found.phi.nrows() == rest.points.len()))
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
            if let Some((_, residual)) = self.groups.residuals.iter().find(|(of, _)| of.offset == entry.offset) {
                residual.add(frame - first, &mut positions[done..end]);
            }
            done = end;
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
            let end = |entry: &Entry| entry.header.first as usize + entry.header.count as usize;
            // Who goes on from one group to the next is likely to read the one after it too, and two are decoded in the time of one.
            let goes_on =
                self.groups.residuals.last().is_some_and(|(last, _)| end(last) == entry.header.first as usize);
            let after = self.residual_entry(end(&entry)).filter(|_| goes_on);
            self.groups.residuals.clear();
            let section = self.coded_payload(entry)?;
            // Damage there is told when it is its turn.
            let after = after.and_then(|entry| Some((entry, self.coded_payload(entry).ok()?)));
            let most = most_residual_numbers(self.file_bytes);
            let hierarchy = self.hierarchy()?;
            let (residual, after) = rayon::join(
                || section.residual(hierarchy, entry.header.count, most),
                || {
                    let (of, section) = after?;
                    Some((of, section.residual(hierarchy, of.header.count, most.min(MAX_AHEAD)).ok()?))
                },
            );
            self.groups.residuals.push((entry, residual?));
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

    fn coded_payload(&mut self, entry: Entry) -> Result<CodedSection, Error> {
        Ok(CodedSection { offset: entry.offset, payload: self.payload(entry)? })
    }

    /// Reads every residual.
    pub(super) fn verify_residuals(&mut self) -> Result<(), Error> {
        let entries: Vec<Entry> = self.sections_of(tag::RESIDUAL).collect();
        let most = most_residual_numbers(self.file_bytes);
        for entry in entries {
            let section = self.coded_payload(entry)?;
            section.residual(self.hierarchy()?, entry.header.count, most)?;
        }
        Ok(())
    }
}

/// Bytes that computing a basis takes: the coordinates of its points twice, as they are and as a part of them, and ten matrices of the rows.
fn basis_bytes(system: &dyn CoordinateSystem, cage: &Cage, points: usize) -> u64 {
    let values = system.values(cage);
    let (columns, rows) = (values.columns() as u64, values.unknowns() as u64);
    let sampled = points.min(CageBasis::SAMPLE) as u64;
    80 * rows * rows + 16 * sampled * columns
}

/// Most numbers of a residual that is decoded before it is asked for: all of any group that this program writes.
const MAX_AHEAD: usize = 1 << 24;

/// Most numbers of a residual's components in a file of so many bytes: what reading them takes four times.
pub fn most_residual_numbers(file_bytes: u64) -> usize {
    (1usize << 26).saturating_add(usize::try_from(file_bytes).unwrap_or(usize::MAX).saturating_mul(64))
}

fn covers(header: &SectionHeader, frame: usize) -> bool {
    let first = header.first as usize;
    (first..first + header.count as usize).contains(&frame)
}
