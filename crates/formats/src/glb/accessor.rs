//! Positions, indices and other numbers from views.

use cager_geometry::mesh::Point;
use gltf::json::Accessor;
use gltf::json::accessor::ComponentType::{self, F32, I8, I16, U8, U16, U32};
use gltf::json::accessor::{GenericComponentType, IndexComponentType, Type};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::buffers::{Buffers, outside};
use super::faults::{damaged, item, too_large};
use crate::error::Fault;

/// The accessor of an attribute of points.
pub(super) fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<usize> {
    primitive.attributes.get(&Checked::Valid(semantic)).map(gltf::json::Index::value)
}

impl Buffers<'_> {
    /// The first `N` numbers of each element of an accessor, which must be what is wanted, and no
    /// more than `most`.
    pub(super) fn values<const N: usize>(
        &self,
        index: usize,
        wanted: &Wanted,
        most: usize,
        place: &str,
    ) -> Result<Vec<[f64; N]>, Fault> {
        let accessor = item(&self.root.accessors, "accessor", index)?;
        let kind = Kind::of(accessor, index, wanted, place)?;
        let count = usize::try_from(accessor.count.0).ok().filter(|&count| count <= most);
        let mut values: Vec<[f64; N]> = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                let elements = self.elements((view.value(), offset), kind, accessor.count.0, place)?;
                elements.take(count.ok_or_else(too_large)?).map(|element| kind.numbers(element)).collect()
            }
            None => vec![[0.0; N]; count.filter(|&count| count <= self.most_zeros()).ok_or_else(too_large)?],
        };
        for (at, moved) in self.sparse(accessor, kind, values.len(), place)? {
            values[at] = moved;
        }
        Ok(values)
    }

    /// The vertex indices of an accessor, which must have no more than `most`.
    pub(super) fn indices(&self, index: usize, most: usize, place: &str) -> Result<Vec<u32>, Fault> {
        Ok(self.values(index, &INDICES, most, place)?.into_iter().map(|[index]: [f64; 1]| index as u32).collect())
    }

    /// The points that a sparse accessor names among so many, and where it moves them; none where
    /// all are stored.
    pub(super) fn moved_points(
        &self,
        index: usize,
        most: usize,
        place: &str,
    ) -> Result<Option<Vec<(usize, Point)>>, Fault> {
        let accessor = item(&self.root.accessors, "accessor", index)?;
        if accessor.sparse.is_none() || accessor.buffer_view.is_some() {
            return Ok(None);
        }
        let kind = Kind::of(accessor, index, &POSITIONS, place)?;
        self.sparse(accessor, kind, most, place).map(Some)
    }

    /// The elements that a sparse accessor replaces, of so many, and by what.
    fn sparse<const N: usize>(
        &self,
        accessor: &Accessor,
        kind: Kind,
        most: usize,
        place: &str,
    ) -> Result<Vec<(usize, [f64; N])>, Fault> {
        let Some(sparse) = &accessor.sparse else { return Ok(Vec::new()) };
        let Checked::Valid(IndexComponentType(component)) = sparse.indices.component_type else {
            return Err(damaged(place, "a sparse accessor has an unknown type"));
        };
        let count = sparse.count.0;
        let index = Kind { component, shape: Type::Scalar, normalized: false };
        let at = (sparse.indices.buffer_view.value(), sparse.indices.byte_offset.0);
        let indices = self.elements(at, index, count, place)?;
        let at = (sparse.values.buffer_view.value(), sparse.values.byte_offset.0);
        let elements = self.elements(at, kind, count, place)?;
        // More than there are would be read for nothing.
        if count > most as u64 {
            return Err(too_large());
        }
        let pair = |(at, element)| {
            let [at] = index.numbers(at);
            let at = Some(at as usize).filter(|&at| at < most).ok_or_else(|| outside(place))?;
            Ok((at, kind.numbers(element)))
        };
        indices.zip(elements).map(pair).collect()
    }

    /// `count` elements at an offset of a view, all of them there.
    fn elements(
        &self,
        (view, offset): (usize, u64),
        kind: Kind,
        count: u64,
        place: &str,
    ) -> Result<impl Iterator<Item = &[u8]>, Fault> {
        let (bytes, stride) = self.view(view, place)?;
        let size = kind.size();
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(damaged(place, format!("has elements of {size} bytes at a stride of {stride}")));
        }
        let all = || {
            let length = match count.checked_sub(1) {
                Some(last) => last.checked_mul(stride as u64)?.checked_add(size as u64)?,
                None => 0,
            };
            bytes.get(usize::try_from(offset).ok()?..)?.get(..usize::try_from(length).ok()?)
        };
        Ok(all().ok_or_else(|| outside(place))?.chunks(stride))
    }
}

/// What elements may be: what these are called, their types, and whether whole numbers are
/// fractions, where that is not for the file to say.
pub(super) struct Wanted(&'static str, &'static [Type], &'static [ComponentType], Option<bool>);

impl Wanted {
    pub(super) const fn animation(shapes: &'static [Type]) -> Self {
        Self("values of an animation", shapes, &[I8, U8, I16, U16, F32], Some(true))
    }
}

pub(super) const POSITIONS: Wanted = Wanted("positions", &[Type::Vec3], &[I8, U8, I16, U16, F32], None);
const INDICES: Wanted = Wanted("indices", &[Type::Scalar], &[U8, U16, U32], Some(false));
pub(super) const JOINTS: Wanted = Wanted("joints", &[Type::Vec4], &[U8, U16, U32], Some(false));
pub(super) const WEIGHTS: Wanted = Wanted("weights", &[Type::Vec4], &[I8, U8, I16, U16, U32, F32], Some(true));
pub(super) const MATRICES: Wanted = Wanted("matrices", &[Type::Mat4], &[F32], None);
pub(super) const NORMALS: Wanted = Wanted("normals", &[Type::Vec3], &[I8, I16, F32], None);
pub(super) const UVS: Wanted = Wanted("texture coordinates", &[Type::Vec2], &[I8, U8, I16, U16, F32], None);
/// Not all files say that they are fractions, but nothing else has a meaning.
pub(super) const COLORS: Wanted = Wanted("colours", &[Type::Vec3, Type::Vec4], &[U8, U16, F32], Some(true));

#[derive(Clone, Copy)]
struct Kind {
    component: ComponentType,
    shape: Type,
    /// Whether whole numbers stand for fractions of the greatest of their type.
    normalized: bool,
}

impl Kind {
    /// That of an accessor, if it is wanted.
    fn of(accessor: &Accessor, index: usize, wanted: &Wanted, place: &str) -> Result<Self, Fault> {
        let &Wanted(what, shapes, components, normalized) = wanted;
        let (Checked::Valid(GenericComponentType(component)), Checked::Valid(shape)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(damaged(place, format!("accessor {index} has an unknown type")));
        };
        if !shapes.contains(&shape) || !components.contains(&component) {
            return Err(damaged(place, format!("{what} are {shape:?} of {component:?}")));
        }
        Ok(Self { component, shape, normalized: normalized.unwrap_or(accessor.normalized) })
    }

    fn size(self) -> usize {
        self.component.size() * self.shape.multiplicity()
    }

    /// The first numbers of an element that has as many or more.
    fn numbers<const N: usize>(self, element: &[u8]) -> [f64; N] {
        let size = self.component.size();
        std::array::from_fn(|k| self.number(element.get(k * size..).unwrap_or_default()))
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let (value, most) = match (self.component, bytes) {
            (I8, &[a, ..]) => (f64::from(a as i8), 127.0),
            (U8, &[a, ..]) => (a.into(), 255.0),
            (I16, &[a, b, ..]) => (i16::from_le_bytes([a, b]).into(), 32767.0),
            (U16, &[a, b, ..]) => (u16::from_le_bytes([a, b]).into(), 65535.0),
            (U32, &[a, b, c, d, ..]) => return u32::from_le_bytes([a, b, c, d]).into(),
            (F32, &[a, b, c, d, ..]) => return f32::from_le_bytes([a, b, c, d]).into(),
            _ => return 0.0,
        };
        if self.normalized { f64::max(value / most, -1.0) } else { value }
    }
}
