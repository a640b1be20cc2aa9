//! Positions, indices and other numbers from views.

use cager_geometry::mesh::Point;
use gltf::json::Accessor;
use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf::json::validation::Checked;

use super::buffers::{Buffers, outside};
use super::faults::{dangling, too_large};
use crate::error::Fault;

impl Buffers<'_> {
    /// The first `N` numbers of each element of an accessor, which must be what is wanted, and no more than `most`.
    pub(super) fn values<const N: usize>(
        &self,
        index: usize,
        wanted: &Wanted,
        most: usize,
        place: &str,
    ) -> Result<Vec<[f64; N]>, Fault> {
        self.read(index, self.kind(index, wanted, place)?, most, place, |numbers| numbers)
    }

    /// The vertex indices of an accessor, which must have no more than `most`.
    pub(super) fn indices(&self, index: usize, most: usize, place: &str) -> Result<Vec<u32>, Fault> {
        self.read(index, self.kind(index, &INDICES, place)?, most, place, |[index]: [f64; 1]| index as u32)
    }

    /// The points that a sparse accessor names among so many, and where it moves them; none where all are stored.
    pub(super) fn moved_points(
        &self,
        index: usize,
        most: usize,
        place: &str,
    ) -> Result<Option<Vec<(usize, Point)>>, Fault> {
        let accessor = self.accessor(index)?;
        let Some(sparse) = accessor.sparse.as_ref().filter(|_| accessor.buffer_view.is_none()) else {
            return Ok(None);
        };
        let kind = self.kind(index, &POSITIONS, place)?;
        let at = self.sparse_indices(sparse, most, place)?;
        if let Some(outside) = at.iter().find(|&&at| at >= most) {
            return Err(Fault::damaged(format!(
                "{place}: a sparse accessor moves point {outside} of {most}; export the mesh again"
            )));
        }
        let (view, offset) = (sparse.values.buffer_view.value(), sparse.values.byte_offset.0);
        let found = self.elements(view, offset, kind.size(), sparse.count.0, place)?;
        Ok(Some(at.into_iter().zip(found.bytes.chunks(found.stride).map(|element| kind.numbers(element))).collect()))
    }

    fn accessor(&self, index: usize) -> Result<&Accessor, Fault> {
        let accessors = &self.root.accessors;
        accessors.get(index).ok_or_else(|| dangling(&format!("accessor {index}"), accessors.len()))
    }

    /// What the elements of an accessor are, if that is what is wanted.
    fn kind(&self, index: usize, wanted: &Wanted, place: &str) -> Result<Kind, Fault> {
        let accessor = self.accessor(index)?;
        let (Checked::Valid(GenericComponentType(component)), Checked::Valid(shape)) =
            (accessor.component_type, accessor.type_)
        else {
            let what = format!("{place}: accessor {index} has an unknown type; export the mesh again");
            return Err(Fault::damaged(what));
        };
        if !wanted.shapes.contains(&shape) || !wanted.components.contains(&component) {
            let what = wanted.what;
            return Err(Fault::damaged(format!(
                "{place}: {what} are {shape:?} of {component:?}; export the mesh again"
            )));
        }
        Ok(Kind { component, shape, normalized: wanted.normalized.unwrap_or(accessor.normalized) })
    }

    /// The first `N` numbers of every element, converted.
    fn read<const N: usize, T>(
        &self,
        index: usize,
        kind: Kind,
        most: usize,
        place: &str,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, Fault> {
        let accessor = self.accessor(index)?;
        let (size, convert) = (kind.size(), |element: &[u8]| convert(kind.numbers(element)));
        let count = usize::try_from(accessor.count.0).ok().filter(|&count| count <= most);
        let mut values: Vec<T> = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                let found = self.elements(view.value(), offset, size, accessor.count.0, place)?;
                let count = count.ok_or_else(too_large)?;
                found.bytes.chunks(found.stride).take(count).map(&convert).collect()
            }
            // Zeros, but for what a sparse accessor has.
            None => (0..count.filter(|&count| count <= self.most_zeros()).ok_or_else(too_large)?)
                .map(|_| convert(&[0; MAX_ELEMENT_BYTES][..size]))
                .collect(),
        };
        if let Some(sparse) = &accessor.sparse {
            // More than there are would be read for nothing.
            let replaced = self.sparse_indices(sparse, values.len(), place)?;
            let (view, offset) = (sparse.values.buffer_view.value(), sparse.values.byte_offset.0);
            let found = self.elements(view, offset, size, sparse.count.0, place)?;
            for (at, element) in replaced.into_iter().zip(found.bytes.chunks(found.stride)) {
                *values.get_mut(at).ok_or_else(|| outside(place))? = convert(element);
            }
        }
        Ok(values)
    }

    /// Which elements a sparse accessor replaces.
    fn sparse_indices(&self, sparse: &Sparse, most: usize, place: &str) -> Result<Vec<usize>, Fault> {
        let Checked::Valid(IndexComponentType(component)) = sparse.indices.component_type else {
            return Err(Fault::damaged(format!(
                "{place}: a sparse accessor has an unknown type; export the mesh again"
            )));
        };
        let kind = Kind { component, shape: Type::Scalar, normalized: false };
        let (view, offset) = (sparse.indices.buffer_view.value(), sparse.indices.byte_offset.0);
        let found = self.elements(view, offset, kind.size(), sparse.count.0, place)?;
        let count = usize::try_from(sparse.count.0).ok().filter(|&count| count <= most).ok_or_else(too_large)?;
        let index = |element| {
            let [index] = kind.numbers(element);
            index as usize
        };
        Ok(found.bytes.chunks(found.stride).take(count).map(index).collect())
    }

    /// `count` elements of `size` bytes in a view, all of them there.
    fn elements(&self, view: usize, offset: u64, size: usize, count: u64, place: &str) -> Result<Elements<'_>, Fault> {
        let (bytes, stride) = self.view(view, place)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(Fault::damaged(format!(
                "{place}: has elements of {size} bytes at a stride of {stride}; export the mesh again"
            )));
        }
        let bytes =
            usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).ok_or_else(|| outside(place))?;
        let Some(last) = count.checked_sub(1) else {
            return Ok(Elements { bytes: &[], stride });
        };
        let end = last.checked_mul(stride as u64).and_then(|start| start.checked_add(size as u64));
        let end = end.and_then(|end| usize::try_from(end).ok());
        let bytes = end.and_then(|end| bytes.get(..end)).ok_or_else(|| outside(place))?;
        Ok(Elements { bytes, stride })
    }
}

use ComponentType::{F32, I8, I16, U8, U16, U32};

/// What elements may be.
pub(super) struct Wanted {
    what: &'static str,
    shapes: &'static [Type],
    components: &'static [ComponentType],
    /// Whether whole numbers are fractions, where that is not for the file to say.
    normalized: Option<bool>,
}

impl Wanted {
    const fn new(
        what: &'static str,
        shapes: &'static [Type],
        components: &'static [ComponentType],
        normalized: Option<bool>,
    ) -> Self {
        Self { what, shapes, components, normalized }
    }

    /// Values of an animation.
    pub(super) const fn animation(shapes: &'static [Type]) -> Self {
        Self::new("values of an animation", shapes, &[I8, U8, I16, U16, F32], Some(true))
    }
}

pub(super) const POSITIONS: Wanted = Wanted::new("positions", &[Type::Vec3], &[I8, U8, I16, U16, F32], None);
const INDICES: Wanted = Wanted::new("indices", &[Type::Scalar], &[U8, U16, U32], Some(false));
pub(super) const JOINTS: Wanted = Wanted::new("joints", &[Type::Vec4], &[U8, U16, U32], Some(false));
pub(super) const WEIGHTS: Wanted = Wanted::new("weights", &[Type::Vec4], &[I8, U8, I16, U16, U32, F32], Some(true));
pub(super) const MATRICES: Wanted = Wanted::new("matrices", &[Type::Mat4], &[F32], None);
/// Not all files say that they are fractions, while nothing else has a meaning; an opacity is passed over.
pub(super) const COLORS: Wanted = Wanted::new("colours", &[Type::Vec3, Type::Vec4], &[U8, U16, F32], Some(true));

/// The largest element: sixteen numbers of four bytes.
const MAX_ELEMENT_BYTES: usize = 64;

/// Where the elements of an accessor are; the last one ends the bytes.
struct Elements<'a> {
    bytes: &'a [u8],
    /// Bytes from the start of one to the start of the next, at least the size of one.
    stride: usize,
}

/// What the elements of an accessor are.
#[derive(Clone, Copy)]
struct Kind {
    component: ComponentType,
    shape: Type,
    /// Whether whole numbers stand for fractions of the greatest of their type.
    normalized: bool,
}

impl Kind {
    /// Bytes of an element.
    fn size(self) -> usize {
        self.component.size() * self.shape.multiplicity()
    }

    /// The first numbers of an element that has as many or more.
    fn numbers<const N: usize>(self, element: &[u8]) -> [f64; N] {
        let size = self.component.size();
        std::array::from_fn(|k| self.number(element.get(k * size..).unwrap_or_default()))
    }

    fn number(self, bytes: &[u8]) -> f64 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            bytes.first_chunk().copied().unwrap_or([0; N])
        }
        let (value, most) = match self.component {
            I8 => (i8::from_le_bytes(first(bytes)).into(), 127.0),
            U8 => (u8::from_le_bytes(first(bytes)).into(), 255.0),
            I16 => (i16::from_le_bytes(first(bytes)).into(), 32767.0),
            U16 => (u16::from_le_bytes(first(bytes)).into(), 65535.0),
            U32 => return u32::from_le_bytes(first(bytes)).into(),
            F32 => return f32::from_le_bytes(first(bytes)).into(),
        };
        if self.normalized { f64::max(value / most, -1.0) } else { value }
    }
}
