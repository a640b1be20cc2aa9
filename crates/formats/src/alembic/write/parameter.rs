//! Parameters of a mesh: values by corner, where corners share them.

use std::io::{self, Seek, Write};

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{CornerSet, SharedNormals};

use super::ogawa::Sink;
use super::tables::{Compound, Metadata, Values, Written};
use super::{DATA, FRAMES};
use crate::alembic::properties::{F32, Kind, U32};

/// A parameter whose values are stored, and which of them each corner has.
pub(super) struct Parameter {
    pub(super) name: String,
    /// What the library of Alembic says of such parameters.
    told: String,
    /// Numbers of a value.
    extent: u8,
    /// Samples of the values, of which normals have one a frame.
    values: Vec<u64>,
    sampling: u32,
    indices: u64,
}

impl Parameter {
    /// Values that are the same in all frames.
    pub(super) fn new<W: Write + Seek, const N: usize>(
        sink: &mut Sink<W>,
        name: &str,
        faces: &Polygons,
        set: &CornerSet<N>,
    ) -> io::Result<Self> {
        let values = sink.sample(&floats(set.values.as_flattened()))?;
        let indices = sink.sample(&clockwise(faces, &set.corners))?;
        let told = told(if N == 4 { "rgba" } else { "vector" }, N);
        Ok(Self { name: name.to_owned(), told, extent: N as u8, values: vec![values, DATA], sampling: 0, indices })
    }

    /// Normals, whose values are added frame by frame.
    pub(super) fn normals<W: Write + Seek>(
        sink: &mut Sink<W>,
        faces: &Polygons,
        normals: &SharedNormals,
    ) -> io::Result<Self> {
        let indices = sink.sample(&clockwise(faces, &normals.corners))?;
        let (name, told) = ("N".to_owned(), told("normal", 3));
        Ok(Self { name, told, extent: 3, values: Vec::new(), sampling: FRAMES, indices })
    }

    pub(super) fn add_frame<W: Write + Seek>(&mut self, sink: &mut Sink<W>, values: &[f32]) -> io::Result<()> {
        self.values.extend([sink.sample(&floats(values))?, DATA]);
        Ok(())
    }

    /// Says what the parameter is called in the file it comes from, where it has another name here.
    pub(super) fn with_source(mut self, name: &str) -> Self {
        // These would end it.
        let name = name.replace([';', '='], "_");
        if !name.is_empty() {
            self.told += &format!(";sourceName={name}");
        }
        self
    }

    /// Writes it into a compound.
    pub(super) fn write<W: Write + Seek>(
        &self,
        compound: &mut Compound,
        sink: &mut Sink<W>,
        metadata: &mut Metadata,
    ) -> io::Result<()> {
        let mut inner = Compound::default();
        let values = Values { kind: Kind::Array, number: F32, extent: self.extent, sampling: self.sampling };
        inner.add(sink, metadata, (".vals", &self.told), &self.values, &values)?;
        let indices = Values { kind: Kind::Array, number: U32, extent: 1, sampling: 0 };
        inner.add(sink, metadata, (".indices", ""), &[self.indices, DATA], &indices)?;
        let inner: Written = inner.write(sink)?;
        compound.add_compound(metadata, (&self.name, &self.told), &inner);
        Ok(())
    }
}

fn told(interpretation: &str, extent: usize) -> String {
    format!(
        "arrayExtent=1;geoScope=fvr;interpretation={interpretation};isGeomParam=true;podExtent={extent};podName=float32_t"
    )
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Numbers of corners, those of each face in opposite order.
pub(super) fn clockwise(faces: &Polygons, of_corners: &[u32]) -> Vec<u8> {
    let mut rest = of_corners;
    let turned = faces.arities().iter().flat_map(|&count| {
        let (face, others) = rest.split_at(count as usize);
        rest = others;
        face.iter().rev()
    });
    turned.flat_map(|k| k.to_le_bytes()).collect()
}
