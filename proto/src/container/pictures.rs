//! The pictures that materials name: a list as JSON behind its length, then the bytes of each picture once.

use super::reader::ContainerReader;
use super::writer::ContainerWriter;
use super::{Error, tag};
use cager_geometry::surface::{MOST_PICTURES, Picture};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::{Read, Seek, Write};
use std::sync::Arc;

/// Which bytes a picture has.
#[derive(Deserialize, Serialize)]
struct Listed {
    path: String,
    /// Where they begin among those of all pictures, and how many they are.
    first: u64,
    bytes: u64,
}

impl<W: Write> ContainerWriter<W> {
    /// Adds the pictures of the materials, those with the same bytes once; nothing where there are none.
    ///
    /// # Errors
    /// An output that refuses.
    pub(super) fn write_pictures(&mut self, pictures: &[Picture]) -> Result<(), Error> {
        if pictures.is_empty() {
            return Ok(());
        }
        if pictures.len() > MOST_PICTURES {
            return Err(Error::TooLarge(format!("{} pictures, where {MOST_PICTURES} are the most", pictures.len())));
        }
        let (mut places, mut all) = (HashMap::new(), Vec::new());
        let listed: Vec<Listed> = pictures
            .iter()
            .map(|picture| {
                let first = *places.entry(&picture.bytes).or_insert_with(|| {
                    all.extend_from_slice(&picture.bytes);
                    (all.len() - picture.bytes.len()) as u64
                });
                Listed { path: picture.path.clone(), first, bytes: picture.bytes.len() as u64 }
            })
            .collect();
        let list = serde_json::to_vec(&listed).map_err(|e| Error::Invalid(e.to_string()))?;
        let length = u32::try_from(list.len()).map_err(|_| Error::TooLarge("names of 4 GiB".to_owned()))?;
        self.section(tag::PICTURES, &[&length.to_le_bytes()[..], &list, &all].concat())
    }
}

impl<R: Read + Seek> ContainerReader<R> {
    /// The pictures that the materials name, as far as the file has them.
    pub fn pictures(&mut self) -> Result<Vec<Picture>, Error> {
        let Some((offset, raw)) = self.optional(tag::PICTURES)? else { return Ok(Vec::new()) };
        let corrupt = |what: &str| Error::corrupt(offset, format!("the list of pictures {what}"));
        let (length, rest) = raw.split_first_chunk::<4>().ok_or_else(|| corrupt("is cut"))?;
        let (list, all) =
            rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(|| corrupt("is cut"))?;
        let listed: Vec<Listed> =
            serde_json::from_slice(list).map_err(|e| corrupt(&format!("cannot be read ({e})")))?;
        if listed.len() > MOST_PICTURES {
            return Err(corrupt("is longer than any program writes"));
        }
        let mut known: HashMap<(u64, u64), Arc<[u8]>> = HashMap::new();
        let mut picture = |Listed { path, first, bytes }| {
            let range = usize::try_from(first).ok()?..usize::try_from(first.checked_add(bytes)?).ok()?;
            // Pictures that overlap would take more memory than the file.
            let is_apart = known.keys().all(|&(start, count)| {
                (start, count) == (first, bytes) || first >= start + count || start >= first + bytes
            });
            let there = all.get(range)?;
            let bytes = known.entry((first, bytes)).or_insert_with(|| there.into());
            is_apart.then(|| Picture { path, bytes: Arc::clone(bytes) })
        };
        let pictures =
            listed.into_iter().map(|listed| picture(listed).ok_or_else(|| corrupt("names bytes that are not there")));
        pictures.collect()
    }
}
