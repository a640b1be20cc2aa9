//! What lies on the faces of an OBJ file: `vt`, `vn`, `usemtl`, `g` and `o` lines, and what corners name of them.

use std::collections::HashMap;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{CornerSet, FaceGroup, Material, NO_MATERIAL, Part, PartRange, Surface};

use crate::text::{integer, number, words};

/// Groups that faces may be in on average, beside those of any mesh.
const MOST_GROUPS_OF_FACE: usize = 16;
const MOST_GROUPS: usize = 1 << 16;
/// Of a corner that names none.
const NONE: u32 = u32::MAX;

/// Lines so far.
#[derive(Default)]
pub(super) struct SurfaceLines {
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Of each corner of the faces that are kept, then of the face that is read.
    corners: Vec<[u32; 2]>,
    materials: Names,
    material: u32,
    /// By face.
    faces: Vec<(u32, u32)>,
    groups: Names,
    /// Each combination of groups that a line named.
    group_lines: Vec<Vec<u32>>,
    objects: Vec<Object>,
    /// Files of materials.
    pub(super) libraries: Vec<String>,
}

/// Names in the order in which they came.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    numbers: HashMap<Vec<u8>, u32>,
}

impl Names {
    fn number(&mut self, name: &[u8]) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = self.list.len() as u32;
        self.list.push(String::from_utf8_lossy(name).into_owned());
        self.numbers.insert(name.to_vec(), number);
        number
    }
}

/// An `o` line, and how many points and faces came before it.
struct Object {
    name: String,
    points: usize,
    faces: usize,
}

/// What a `mtllib` line names.
pub(super) fn name_of_library(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest).replace('\\', "/")
}

impl SurfaceLines {
    /// Takes a line by its first word; `false` where it is none of these.
    pub(super) fn take(&mut self, keyword: &[u8], rest: &[u8], points: usize) -> bool {
        let mut numbers = words(rest).map(|word| number(word).filter(|x| x.is_finite()).unwrap_or(0.0) as f32);
        let mut next = || numbers.next().unwrap_or(0.0);
        match keyword {
            b"vt" => self.uvs.push([next(), next()]),
            b"vn" => self.normals.push([next(), next(), next()]),
            b"usemtl" => self.material = self.materials.number(rest) + 1,
            b"g" => {
                let names = words(rest).filter(|name| *name != b"default").map(|name| self.groups.number(name));
                let line = names.collect();
                self.group_lines.push(line);
            }
            b"o" => {
                let name = String::from_utf8_lossy(rest).replace('/', "_");
                self.objects.push(Object { name, points, faces: self.faces.len() });
            }
            b"mtllib" => self.libraries.push(name_of_library(rest)),
            _ => return false,
        }
        true
    }

    /// Takes what a corner `v/vt/vn` names beside its vertex.
    pub(super) fn corner(&mut self, word: &[u8]) {
        let mut parts = word.split(|&b| b == b'/').skip(1);
        let mut index = |count: usize| {
            let index = parts.next().and_then(integer::<i64>).unwrap_or(0);
            let from_zero = if index < 0 { count as i64 + index } else { index - 1 };
            u32::try_from(from_zero).ok().filter(|&k| (k as usize) < count).unwrap_or(NONE)
        };
        let corner = [index(self.uvs.len()), index(self.normals.len())];
        self.corners.push(corner);
    }

    /// Ends a face of so many corners.
    pub(super) fn face(&mut self, corners: usize, is_kept: bool) {
        if is_kept {
            self.faces.push((self.material, self.group_lines.len() as u32));
        } else {
            self.corners.truncate(self.corners.len() - corners);
        }
    }

    /// Puts it on the faces of the model, with the materials of `libraries` where they have the names.
    pub(super) fn finish(self, model: &mut Model) {
        let corners = model.faces.indices().len();
        if corners == 0 || self.corners.len() != corners || self.faces.len() != model.faces.len() {
            return;
        }
        let bounds = self.bounds(model);
        let mut surface = Surface::default();
        let mut first_corner = 0;
        for bound in bounds.windows(2) {
            let faces = bound[0].faces..bound[1].faces;
            let count = model.faces.arities()[faces.clone()].iter().map(|&arity| arity as usize).sum::<usize>();
            let of_corners = first_corner..first_corner + count;
            let of_part = &self.corners[of_corners.clone()];
            first_corner += count;
            let mut part = Part {
                path: bound[0].name.clone(),
                points: bound[1].points - bound[0].points,
                faces: faces.len(),
                ..Part::default()
            };
            part.uv_sets.extend(self.uv_set(of_part));
            if of_part.iter().all(|&[_, normal]| normal != NONE) {
                let points = bound[0].points..bound[1].points;
                let own = &model.points[points.clone()];
                let local = PartRange { points, faces: faces.clone(), corners: of_corners }.local(&model.faces);
                let normals: Vec<_> = of_part.iter().map(|&[_, normal]| self.normals[normal as usize]).collect();
                // Faces that reach into another object are refused below.
                part.take_normals(&local, |point| own.get(point as usize).copied().unwrap_or_default(), &normals);
            }
            let materials: Vec<u32> = self.faces[faces.clone()].iter().map(|&(material, _)| material).collect();
            if materials.iter().any(|&material| material > 0) {
                part.materials = materials.iter().map(|material| material.wrapping_sub(1)).collect();
            }
            part.groups = self.groups_of(&self.faces[faces]);
            surface.parts.push(part);
        }
        let named = |name: &String| Material { name: name.clone(), ..Material::default() };
        surface.materials = self.materials.list.iter().map(named).collect();
        debug_assert!(surface.parts.iter().flat_map(|part| &part.materials).all(|&k| k == NO_MATERIAL || k < 1 << 31));
        let says_something = surface.parts.len() > 1
            || surface.parts.iter().any(|part| {
                let is_bare = part.uv_sets.is_empty() && part.materials.is_empty() && part.groups.is_empty();
                !is_bare || part.has_normals_of_its_own(model.faces.indices())
            });
        if says_something {
            model.surface = surface;
        }
    }

    /// Where parts begin, and the end of the last: objects are parts where each has points of its own.
    fn bounds(&self, model: &Model) -> Vec<Object> {
        let end = Object { name: String::new(), points: model.points.len(), faces: model.faces.len() };
        let mut list: Vec<Object> = Vec::new();
        for object in &self.objects {
            let path = format!("/{}", object.name);
            match list.last_mut() {
                // Of an object without faces the next one takes the place.
                Some(last) if last.faces == object.faces && last.points == object.points => last.name = path,
                _ => list.push(Object { name: path, ..*object }),
            }
        }
        list.push(end);
        let is_whole = list[0].points == 0 && list[0].faces == 0 && list.len() > 1;
        let arities = model.faces.arities();
        let mut corner = 0;
        let own = list.windows(2).all(|bound| {
            let count: usize = arities[bound[0].faces..bound[1].faces].iter().map(|&arity| arity as usize).sum();
            let corners = &model.faces.indices()[corner..corner + count];
            corner += count;
            let points = bound[0].points..bound[1].points;
            corners.iter().all(|&point| points.contains(&(point as usize)))
        });
        if is_whole && own {
            return list;
        }
        let end = Object { name: String::new(), points: model.points.len(), faces: model.faces.len() };
        let name = if self.objects.len() == 1 { format!("/{}", self.objects[0].name) } else { String::new() };
        vec![Object { name, points: 0, faces: 0 }, end]
    }

    fn uv_set(&self, corners: &[[u32; 2]]) -> Option<CornerSet<2>> {
        if corners.iter().all(|&[uv, _]| uv == NONE) {
            return None;
        }
        let mut set = CornerSet::default();
        let mut numbers = HashMap::new();
        for &[uv, _] in corners {
            let number = *numbers.entry(uv).or_insert_with(|| {
                set.values.push(self.uvs.get(uv as usize).copied().unwrap_or_default());
                set.values.len() as u32 - 1
            });
            set.corners.push(number);
        }
        Some(set)
    }

    /// The groups of a part, where its faces are in more than one.
    fn groups_of(&self, faces: &[(u32, u32)]) -> Vec<FaceGroup> {
        let groups = |line: u32| line.checked_sub(1).map_or(&[][..], |line| &self.group_lines[line as usize]);
        if faces.windows(2).all(|pair| groups(pair[0].1) == groups(pair[1].1)) {
            return Vec::new();
        }
        // Of more groups than a mesh has at its faces, none is kept.
        let memberships: usize = faces.iter().map(|&(_, line)| groups(line).len()).sum();
        if memberships > MOST_GROUPS_OF_FACE * faces.len() + MOST_GROUPS {
            return Vec::new();
        }
        let mut found: Vec<FaceGroup> = Vec::new();
        let mut places = HashMap::new();
        for (face, &(_, line)) in (0..).zip(faces) {
            for &group in groups(line) {
                let place = *places.entry(group).or_insert_with(|| {
                    found.push(FaceGroup { name: self.groups.list[group as usize].clone(), faces: Vec::new() });
                    found.len() - 1
                });
                if found[place].faces.last() != Some(&face) {
                    found[place].faces.push(face);
                }
            }
        }
        found
    }
}
