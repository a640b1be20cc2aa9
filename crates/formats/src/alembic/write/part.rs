//! One mesh of an archive: what is the same in all frames, and its frames.

use std::collections::BTreeMap;
use std::io::{self, Seek, Write};
use std::ops::Range;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{NO_MATERIAL, Part, PartRange, SharedNormals, Subdivision, Surface};

use super::ogawa::Sink;
use super::parameter::{Parameter, clockwise};
use super::tables::{Child, Compound, Metadata, Values, Written, write_object};
use super::{DATA, FRAMES};
use crate::alembic::properties::{F32, F64, I32, Kind, TEXT, U32};
use crate::names::Names;
use crate::scene::bounds;

const MESH: &str = "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const MESH_OBJECT: &str =
    "schema=AbcGeom_PolyMesh_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_PolyMesh_v1:.geom";
const SUBDIVISION: &str = "schema=AbcGeom_SubD_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const SUBDIVISION_OBJECT: &str =
    "schema=AbcGeom_SubD_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_SubD_v1:.geom";
const SET: &str = "schema=AbcGeom_FaceSet_v1;schemaBaseType=AbcGeom_GeomBase_v1";
const SET_OBJECT: &str =
    "schema=AbcGeom_FaceSet_v1;schemaBaseType=AbcGeom_GeomBase_v1;schemaObjTitle=AbcGeom_FaceSet_v1:.faceset";

/// A mesh of which frames are being written. Memory grows by 24 bytes for each, and by 16 where it has normals.
pub(super) struct PartWriter {
    points: Range<usize>,
    subdivision: Subdivision,
    /// Properties that are the same in all frames: type of the numbers, and the sample.
    still: Vec<(&'static str, u8, u64)>,
    uv: Option<Parameter>,
    others: Vec<Parameter>,
    normals: Option<(SharedNormals, Parameter)>,
    sets: Vec<FaceSet>,
    positions: Vec<u64>,
    bounds: Vec<u64>,
}

struct FaceSet {
    name: String,
    faces: u64,
    is_material: bool,
}

impl PartWriter {
    /// Writes what is the same in all frames of a part of a model.
    pub(super) fn new<W: Write + Seek>(
        sink: &mut Sink<W>,
        (part, range): (&Part, PartRange),
        faces: &Polygons,
        surface: &Surface,
    ) -> io::Result<Self> {
        let local = range.local(faces);
        let counts: Vec<u8> = local.arities().iter().flat_map(|count| count.to_le_bytes()).collect();
        let mut still = vec![
            (".faceIndices", I32, sink.sample(&clockwise(&local, local.indices()))?),
            (".faceCounts", I32, sink.sample(&counts)?),
        ];
        let (mut uv, mut others, mut names) = (None, Vec::new(), Names::default());
        for (k, set) in part.uv_sets.iter().enumerate() {
            if k == 0 {
                uv = Some(Parameter::new(sink, "uv", &local, set)?.with_source(&set.name));
                continue;
            }
            others.push(Parameter::new(sink, &names.add(&named(&set.name, "uv")), &local, set)?);
        }
        for set in &part.color_sets {
            others.push(Parameter::new(sink, &names.add(&named(&set.name, "Cd")), &local, set)?);
        }
        let mut normals = None;
        if part.subdivision == Subdivision::None {
            if !part.normals.is_empty() {
                let shared = SharedNormals::of(part, local.clone());
                let parameter = Parameter::normals(sink, &local, &shared)?;
                normals = Some((shared, parameter));
            }
        } else if !part.creases.is_empty() {
            let edges: Vec<u8> =
                part.creases.iter().flat_map(|crease| crease.edge).flat_map(u32::to_le_bytes).collect();
            let lengths = 2_u32.to_le_bytes().repeat(part.creases.len());
            let sharp: Vec<u8> = part.creases.iter().flat_map(|crease| crease.sharpness.to_le_bytes()).collect();
            still.push((".creaseIndices", I32, sink.sample(&edges)?));
            still.push((".creaseLengths", I32, sink.sample(&lengths)?));
            still.push((".creaseSharpnesses", F32, sink.sample(&sharp)?));
        }
        let (points, subdivision, sets) = (range.points, part.subdivision, sets(sink, part, surface)?);
        let (positions, bounds) = (Vec::new(), Vec::new());
        Ok(Self { points, subdivision, still, uv, others, normals, sets, positions, bounds })
    }

    /// Writes a frame, of whose points some are its own.
    pub(super) fn write_frame<W: Write + Seek>(
        &mut self,
        sink: &mut Sink<W>,
        points: &[[f32; 3]],
        bytes: &mut Vec<u8>,
    ) -> io::Result<()> {
        let points = &points[self.points.clone()];
        let positions = points.as_flattened();
        bytes.clear();
        bytes.extend(positions.iter().flat_map(|x| x.to_le_bytes()));
        // Arrays have their sizes beside them, where these are not those of a list.
        self.positions.extend([sink.sample(bytes)?, DATA]);
        let bounds: Vec<u8> =
            bounds(positions).as_flattened().iter().flat_map(|&x| f64::from(x).to_le_bytes()).collect();
        self.bounds.push(sink.sample(&bounds)?);
        if let Some((normals, parameter)) = &mut self.normals {
            let values = normals.at(|k| points[k as usize].map(f64::from));
            let values: Vec<f32> = values.as_flattened().iter().map(|&x| x as f32).collect();
            parameter.add_frame(sink, &values)?;
        }
        Ok(())
    }

    /// Writes the object with what `properties` has and the mesh, and the sets of faces below it.
    pub(super) fn finish<W: Write + Seek>(
        &self,
        sink: &mut Sink<W>,
        metadata: &mut Metadata,
        name: String,
        mut properties: Compound,
    ) -> io::Result<Child> {
        let moving = |kind, number, extent| Values { kind, number, extent, sampling: FRAMES };
        let still = |kind, number| Values { kind, number, extent: 1, sampling: 0 };
        let mut geometry = Compound::default();
        let bounds = (".selfBnds", "interpretation=box");
        geometry.add(sink, metadata, bounds, &self.bounds, &moving(Kind::Scalar, F64, 6))?;
        let positions = ("P", "geoScope=vtx;interpretation=point");
        geometry.add(sink, metadata, positions, &self.positions, &moving(Kind::Array, F32, 3))?;
        for &(name, number, sample) in &self.still {
            geometry.add(sink, metadata, (name, ""), &[sample, DATA], &still(Kind::Array, number))?;
        }
        if !self.others.is_empty() {
            let mut others = Compound::default();
            self.others.iter().try_for_each(|parameter| parameter.write(&mut others, sink, metadata))?;
            let others = others.write(sink)?;
            geometry.add_compound(metadata, (".arbGeomParams", ""), &others);
        }
        for parameter in self.uv.iter().chain(self.normals.as_ref().map(|(_, parameter)| parameter)) {
            parameter.write(&mut geometry, sink, metadata)?;
        }
        let scheme = match self.subdivision {
            Subdivision::None => None,
            Subdivision::CatmullClark => Some("catmull-clark"),
            Subdivision::Loop => Some("loop"),
            Subdivision::Bilinear => Some("bilinear"),
        };
        if let Some(scheme) = scheme {
            let sample = sink.sample(format!("{scheme}\0").as_bytes())?;
            geometry.add(sink, metadata, (".scheme", ""), &[sample], &still(Kind::Scalar, TEXT))?;
        }
        let (schema, object) = if scheme.is_some() { (SUBDIVISION, SUBDIVISION_OBJECT) } else { (MESH, MESH_OBJECT) };
        let geometry = geometry.write(sink)?;
        properties.add_compound(metadata, (".geom", schema), &geometry);
        let properties = properties.write(sink)?;
        let sets = self.sets.iter().map(|set| Ok((set.name.clone(), SET_OBJECT, set.write(sink, metadata)?)));
        let sets = sets.collect::<io::Result<Vec<_>>>()?;
        Ok((name, object, write_object(sink, metadata, &properties, &sets)?))
    }
}

/// A name without `/`, or another one where there is none.
fn named(name: &str, otherwise: &str) -> String {
    if name.is_empty() { otherwise.to_owned() } else { name.replace('/', "_") }
}

/// Writes the faces of each material of a part, and of its groups.
fn sets<W: Write + Seek>(sink: &mut Sink<W>, part: &Part, surface: &Surface) -> io::Result<Vec<FaceSet>> {
    let (mut found, mut names) = (Vec::new(), Names::default());
    let mut add = |name: String, is_material, faces: &[u32]| {
        let bytes: Vec<u8> = faces.iter().flat_map(|face| face.to_le_bytes()).collect();
        found.push(FaceSet { name: names.add(&name), faces: sink.sample(&bytes)?, is_material });
        io::Result::Ok(())
    };
    let mut of_material = BTreeMap::<u32, Vec<u32>>::new();
    for (face, &material) in (0..).zip(&part.materials).filter(|&(_, &material)| material != NO_MATERIAL) {
        of_material.entry(material).or_default().push(face);
    }
    for (material, faces) in of_material {
        add(named(&surface.materials[material as usize].name, "material"), true, &faces)?;
    }
    part.groups.iter().try_for_each(|group| add(named(&group.name, "group"), false, &group.faces))?;
    Ok(found)
}

impl FaceSet {
    fn write<W: Write + Seek>(&self, sink: &mut Sink<W>, metadata: &mut Metadata) -> io::Result<Written> {
        let still = |kind, number, extent| Values { kind, number, extent, sampling: 0 };
        let mut set = Compound::default();
        // The bounds of nothing, as programs write them.
        let nothing = [f64::MAX, f64::MAX, f64::MAX, f64::MIN, f64::MIN, f64::MIN].map(f64::to_le_bytes);
        let nothing = sink.sample(nothing.as_flattened())?;
        set.add(sink, metadata, (".selfBnds", "interpretation=box"), &[nothing], &still(Kind::Scalar, F64, 6))?;
        set.add(sink, metadata, (".faces", ""), &[self.faces, DATA], &still(Kind::Array, I32, 1))?;
        if self.is_material {
            let yes = sink.sample(&1_u32.to_le_bytes())?;
            set.add(sink, metadata, (".facesExclusive", ""), &[yes], &still(Kind::Scalar, U32, 1))?;
        }
        let set = set.write(sink)?;
        let mut properties = Compound::default();
        properties.add_compound(metadata, (".faceset", SET), &set);
        let properties = properties.write(sink)?;
        write_object(sink, metadata, &properties, &[])
    }
}
