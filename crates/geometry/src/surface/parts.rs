//! Some of the parts of a model, and some of its frames.

use super::{Part, Surface};
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
    /// The parts of which `is_chosen` is true, by their places.
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
        chosen
    }

    /// Says of the frames at these places when parts are shown.
    pub fn take_frames(&mut self, places: &[usize]) {
        for part in &mut self.parts {
            let Part { shown: Some(shown), .. } = part else { continue };
            let is_shown = |&place: &usize| shown.iter().any(|range| range.contains(&(place as u32)));
            part.shown = shown_in(places.iter().map(is_shown));
        }
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
    fn a_chosen_part_has_its_own_points_and_faces() {
        let mut faces = Polygons::new();
        [[0, 1, 2], [3, 4, 5], [6, 7, 8]].iter().for_each(|face| faces.push(face));
        let part = |path: &str| Part { path: path.to_owned(), points: 3, faces: 1, ..Part::default() };
        let surface = Surface { parts: ["/a", "/b", "/c"].map(part).to_vec(), ..Surface::default() };
        let chosen = surface.choose(&faces, |k| k != 1);
        assert_eq!((chosen.points, chosen.faces.indices()), (vec![0..3, 6..9], &[0, 1, 2, 3, 4, 5][..]));
        assert_eq!(chosen.surface.parts[1].path, "/c");
    }
}
