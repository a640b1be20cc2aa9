//! What a binary layer says of value clips: dictionaries in one of these.

use super::file::{File, Rep};
use super::kind;
use super::sections::Sections;
use crate::error::Fault;
use crate::scene::damaged;
use crate::usd::clips::{Clips, Entry, MOST_CLIPS, MOST_PAIRS};

/// Entries of a dictionary; programs write ten.
const MOST: u64 = 64;

/// The only sequence of clips; none where there are several, or where one has what is not read.
pub(super) fn read(file: &mut File<'_>, sections: &Sections, rep: Rep) -> Result<Option<Clips>, Fault> {
    let Some(all) = dictionary(file, sections, rep)? else { return Ok(None) };
    let [(_, only)] = all[..] else { return Ok(None) };
    let Some(fields) = dictionary(file, sections, only)? else { return Ok(None) };
    let mut clips = Clips::default();
    for (name, rep) in fields {
        let Some(entry) = entry(file, sections, rep)? else { return Ok(None) };
        if !clips.take(&name, entry) {
            return Ok(None);
        }
    }
    Ok(Some(clips))
}

/// Names and values; each value stands behind its place, which is told as the distance to it.
fn dictionary(file: &mut File<'_>, sections: &Sections, rep: Rep) -> Result<Option<Vec<(String, Rep)>>, Fault> {
    if rep.kind() != kind::DICTIONARY || rep.is_inlined() {
        return Ok(None);
    }
    let count = file.source.number(rep.offset())?;
    if count > MOST {
        return Ok(None);
    }
    let (mut entries, mut at) = (Vec::new(), rep.offset() + 8);
    for _ in 0..count {
        let name = sections.string(u32::from_le_bytes(file.source.array(at)?));
        let place = (at + 4).checked_add(file.source.number(at + 4)?);
        let place = place.ok_or_else(|| damaged("an offset leads out of the file"))?;
        entries.push((name, Rep(file.source.number(place)?)));
        at = place + 8;
    }
    Ok(Some(entries))
}

fn entry(file: &mut File<'_>, sections: &Sections, rep: Rep) -> Result<Option<Entry>, Fault> {
    let text = |index: u32| String::from_utf8_lossy(sections.token(index)).into_owned();
    let small = u32::from_le_bytes(rep.inlined());
    Ok(Some(match (rep.kind(), rep.is_array()) {
        (kind::STRING, false) if rep.is_inlined() => Entry::Text(sections.string(small)),
        (kind::TOKEN | kind::ASSET, false) if rep.is_inlined() => Entry::Text(text(small)),
        (kind::BOOL, false) => Entry::Number(small.into()),
        (kind::DOUBLE | kind::FLOAT | kind::INT, false) => Entry::Number(file.numbers(rep)?[0]),
        (kind::VEC2D, true) => Entry::Pairs(file.vectors(rep, 2, MOST_PAIRS as u64)?.as_chunks().0.to_vec()),
        (kind::ASSET, true) => {
            let (start, count) = file.elements(rep)?;
            if count > MOST_CLIPS as u64 {
                return Ok(None);
            }
            let mut files = Vec::new();
            for index in file.source.bytes(start, count, 4)?.as_chunks().0 {
                files.push(sections.string(u32::from_le_bytes(*index)));
            }
            file.source.allowance.take(files.iter().map(|file| file.len() as u64 + 24).sum(), 1)?;
            Entry::Texts(files)
        }
        _ => return Ok(None),
    }))
}
