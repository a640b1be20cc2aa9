//! Some of the parts of a model, and some of its frames.

use super::{NO_MATERIAL, Part, Surface};
use crate::mesh::Polygons;
use std::ops::Range;

/// Some parts of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chosen {
    /// These parts alone.
    pub surface: Surface,
    /// Their faces, by the points that are kept.
    pub faces: Polygons,
    /// Which points of the model these are.
    pub points: Vec<Range<usize>>,
}

impl Surface {
    /// The parts of which `is_chosen` is true, by their places, with the materials and pictures that these have.
    pub fn choose(&self, faces: &Polygons, is_chosen: impl Fn(usize) -> bool) -> Chosen {
        let surface = Surface { parts: Vec::new(), ..self.clone() };
        let mut chosen = Chosen { surface, ..Chosen::default() };
        let mut first = 0;
        for (_, (part, range)) in self.ranges(faces).enumerate().filter(|&(k, _)| is_chosen(k)) {
            for face in range.local(faces).iter() {
                chosen.faces.push(&face.iter().map(|&point| point + first).collect::<Vec<_>>());
            }
            first += range.points.len() as u32;
            chosen.points.push(range.points);
            chosen.surface.parts.push(part.clone());
        }
        chosen.surface.drop_unused();
        chosen
    }

    /// Leaves out the materials that no face has, and the pictures that none of the others names.
    fn drop_unused(&mut self) {
        let mut is_used = vec![false; self.materials.len()];
        let numbers = self.parts.iter().flat_map(|part| &part.materials);
        numbers.filter(|&&number| number != NO_MATERIAL).for_each(|&number| is_used[number as usize] = true);
        let mut left = 0;
        let place = |&is_used: &bool| {
            left += u32::from(is_used);
            left.wrapping_sub(1)
        };
        let places: Vec<u32> = is_used.iter().map(place).collect();
        for number in self.parts.iter_mut().flat_map(|part| &mut part.materials) {
            *number = places.get(*number as usize).copied().unwrap_or(NO_MATERIAL);
        }
        let mut used = is_used.into_iter();
        self.materials.retain(|_| used.next() == Some(true));
        self.keep_named_pictures();
    }

    /// Says of the frames at these places when parts are shown, and which pictures materials have.
    pub fn take_frames(&mut self, places: &[usize]) {
        for part in &mut self.parts {
            let Part { shown: Some(shown), .. } = part else { continue };
            let is_shown = |&place: &usize| shown.iter().any(|range| range.contains(&(place as u32)));
            part.shown = shown_in(places.iter().map(is_shown));
        }
        for texture in self.materials.iter_mut().flat_map(|material| &mut material.textures) {
            if !texture.frames.is_empty() {
                texture.set_frames(places.iter().map(|&place| texture.at(place).to_owned()).collect());
            }
        }
    }

    /// Says nothing of frames any more: parts are always shown, and pictures the first ones.
    pub fn forget_frames(&mut self) {
        self.parts.iter_mut().for_each(|part| part.shown = None);
        self.keep_first_pictures();
    }

    /// Says of no frame any more that it has other pictures than the first.
    pub fn keep_first_pictures(&mut self) {
        let textures = self.materials.iter_mut().flat_map(|material| &mut material.textures);
        textures.for_each(|texture| texture.frames = Vec::new());
    }
}

/// The frames in which something is shown, as ranges; `None` where that is all of them.
pub fn shown_in(frames: impl Iterator<Item = bool>) -> Option<Vec<Range<u32>>> {
    let (mut found, mut count): (Vec<Range<u32>>, u32) = (Vec::new(), 0);
    for (frame, is_shown) in (0..).zip(frames) {
        count = frame + 1;
        match found.last_mut() {
            _ if !is_shown => {}
            Some(last) if last.end == frame => last.end = count,
            _ => found.push(frame..count),
        }
    }
    let is_always = count == 0 || matches!(found.as_slice(), [all] if *all == (0..count));
    (!is_always).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Channel, Material, Picture, Texture};

    #[test]
    fn frames_in_which_a_part_is_shown_are_ranges() {
        let one = |range: Range<u32>| Some(Vec::from([range]));
        let of = |text: &str| shown_in(text.chars().map(|c| c == '1'));
        assert_eq!((of("1111"), of("")), (None, None));
        assert_eq!(of("0011"), one(2..4));
        assert_eq!(of("10010"), Some(vec![0..1, 3..4]));
        assert_eq!(of("00"), Some(Vec::new()));
        let part = Part { shown: of("10010"), ..Part::default() };
        let mut surface = Surface { parts: vec![part], ..Surface::default() };
        surface.take_frames(&[1, 3, 4]);
        assert_eq!(surface.parts[0].shown, one(1..2));
        surface.take_frames(&[1]);
        assert_eq!(surface.parts[0].shown, None);
    }

    #[test]
    fn frames_that_are_taken_have_their_pictures() {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<String>>();
        let mut texture = Texture::new(Channel::BaseColor, "rest.png");
        texture.set_frames(names(&["0.png", "1.png", "1.png", "3.png"]));
        let materials = vec![Material { textures: vec![texture], ..Material::default() }];
        let mut surface = Surface { materials, ..Surface::default() };
        let taken = |places: &[usize]| {
            let mut surface = surface.clone();
            surface.take_frames(places);
            let texture = surface.materials.remove(0).textures.remove(0);
            (texture.path, texture.frames)
        };
        // The last one stays.
        assert_eq!(taken(&[0, 3, 7]), ("0.png".to_owned(), names(&["0.png", "3.png", "3.png"])));
        assert_eq!(taken(&[1, 2]), ("1.png".to_owned(), Vec::new()));
        assert!(surface.has_sequences());
        surface.forget_frames();
        assert_eq!(surface.materials[0].textures, [Texture::new(Channel::BaseColor, "0.png")]);
    }

    #[test]
    fn a_chosen_part_has_its_own_points_and_faces() {
        let mut faces = Polygons::new();
        [[0, 1, 2], [3, 4, 5], [6, 7, 8]].iter().for_each(|face| faces.push(face));
        let part = |(path, material): (&str, u32)| Part {
            path: path.to_owned(),
            points: 3,
            faces: 1,
            materials: vec![material],
            ..Part::default()
        };
        let material =
            |path: &str| Material { textures: vec![Texture::new(Channel::BaseColor, path)], ..Material::default() };
        let picture = |path: &str| Picture { path: path.to_owned(), bytes: [].into() };
        let surface = Surface {
            parts: [("/a", 2), ("/b", 1), ("/c", NO_MATERIAL)].map(part).to_vec(),
            materials: ["0.png", "1.png", "2.png"].map(material).to_vec(),
            pictures: ["0.png", "1.png", "2.png"].map(picture).to_vec(),
        };
        let chosen = surface.choose(&faces, |k| k != 1);
        assert_eq!(chosen.surface.parts.iter().map(|part| part.materials[0]).collect::<Vec<_>>(), [0, NO_MATERIAL]);
        assert_eq!(
            (chosen.surface.materials, chosen.surface.pictures),
            (vec![material("2.png")], vec![picture("2.png")])
        );
        let chosen = surface.choose(&faces, |k| k != 1);
        assert_eq!((chosen.points, chosen.faces.indices()), (vec![0..3, 6..9], &[0, 1, 2, 3, 4, 5][..]));
        assert_eq!(chosen.surface.parts[1].path, "/c");
    }
}
