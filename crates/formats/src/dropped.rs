//! What models do not keep of their files, in one sentence with the formats' names.

use std::path::Path;

use cager_geometry::mesh::Model;
use cager_geometry::surface::{Part, Subdivision, Surface, Texture};

/// Names that a list shows, and characters of each.
const LISTED: usize = 4;
const SHOWN: usize = 40;

/// What the file of a mesh holds that is not read.
///
/// A reader adds a phrase for each kind, with the word of the format in brackets: `add` for what
/// belongs to points or to the whole, such as `normals (NORMAL)`, and `add_on_faces` for what
/// belongs to faces and their corners, such as `texture coordinates (vt)`. Phrases that begin with
/// a number come from `counted`, lists of names of any length from `listed`. A phrase that is added
/// twice is told once. Commands tell [`Self::sentence`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    phrases: Vec<String>,
    is_on_faces: bool,
}

impl Dropped {
    pub(crate) fn add(&mut self, phrase: impl Into<String>) {
        let phrase = phrase.into();
        if !self.phrases.contains(&phrase) {
            self.phrases.push(phrase);
        }
    }

    pub(crate) fn add_on_faces(&mut self, phrase: impl Into<String>) {
        self.is_on_faces = true;
        self.add(phrase);
    }

    /// Textures and materials alone: what of scans cannot be had otherwise.
    #[must_use]
    pub fn appearance(mut self) -> Self {
        self.phrases.retain(|phrase| phrase.contains("texture") || phrase.contains("material"));
        self
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.phrases.is_empty()
    }

    /// The colours of points, for outputs that have none.
    pub(crate) fn add_colors(&mut self, model: &Model) {
        if !model.colors.is_empty() {
            self.add("vertex colours");
        }
    }

    /// All that lies on the faces, for outputs that have none of it.
    pub(crate) fn add_surface(&mut self, surface: &Surface) {
        phrases_of(surface, false).into_iter().for_each(|phrase| self.add_on_faces(phrase));
    }

    /// `rest.obj: texture coordinates (vt) are not kept`; none where nothing is lost.
    /// `is_reordered` where faces are in an order of their own, so that what belongs to them cannot
    /// be put back by numbers.
    pub fn sentence(&self, path: &Path, is_reordered: bool) -> Option<String> {
        let all = joined(&self.phrases)?;
        let last = &self.phrases[0];
        let is_one = self.phrases.len() == 1 && ["1 ", "its "].iter().any(|start| last.starts_with(start));
        let are = if is_one { "is" } else { "are" };
        let order = if is_reordered && self.is_on_faces {
            ", nor is the order of faces and of their corners; --exact-rest keeps that order, for putting them back"
        } else {
            ""
        };
        Some(format!("{}: {all} {are} not kept{order}", path.display()))
    }
}

/// What lies on the faces, in words; where a format keeps most of it, what it still leaves out.
pub(crate) fn phrases_of(surface: &Surface, is_kept: bool) -> Vec<String> {
    let parts = &surface.parts;
    let most = |count: fn(&Part) -> usize| parts.iter().map(count).max().unwrap_or(0);
    let mut phrases = Vec::new();
    let uv_sets = most(|part| part.uv_sets.len());
    if uv_sets > 1 {
        phrases
            .push(format!("{uv_sets} sets of texture coordinates{}", if is_kept { ", but for the first" } else { "" }));
    } else if uv_sets == 1 && !is_kept {
        phrases.push("texture coordinates".to_owned());
    }
    if most(|part| part.color_sets.len()) > 0 {
        phrases.push("colours of corners".to_owned());
    }
    if parts.iter().any(|part| part.subdivision != Subdivision::None) {
        phrases.push("subdivision".to_owned());
    }
    if most(|part| part.creases.len()) > 0 {
        phrases.push("creases".to_owned());
    }
    if parts.iter().any(|part| part.shown.is_some()) {
        phrases.push("the frames in which parts are shown".to_owned());
    }
    if is_kept {
        let is_special = |texture: &Texture| !texture.uv_set.is_empty() || texture.component.is_some();
        if surface.materials.iter().flat_map(|material| &material.textures).any(is_special) {
            phrases.push("which texture coordinates and components textures have".to_owned());
        }
        return phrases;
    }
    if parts.len() > 1 {
        let names = parts.iter().map(|part| part.path.rsplit('/').next().unwrap_or_default().as_bytes());
        phrases.push(format!("{} ({})", counted(parts.len(), "part"), listed(names)));
    }
    if !surface.materials.is_empty() {
        phrases.push(counted(surface.materials.len(), "material"));
    }
    if most(|part| part.normals.len()) > 0 {
        phrases.push("normals".to_owned());
    }
    phrases.extend(groups_phrase(surface));
    phrases
}

/// `2 groups (left and right)`; none without groups.
pub(crate) fn groups_phrase(surface: &Surface) -> Option<String> {
    let groups = surface.parts.iter().flat_map(|part| &part.groups).map(|group| group.name.as_bytes());
    let count = groups.clone().count();
    (count > 0).then(|| format!("{} ({})", counted(count, "group"), listed(groups)))
}

/// Of formats with one picture for all frames.
pub(crate) fn sequences_phrase(surface: &Surface) -> Option<String> {
    surface.has_sequences().then(|| "the pictures of frames after the first".to_owned())
}

/// Phrases as one: `a, b and c`.
pub(crate) fn joined(phrases: &[String]) -> Option<String> {
    let (last, others) = phrases.split_last()?;
    Some(if others.is_empty() { last.clone() } else { format!("{} and {last}", others.join(", ")) })
}

/// `1 material`, `3 materials`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// The first names and how many there are beside them: `a, b and 7 more`.
pub(crate) fn listed<'a>(names: impl IntoIterator<Item = &'a [u8]>) -> String {
    let mut names = names.into_iter();
    let mut words: Vec<String> = names.by_ref().take(LISTED).map(shown).collect();
    match (names.count(), words.len()) {
        (0, 0 | 1) => words.concat(),
        (0, _) => {
            let last = words.pop().unwrap_or_default();
            format!("{} and {last}", words.join(", "))
        }
        (more, _) => format!("{} and {more} more", words.join(", ")),
    }
}

/// A name from a file as a sentence has it.
fn shown(name: &[u8]) -> String {
    let text = String::from_utf8_lossy(&name[..name.len().min(4 * SHOWN)]);
    let mut escaped = text.chars().flat_map(char::escape_debug);
    let start: String = escaped.by_ref().take(SHOWN).collect();
    if escaped.next().is_some() { start + "…" } else { start }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sentence_names_each_kind_once() {
        let told = |dropped: &Dropped| dropped.sentence(Path::new("a.obj"), true);
        let mut dropped = Dropped::default();
        assert_eq!(told(&dropped), None);
        dropped.add(counted(1, "material"));
        assert_eq!(told(&dropped).unwrap(), "a.obj: 1 material is not kept");
        dropped.add(counted(1, "material"));
        dropped.add("normals (vn)");
        assert_eq!(told(&dropped).unwrap(), "a.obj: 1 material and normals (vn) are not kept");
        dropped.add_on_faces("texture coordinates (vt)");
        let sentence = told(&dropped).unwrap();
        assert!(
            sentence.starts_with("a.obj: 1 material, normals (vn) and texture coordinates (vt) are not kept, nor ")
        );
        assert!(sentence.contains("--exact-rest"));
        assert!(!dropped.sentence(Path::new("a.obj"), false).unwrap().contains("order"));
    }

    #[test]
    fn lists_of_names_have_an_end() {
        let list = |names: &[&str]| listed(names.iter().map(|name| name.as_bytes()));
        assert_eq!(list(&["a"]), "a");
        assert_eq!(list(&["a", "b"]), "a and b");
        assert_eq!(list(&["a", "b", "c", "d", "e", "f"]), "a, b, c, d and 2 more");
        assert!(list(&["x".repeat(1 << 20).as_str(), "\u{1b}[1m"]).chars().count() < 60);
    }
}
