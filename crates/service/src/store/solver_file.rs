//! A prepared solver as a file in the safetensors format: what is no matrix as bytes, each matrix as the list of its columns, and last
//! the CRC-32C of all that comes before. Converted a column at a time, which stays in the cache, so that loading runs at the speed of
//! memory.

use super::ContentKey;
use super::disk::DiskFile;
use cager_core::coordinates::DependentNormals;
use cager_core::inversion::{
    DependentParts, NearnessParts, PreparationReport, RegularizationTarget, Solver, SolverParts,
};
use cager_proto::wire;
use faer::traits::ComplexField;
use faer::{ColRef, Mat, MatRef};
use safetensors::Dtype;
use safetensors::tensor::{Metadata, TensorInfo};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io;

/// Version of the format, raised whenever [`SolverFacts`] or what it holds changes; versions up to 4 were not safetensors files and begin with [`OLD_FORMAT`].
const VERSION: &str = "9";
const OLD_FORMAT: &[u8] = b"CGRSOLV";
const HEADER_BYTES: u64 = 1 << 16;
const CHECKSUM: &str = "crc32c";

/// Most bytes of [`SolverFacts`].
const MAX_FACTS_BYTES: usize = 1 << 30;

/// What a solver is made of beside matrices.
#[derive(Deserialize, Serialize)]
struct SolverFacts {
    positions: u64,
    reads_all: bool,
    diagonal: f64,
    handles: Vec<u32>,
    /// The first frame's predecessor, where frames depend on it.
    first: Option<Vec<f32>>,
    tied: Option<Tied>,
    nearness: Option<Near>,
    preparation: PreparationReport,
}

/// Of normals that follow from the vertices.
#[derive(Deserialize, Serialize)]
struct Tied {
    faces: Vec<[u32; 3]>,
    weights: Vec<[f64; 3]>,
    start_weight: f64,
}

/// Of what brings cages back to their frames.
#[derive(Deserialize, Serialize)]
struct Near {
    faces: Vec<[u32; 3]>,
    margin: f64,
}

pub(super) fn write(file: &dyn DiskFile, key: &ContentKey, solver: &Solver) -> io::Result<()> {
    let decoder = solver.decoder();
    let no_coordinates = || io::Error::new(io::ErrorKind::InvalidInput, "a solver without its coordinates");
    let phi = decoder.coordinates().ok_or_else(no_coordinates)?;
    let (mut first, mut matrices) = (None, vec![Array::new("operator", solver.operator())]);
    match solver.regularization_target() {
        RegularizationTarget::None => {}
        RegularizationTarget::Constant(offset) => matrices.push(Array::new("constant", offset.as_ref())),
        RegularizationTarget::Previous { operator, first: cage } => {
            matrices.push(Array::new("previous", operator.as_ref()));
            first = Some(cage.clone());
        }
    }
    let tied = solver.dependent().map(|(normals, gram, start_weight)| {
        matrices.push(Array::new("gram", gram));
        Tied { faces: normals.faces().to_vec(), weights: normals.weights().to_vec(), start_weight }
    });
    let nearness = solver.nearness().map(|near| {
        matrices.extend([Array::new("factor", near.factor.as_ref()), Array::new("rest", near.rest.as_ref())]);
        Near { faces: near.faces.clone(), margin: near.margin }
    });
    matrices.push(Array::new("phi", phi));
    let facts = SolverFacts {
        positions: decoder.positions() as u64,
        reads_all: solver.reads_all(),
        diagonal: solver.diagonal(),
        handles: solver.handles().to_vec(),
        first,
        tied,
        nearness,
        preparation: solver.preparation().clone(),
    };
    let facts = wire::encode::<_, MAX_FACTS_BYTES>(&facts).map_err(io::Error::other)?;
    let mut arrays = vec![Array::new("facts", column(&facts))];
    arrays.extend(matrices);

    let mut out = Out { file, piece: header(key, &arrays)?, offset: 0, crc: 0 };
    out.flush()?;
    arrays.iter().try_for_each(|array| (array.put)(&mut out))?;
    let crc = out.crc;
    out.put([crc].into_iter())
}

/// The length of what follows and the names, types, shapes and places of the arrays, the checksum included.
fn header(key: &ContentKey, arrays: &[Array<'_>]) -> io::Result<Vec<u8>> {
    let (checksum, mut end) = (Array::new(CHECKSUM, column(&[0_u32])), 0);
    let place = |array: &Array<'_>| {
        let start = end;
        end += array.shape[0] * array.shape[1] * array.dtype.bitsize() / 8;
        let info = TensorInfo { dtype: array.dtype, shape: array.shape.to_vec(), data_offsets: (start, end) };
        (array.name.to_owned(), info)
    };
    let tensors = arrays.iter().chain([&checksum]).map(place).collect();
    let said = [("solver", VERSION.to_owned()), ("key", key.to_string())];
    let said: HashMap<_, _> = said.map(|(name, value)| (name.to_owned(), value)).into();
    let metadata = Metadata::new(Some(said), tensors).map_err(io::Error::other)?;
    let mut text = serde_json::to_vec(&metadata)?;
    text.resize(text.len().next_multiple_of(8), b' ');
    Ok([&(text.len() as u64).to_le_bytes(), text.as_slice()].concat())
}

/// Reads a solver; None where the file is of another version of the format. Nothing is allocated before the lengths are known to
/// be the file's.
///
/// # Errors
/// What the system says; `InvalidData` for damage.
pub(super) fn read(file: &dyn DiskFile, key: &ContentKey) -> io::Result<Option<Solver>> {
    let bytes = file.length()?;
    let mut length = [0; 8];
    if bytes < length.len() as u64 {
        return Err(damage("it is too short"));
    }
    file.read_exact_at(&mut length, 0)?;
    if length.starts_with(OLD_FORMAT) {
        return Ok(None);
    }
    let header_bytes = u64::from_le_bytes(length);
    if header_bytes > HEADER_BYTES.min(bytes - 8) {
        return Err(damage("it has no header"));
    }
    let mut header = length.to_vec();
    header.resize(8 + header_bytes as usize, 0);
    file.read_exact_at(&mut header[8..], 8)?;
    let metadata: Metadata =
        serde_json::from_slice(&header[8..]).map_err(|_| damage("its header is no list of arrays"))?;
    let said = |name: &str| metadata.metadata().as_ref()?.get(name).map(String::as_str);
    if said("solver") != Some(VERSION) {
        return Ok(None);
    }
    if said("key") != Some(&key.to_string()) {
        return Err(damage("it is of other content"));
    }
    if (header.len() as u64).checked_add(metadata.data_len() as u64) != Some(bytes) {
        return Err(damage("its length is not what its header says"));
    }

    let (start, crc) = (header.len() as u64, crc32c::crc32c(&header));
    let mut source = In { file, metadata, start, offset: start, piece: Vec::new(), crc };
    let facts: Vec<u8> = source.vector("facts")?;
    let operator = source.matrix("operator")?;
    let constant = source.has("constant").then(|| source.matrix("constant")).transpose()?;
    let previous = source.has("previous").then(|| source.matrix("previous")).transpose()?;
    let gram = source.has("gram").then(|| source.matrix("gram")).transpose()?;
    let factor = source.has("factor").then(|| source.matrix("factor")).transpose()?;
    let rest = source.has("rest").then(|| source.matrix("rest")).transpose()?;
    let phi = source.matrix("phi")?;
    let crc = source.crc;
    if source.vector::<u32>(CHECKSUM)? != [crc] {
        return Err(damage("its content does not match its checksum"));
    }
    let no_fit = || damage("its parts do not fit together");
    let facts = wire::decode::<_, MAX_FACTS_BYTES>(&facts).map_err(|_| no_fit())?;
    let SolverFacts { positions, reads_all, diagonal, handles, first, tied, nearness, preparation } = facts;
    let positions = positions as usize;
    let target = match (constant, previous, first) {
        (Some(offset), None, None) => RegularizationTarget::Constant(offset),
        (None, Some(operator), Some(first)) => RegularizationTarget::Previous { operator, first },
        (None, None, None) => RegularizationTarget::None,
        _ => return Err(no_fit()),
    };
    let tied = match (tied, gram) {
        (Some(Tied { faces, weights, start_weight }), Some(gram)) => {
            let normals = DependentNormals::from_parts(faces, weights, positions).ok_or_else(no_fit)?;
            Some(DependentParts { normals, gram, weight: start_weight })
        }
        (None, None) => None,
        _ => return Err(no_fit()),
    };
    let nearness = match (nearness, factor, rest) {
        (Some(Near { faces, margin }), Some(factor), Some(rest)) => Some(NearnessParts { factor, rest, faces, margin }),
        (None, None, None) => None,
        _ => return Err(no_fit()),
    };
    let parts = SolverParts {
        handles,
        reads_all,
        operator,
        target,
        phi,
        positions,
        dependent: tied,
        nearness,
        diagonal,
        preparation,
    };
    Solver::from_parts(parts).ok_or_else(no_fit).map(Some)
}

fn damage(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

/// A number as it stands in the file, little-endian.
trait Number: Copy + Default + 'static {
    const TYPE: Dtype;
    fn append(self, bytes: &mut Vec<u8>);
    fn of(bytes: &[u8]) -> Self;
}

macro_rules! numbers {
    ($($number:ty: $dtype:ident),*) => {$(
        impl Number for $number {
            const TYPE: Dtype = Dtype::$dtype;

            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn of(bytes: &[u8]) -> Self {
                bytes.try_into().map(Self::from_le_bytes).unwrap_or_default()
            }
        }
    )*};
}

numbers!(u8: U8, u32: U32, f32: F32, f64: F64);

type Put<'a> = Box<dyn Fn(&mut Out<'_>) -> io::Result<()> + 'a>;

/// An array to be written.
struct Array<'a> {
    name: &'static str,
    dtype: Dtype,
    /// Columns, rows.
    shape: [usize; 2],
    put: Put<'a>,
}

impl<'a> Array<'a> {
    fn new<T: Number>(name: &'static str, matrix: MatRef<'a, T>) -> Self {
        let shape = [matrix.ncols(), matrix.nrows()];
        let put = move |out: &mut Out<'_>| (0..shape[0]).try_for_each(|j| out.put(matrix.col(j).iter().copied()));
        Self { name, dtype: T::TYPE, shape, put: Box::new(put) }
    }
}

fn column<T>(values: &[T]) -> MatRef<'_, T> {
    ColRef::from_slice(values).as_mat()
}

/// Checksums and writes, a column at a time.
struct Out<'a> {
    file: &'a dyn DiskFile,
    piece: Vec<u8>,
    offset: u64,
    crc: u32,
}

impl Out<'_> {
    fn put<T: Number>(&mut self, values: impl Iterator<Item = T>) -> io::Result<()> {
        self.piece.clear();
        values.for_each(|value| value.append(&mut self.piece));
        self.flush()
    }

    fn flush(&mut self) -> io::Result<()> {
        self.crc = crc32c::crc32c_append(self.crc, &self.piece);
        self.file.write_all_at(&self.piece, self.offset)?;
        self.offset += self.piece.len() as u64;
        Ok(())
    }
}

/// Reads, in the order of the arrays, a column at a time, and checksums what it reads.
struct In<'a> {
    file: &'a dyn DiskFile,
    metadata: Metadata,
    /// Of the first array.
    start: u64,
    offset: u64,
    piece: Vec<u8>,
    crc: u32,
}

impl In<'_> {
    fn has(&self, name: &str) -> bool {
        self.metadata.info(name).is_some()
    }

    /// Columns and rows of the array, which comes next.
    fn shape<T: Number>(&self, name: &str) -> io::Result<[usize; 2]> {
        let is_next = |info: &&TensorInfo| info.data_offsets.0 as u64 == self.offset - self.start;
        let info = self.metadata.info(name).filter(|info| info.dtype == T::TYPE).filter(is_next);
        let shape = info.and_then(|info| {
            let [columns, rows] = <[usize; 2]>::try_from(info.shape.as_slice()).ok()?;
            let bytes = columns.checked_mul(rows)?.checked_mul(size_of::<T>())?;
            let (start, end) = info.data_offsets;
            (bytes == end - start && (rows > 0 || columns <= 1)).then_some([columns, rows])
        });
        shape.ok_or_else(|| damage("an array is not what it should be"))
    }

    fn vector<T: Number>(&mut self, name: &str) -> io::Result<Vec<T>> {
        let [columns, rows] = self.shape::<T>(name)?;
        let mut values = vec![T::default(); columns * rows];
        self.fill(&mut values)?;
        Ok(values)
    }

    fn matrix<T: Number + ComplexField>(&mut self, name: &str) -> io::Result<Mat<T>> {
        let [columns, rows] = self.shape::<T>(name)?;
        let mut matrix = Mat::zeros(rows, columns);
        (0..columns).try_for_each(|j| self.fill(matrix.col_as_slice_mut(j)))?;
        Ok(matrix)
    }

    fn fill<T: Number>(&mut self, values: &mut [T]) -> io::Result<()> {
        self.piece.resize(size_of_val(values), 0);
        self.file.read_exact_at(&mut self.piece, self.offset)?;
        self.offset += self.piece.len() as u64;
        self.crc = crc32c::crc32c_append(self.crc, &self.piece);
        for (value, bytes) in values.iter_mut().zip(self.piece.chunks_exact(size_of::<T>())) {
            *value = T::of(bytes);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::coordinates::{ElementPlan, Refinement};
    use cager_core::spectral::maxvol::Volume;

    #[test]
    fn what_is_no_matrix_keeps_its_layout() {
        let preparation = PreparationReport {
            rank: 1,
            affine_reproduction_error: 2.0,
            condition_full: 3.0,
            condition_handles: 4.0,
            singular_values: vec![5.0, f64::NAN],
            weak: 33,
            maxvol: Volume { swaps: 6, log_volume: 7.0, max_entry: 8.0 },
            outside: vec![9],
            outside_distance: 10.0,
            refinement: Some(Refinement { elements: 11, refinements: 12, change: 13.0 }),
            plan: Some(ElementPlan::from_bytes(vec![14])),
        };
        let tied = Some(Tied { faces: vec![[18, 19, 20]], weights: vec![[21.0, 22.0, 23.0]], start_weight: 24.0 });
        let (handles, first) = (vec![25], Some(vec![26.0]));
        let nearness = Some(Near { faces: vec![[29, 30, 31]], margin: 32.0 });
        let facts =
            SolverFacts { positions: 27, reads_all: true, diagonal: 28.0, handles, first, tied, nearness, preparation };
        let bytes = wire::encode::<_, MAX_FACTS_BYTES>(&facts).expect("bytes");
        assert_eq!(crc32c::crc32c(&bytes), 1_427_168_139, "files of this version read otherwise: raise it");
    }
}
