//! A prepared solver as a file: a header with all lengths and its own checksum, then raw little-endian arrays, then the
//! checksum of everything. Converted in pieces that stay in the cache, so that loading runs at the speed of memory.

use super::ContentKey;
use super::disk::DiskFile;
use cager_core::coordinates::{ElementPlan, Refinement, TiedNormals};
use cager_core::inversion::{Preparation, Pull, Solver, SolverParts, TiedParts};
use faer::{Mat, MatRef};
use std::io;

/// A name, and the version of the format.
const MAGIC: [u8; 8] = *b"CGRSOLV\x05";
const COUNTS: usize = 16;
const NUMBERS: usize = 12;
/// Magic, key, counts, numbers, checksum.
const HEADER_BYTES: usize = 8 + 32 + 8 * COUNTS + 8 * NUMBERS + 4;
const PIECE_BYTES: usize = 1 << 18;

/// What is added to `R · H`, one of the counts.
const NO_PULL: u64 = 0;
const CONSTANT: u64 = 1;
const PREVIOUS: u64 = 2;
/// Its place.
const PULL_PLACE: usize = 11;

/// What a file turned out to be.
pub(super) enum Found {
    Solver(Box<Solver>),
    /// Of another version of the format, as an older or newer program writes it; the version is given.
    Other(u8),
    Damage(String),
}

/// Length of the file that has these counts, where one can have it.
fn file_bytes(counts: &[u64; COUNTS]) -> Option<u64> {
    let [points, unknowns, handles, reads_all, values, outside, _, _, _, columns, faces, pull, _, _, _, plan] = *counts;
    // A matrix's columns are padded in memory: only tall ones take about what their file does. A cage of v vertices has fewer than
    // v² faces.
    if unknowns > points || columns > points.checked_mul(points)? || reads_all > 1 || handles > points {
        return None;
    }
    let tied = match faces {
        0 => 0,
        _ => faces.checked_mul(36)?.checked_add(columns.checked_mul(columns)?.checked_mul(8)?)?,
    };
    let pull = match pull {
        NO_PULL => 0,
        CONSTANT => unknowns.checked_mul(24)?,
        PREVIOUS => unknowns.checked_mul(unknowns.checked_mul(8)?.checked_add(12)?)?,
        _ => return None,
    };
    let read = if reads_all == 1 { points } else { handles };
    let phi = points.checked_mul(columns)?.checked_mul(4)?;
    let operator = read.checked_mul(unknowns)?.checked_mul(8)?;
    let small = handles.checked_add(outside)?.checked_mul(4)?.checked_add(values.checked_mul(8)?)?;
    (HEADER_BYTES as u64 + 4)
        .checked_add(plan)?
        .checked_add(phi)?
        .checked_add(operator)?
        .checked_add(small)?
        .checked_add(pull)?
        .checked_add(tied)
}

pub(super) fn write(file: &dyn DiskFile, key: &ContentKey, solver: &Solver) -> io::Result<()> {
    // Named one by one, so that a new field is not forgotten here.
    let Preparation {
        rank,
        affine_reproduction_error,
        condition_full,
        condition_handles,
        singular_values,
        swaps,
        log_volume,
        max_entry,
        outside,
        outside_distance,
        refinement,
        plan,
        coordinates_seconds,
        maxvol_seconds,
        svd_seconds,
    } = solver.preparation();
    let decoder = solver.decoder();
    let no_coordinates = || io::Error::new(io::ErrorKind::InvalidInput, "a solver without its coordinates");
    let phi = decoder.coordinates().ok_or_else(no_coordinates)?;
    let (operator, tied) = (solver.operator(), solver.tied());
    let mut header = Vec::with_capacity(HEADER_BYTES);
    header.extend_from_slice(&MAGIC);
    header.extend_from_slice(&key.0);
    let counts: [usize; COUNTS] = [
        decoder.points(),
        decoder.unknowns(),
        solver.handles().len(),
        usize::from(solver.reads_all()),
        singular_values.len(),
        outside.len(),
        decoder.positions(),
        *rank,
        *swaps,
        decoder.columns(),
        decoder.tied_normals().map_or(0, |normals| normals.faces().len()),
        match solver.pull() {
            Pull::None => NO_PULL,
            Pull::Constant(_) => CONSTANT,
            Pull::Previous { .. } => PREVIOUS,
        } as usize,
        usize::from(refinement.is_some()),
        refinement.map_or(0, |refined| refined.elements),
        refinement.map_or(0, |refined| refined.refinements),
        plan.as_ref().map_or(0, |plan| plan.as_bytes().len()),
    ];
    header.extend(counts.iter().flat_map(|&count| (count as u64).to_le_bytes()));
    let numbers: [f64; NUMBERS] = [
        solver.diagonal(),
        *affine_reproduction_error,
        *condition_full,
        *condition_handles,
        *log_volume,
        *max_entry,
        *outside_distance,
        *coordinates_seconds,
        *maxvol_seconds,
        *svd_seconds,
        tied.map_or(0.0, |(_, _, weight)| weight),
        refinement.map_or(0.0, |refined| refined.change),
    ];
    header.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    header.extend_from_slice(&crc32c::crc32c(&header).to_le_bytes());

    let mut out = Out { file, piece: header, offset: 0, crc: 0 };
    out.put(solver.handles().iter().map(|x| x.to_le_bytes()))?;
    out.put(outside.iter().map(|x| x.to_le_bytes()))?;
    out.put(singular_values.iter().map(|x| x.to_le_bytes()))?;
    out.put(plan.iter().flat_map(|plan| plan.as_bytes()).map(|x| x.to_le_bytes()))?;
    for j in 0..operator.ncols() {
        out.put(operator.col(j).iter().map(|x| x.to_le_bytes()))?;
    }
    let mut put_matrix = |matrix: MatRef<'_, f64>| {
        (0..matrix.ncols()).try_for_each(|j| out.put(matrix.col(j).iter().map(|x| x.to_le_bytes())))
    };
    match solver.pull() {
        Pull::None => {}
        Pull::Constant(offset) => put_matrix(offset.as_ref())?,
        Pull::Previous { operator, first } => {
            put_matrix(operator.as_ref())?;
            out.put(first.iter().map(|x| x.to_le_bytes()))?;
        }
    }
    if let Some((normals, gram, _)) = tied {
        out.put(normals.faces().iter().flatten().map(|x| x.to_le_bytes()))?;
        out.put(normals.weights().iter().flatten().map(|x| x.to_le_bytes()))?;
        (0..gram.ncols()).try_for_each(|j| out.put(gram.col(j).iter().map(|x| x.to_le_bytes())))?;
    }
    for j in 0..phi.ncols() {
        out.put(phi.col(j).iter().map(|x| x.to_le_bytes()))?;
    }
    out.flush()?;
    let crc = out.crc.to_le_bytes();
    out.piece.extend_from_slice(&crc);
    out.flush()
}

/// Reads a solver. Nothing is allocated before the lengths are known to be the file's.
pub(super) fn read(file: &dyn DiskFile, key: &ContentKey) -> io::Result<Found> {
    let bytes = file.length()?;
    let damage = |what: &str| Ok(Found::Damage(what.into()));
    let mut magic = [0; MAGIC.len()];
    if bytes >= magic.len() as u64 {
        file.read_exact_at(&mut magic, 0)?;
    }
    // Before anything else: other versions have headers of other lengths.
    let ([name @ .., version], [our_name @ .., our_version]) = (&magic, &MAGIC);
    if name == our_name && version != our_version {
        return Ok(Found::Other(*version));
    }
    if bytes < HEADER_BYTES as u64 + 4 {
        return damage("it is too short");
    }
    let mut header = [0; HEADER_BYTES];
    file.read_exact_at(&mut header, 0)?;
    let (body, crc) = header.split_at(HEADER_BYTES - 4);
    if crc != crc32c::crc32c(body).to_le_bytes() {
        return damage("its header does not match its checksum");
    }
    if body[..8] != MAGIC {
        return damage("it is not a solver");
    }
    if body[8..40] != key.0 {
        return damage("it is of other content");
    }
    let mut words = body[40..].chunks_exact(8).map(|b| u64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|i| b[i])));
    let mut word = || words.next().unwrap_or_default();
    let counts: [u64; COUNTS] = std::array::from_fn(|_| word());
    let numbers: [f64; NUMBERS] = std::array::from_fn(|_| f64::from_bits(word()));
    if file_bytes(&counts) != Some(bytes) {
        return damage("its length is not what its header says");
    }
    let [
        points,
        unknowns,
        handle_count,
        reads_all,
        values,
        outside_count,
        positions,
        rank,
        swaps,
        columns,
        faces,
        _,
        refined,
        elements,
        refinements,
        plan,
    ] = counts.map(|count| count as usize);

    let mut source = In { file, piece: Vec::new(), at: 0, offset: HEADER_BYTES as u64, end: bytes, crc: 0 };
    source.crc = crc32c::crc32c(&header);
    let mut handles = vec![0; handle_count];
    source.fill(&mut handles, u32::from_le_bytes)?;
    let mut outside = vec![0; outside_count];
    source.fill(&mut outside, u32::from_le_bytes)?;
    let mut singular_values = vec![0.0; values];
    source.fill(&mut singular_values, f64::from_le_bytes)?;
    let mut plan = vec![0; plan];
    source.fill(&mut plan, u8::from_le_bytes)?;
    let operator = source.matrix(if reads_all == 1 { points } else { handle_count }, unknowns)?;
    let pull = match counts[PULL_PLACE] {
        CONSTANT => Pull::Constant(source.matrix(unknowns, 3)?),
        PREVIOUS => {
            let operator = source.matrix(unknowns, unknowns)?;
            let mut first = vec![0.0; 3 * unknowns];
            source.fill(&mut first, f32::from_le_bytes)?;
            Pull::Previous { operator, first }
        }
        _ => Pull::None,
    };
    let [.., weight, change] = numbers;
    let mut tied = None;
    if faces > 0 {
        let (mut corners, mut weights) = (vec![[0; 3]; faces], vec![[0.0; 3]; faces]);
        source.fill(corners.as_flattened_mut(), u32::from_le_bytes)?;
        source.fill(weights.as_flattened_mut(), f64::from_le_bytes)?;
        let gram = source.matrix(columns, columns)?;
        let Some(normals) = TiedNormals::from_parts(corners, weights, positions) else {
            return damage("its normals do not fit its cage");
        };
        tied = Some(TiedParts { normals, gram, weight });
    }
    let mut phi = Mat::<f32>::zeros(points, columns);
    for j in 0..columns {
        source.fill(phi.col_as_slice_mut(j), f32::from_le_bytes)?;
    }
    let crc = source.crc;
    let mut stored = [0];
    source.fill(&mut stored, u32::from_le_bytes)?;
    if stored[0] != crc {
        return damage("its content does not match its checksum");
    }

    let [
        diagonal,
        affine_reproduction_error,
        condition_full,
        condition_handles,
        log_volume,
        max_entry,
        outside_distance,
        coordinates_seconds,
        maxvol_seconds,
        svd_seconds,
        ..,
    ] = numbers;
    let preparation = Preparation {
        rank,
        affine_reproduction_error,
        condition_full,
        condition_handles,
        singular_values,
        swaps,
        log_volume,
        max_entry,
        outside,
        outside_distance,
        refinement: (refined != 0).then_some(Refinement { elements, refinements, change }),
        plan: (!plan.is_empty()).then(|| ElementPlan::from_bytes(plan)),
        coordinates_seconds,
        maxvol_seconds,
        svd_seconds,
    };
    let parts =
        SolverParts { handles, reads_all: reads_all == 1, operator, pull, phi, positions, tied, diagonal, preparation };
    match Solver::from_parts(parts) {
        Some(solver) => Ok(Found::Solver(Box::new(solver))),
        None => damage("its parts do not fit together"),
    }
}

/// Gathers pieces, checksums and writes them.
struct Out<'a> {
    file: &'a dyn DiskFile,
    piece: Vec<u8>,
    offset: u64,
    crc: u32,
}

impl Out<'_> {
    fn put<const N: usize>(&mut self, values: impl Iterator<Item = [u8; N]>) -> io::Result<()> {
        for value in values {
            self.piece.extend_from_slice(&value);
            if self.piece.len() >= PIECE_BYTES {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.crc = crc32c::crc32c_append(self.crc, &self.piece);
        self.file.write_all_at(&self.piece, self.offset)?;
        self.offset += self.piece.len() as u64;
        self.piece.clear();
        Ok(())
    }
}

/// Reads pieces and checksums what is taken from them.
struct In<'a> {
    file: &'a dyn DiskFile,
    piece: Vec<u8>,
    at: usize,
    offset: u64,
    end: u64,
    crc: u32,
}

impl In<'_> {
    fn matrix(&mut self, rows: usize, columns: usize) -> io::Result<Mat<f64>> {
        let mut matrix = Mat::<f64>::zeros(rows, columns);
        (0..columns).try_for_each(|j| self.fill(matrix.col_as_slice_mut(j), f64::from_le_bytes))?;
        Ok(matrix)
    }

    fn fill<T, const N: usize>(&mut self, mut values: &mut [T], value: fn([u8; N]) -> T) -> io::Result<()> {
        while !values.is_empty() {
            if self.piece.len() - self.at < N {
                self.refill()?;
            }
            let (now, later) = values.split_at_mut(values.len().min((self.piece.len() - self.at) / N));
            let bytes = &self.piece[self.at..][..N * now.len()];
            self.crc = crc32c::crc32c_append(self.crc, bytes);
            for (to, from) in now.iter_mut().zip(bytes.as_chunks::<N>().0) {
                *to = value(*from);
            }
            self.at += bytes.len();
            values = later;
        }
        Ok(())
    }

    /// Moves on; what of the piece is left comes first.
    fn refill(&mut self) -> io::Result<()> {
        self.piece.drain(..self.at);
        self.at = 0;
        let left = self.piece.len();
        let more = (PIECE_BYTES - left).min(usize::try_from(self.end - self.offset).unwrap_or(PIECE_BYTES));
        if more == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.piece.resize(left + more, 0);
        self.file.read_exact_at(&mut self.piece[left..], self.offset)?;
        self.offset += more as u64;
        Ok(())
    }
}
