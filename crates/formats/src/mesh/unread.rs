//! Lines of OBJ files that models do not keep.

use std::collections::HashSet;

use super::parsed::Parsed;
use crate::dropped::{counted, listed};
use crate::text::words;

/// What was met beside points and faces.
#[derive(Default)]
pub(super) struct Unread<'a> {
    texture_coordinates: bool,
    normals: bool,
    /// ZBrush writes its colours in comments.
    painted: bool,
    materials: HashSet<&'a [u8]>,
    groups: HashSet<&'a [u8]>,
    objects: HashSet<&'a [u8]>,
    smoothing: HashSet<&'a [u8]>,
    lines: usize,
    free_form: bool,
}

impl<'a> Unread<'a> {
    /// Notes a line by its first word.
    pub(super) fn note(&mut self, keyword: &[u8], line: &'a [u8]) {
        let rest = || line[keyword.len()..].trim_ascii();
        match keyword {
            b"vt" => self.texture_coordinates = true,
            b"vn" => self.normals = true,
            b"#MRGB" => self.painted = true,
            b"usemtl" => drop(self.materials.insert(rest())),
            b"g" => drop(self.groups.insert(rest())),
            b"o" => drop(self.objects.insert(rest())),
            b"s" => {
                self.smoothing.extend(words(rest()).next());
            }
            b"l" => self.lines += 1,
            b"curv" | b"curv2" | b"surf" => self.free_form = true,
            _ => {}
        }
    }

    /// Tells what is lost. One object, one group and one kind of smoothing divide nothing.
    pub(super) fn tell(self, parsed: &mut Parsed) {
        let Parsed { model, dropped, .. } = parsed;
        if self.texture_coordinates {
            dropped.add_on_faces("texture coordinates (vt)");
        }
        if !self.materials.is_empty() {
            dropped.add_on_faces(counted(self.materials.len(), "material") + " (usemtl)");
        }
        if self.normals {
            let phrase = "normals (vn)";
            if model.faces.is_empty() { dropped.add(phrase) } else { dropped.add_on_faces(phrase) }
        }
        for (names, what, keyword) in [(self.groups, "group", "g"), (self.objects, "object", "o")] {
            if names.len() > 1 {
                let mut sorted: Vec<&[u8]> = names.iter().copied().collect();
                sorted.sort_unstable();
                let what = counted(names.len(), what);
                dropped.add_on_faces(format!("{what} ({keyword} {})", listed(sorted)));
            }
        }
        if self.smoothing.len() > 1 {
            dropped.add_on_faces("smoothing groups (s)");
        }
        if self.lines > 0 {
            dropped.add(counted(self.lines, "line") + " (l)");
        }
        if self.free_form {
            dropped.add("curves and surfaces (curv, surf)");
        }
        if self.painted {
            dropped.add("painted colours (#MRGB)");
        }
    }
}
