//! Lines of OBJ files that models do not keep.

use std::collections::HashSet;

use super::parsed::Parsed;
use crate::dropped::counted;
use crate::text::words;

/// What was met beside points and faces.
#[derive(Default)]
pub(super) struct Unread<'a> {
    /// ZBrush writes its colours in comments.
    painted: bool,
    smoothing: HashSet<&'a [u8]>,
    lines: usize,
    free_form: bool,
}

impl<'a> Unread<'a> {
    /// Notes a line by its first word.
    pub(super) fn note(&mut self, keyword: &[u8], line: &'a [u8]) {
        let rest = || line[keyword.len()..].trim_ascii();
        match keyword {
            b"#MRGB" => self.painted = true,
            b"s" => {
                self.smoothing.extend(words(rest()).next());
            }
            b"l" => self.lines += 1,
            b"curv" | b"curv2" | b"surf" => self.free_form = true,
            _ => {}
        }
    }

    /// Tells what is lost. One kind of smoothing divides nothing.
    pub(super) fn tell(self, parsed: &mut Parsed) {
        let Parsed { model, dropped, .. } = parsed;
        // Normals say the same.
        if self.smoothing.len() > 1 && model.surface.parts.iter().all(|part| part.normals.is_empty()) {
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
