//! Which pictures the materials of a surface name.

use super::Surface;
use std::collections::BTreeSet;

/// In the name of a picture that is several, one for each tile of texture coordinates.
pub const TILES: &str = "<UDIM>";

/// Pictures of a model at the most.
pub const MOST_PICTURES: usize = 1 << 12;

impl Surface {
    /// The names of all pictures, as often as textures have them.
    pub fn picture_names(&self) -> impl Iterator<Item = &str> {
        let textures = self.materials.iter().flat_map(|material| &material.textures);
        textures.flat_map(|texture| std::iter::once(&texture.path).chain(&texture.frames)).map(String::as_str)
    }

    /// Whether a material has another picture in another frame.
    pub fn has_sequences(&self) -> bool {
        self.materials.iter().flat_map(|material| &material.textures).any(|texture| !texture.frames.is_empty())
    }

    /// Leaves out the pictures that no material names.
    pub fn keep_named_pictures(&mut self) {
        let mut pictures = std::mem::take(&mut self.pictures);
        let named: BTreeSet<&str> = self.picture_names().collect();
        let tiles: Vec<&str> = named.iter().copied().filter(|name| name.contains(TILES)).collect();
        pictures.retain(|picture| {
            named.contains(&*picture.path) || tiles.iter().any(|name| tile(name, &picture.path).is_some())
        });
        self.pictures = pictures;
    }
}

/// The number of a tile, four digits, where the file `path` is one of those that `name` stands for.
pub fn tile<'a>(name: &str, path: &'a str) -> Option<&'a str> {
    let (before, after) = name.split_once(TILES)?;
    let number = path.strip_prefix(before)?.strip_suffix(after)?;
    (number.len() == 4 && number.bytes().all(|c| c.is_ascii_digit())).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Channel, Material, Picture, Texture};

    #[test]
    fn pictures_are_kept_by_name_or_as_tiles() {
        let texture = |path: &str| Texture::new(Channel::BaseColor, path);
        let textures = vec![texture("a.png"), texture("maps/skin.<UDIM>.png")];
        let picture = |path: &str| Picture { path: path.to_owned(), bytes: [].into() };
        let mut surface = Surface {
            materials: vec![Material { textures, ..Material::default() }],
            pictures: ["b.png", "a.png", "maps/skin.1001.png", "maps/skin.x.png", "maps/skin.png"]
                .map(picture)
                .to_vec(),
            ..Surface::default()
        };
        surface.keep_named_pictures();
        assert_eq!(surface.pictures, [picture("a.png"), picture("maps/skin.1001.png")]);
        assert_eq!(tile("maps/skin.<UDIM>.png", "maps/skin.1012.png"), Some("1012"));
        assert_eq!(tile("<UDIM>0.png", "100.png"), None);
    }
}
