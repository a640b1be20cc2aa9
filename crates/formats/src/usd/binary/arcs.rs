//! What a binary layer names of other prims and files.

use super::file::{File, Rep};
use super::sections::{Sections, Spec};
use super::{FILLED, kind};
use crate::error::Fault;
use crate::usd::layer::{Arc, Times, composed};

/// Arcs of one prim and layers below one; programs write a handful.
const MOST: u64 = 64;

/// References or payloads, where they are one list to other prims and no more.
pub(super) fn read(
    file: &mut File<'_>,
    sections: &Sections,
    rep: Rep,
    words: &'static str,
) -> Result<Option<Vec<Arc>>, Fault> {
    let (mut at, mut count) = (rep.offset(), 1);
    if matches!(rep.kind(), kind::REFERENCE_LIST | kind::PAYLOAD_LIST) {
        let [head] = file.source.array(at)?;
        // Beside whether it is explicit.
        let lists = head & !1;
        if lists & FILLED != lists || lists.count_ones() != 1 {
            return Ok(None);
        }
        count = file.source.number(at + 1)?;
        at += 9;
    } else if rep.kind() != kind::PAYLOAD || rep.is_inlined() {
        return Ok(None);
    }
    if count > MOST {
        return Ok(None);
    }
    let mut arcs = Vec::new();
    for _ in 0..count {
        let [asset, prim] = [file.source.array(at)?, file.source.array(at + 4)?].map(u32::from_le_bytes);
        let mut arc = Arc { words, asset: sections.string(asset), prim: sections.path(prim), times: Times::default() };
        file.source.allowance.take((arc.asset.len() + arc.prim.len()) as u64, 1)?;
        at += 8;
        if rep.kind() == kind::REFERENCE_LIST || file.version >= 8 {
            arc.times = times(file, at)?;
            at += 16;
        }
        if rep.kind() == kind::REFERENCE_LIST {
            // Values of the user may follow, which have no fixed length.
            if file.source.number(at)? != 0 {
                return Ok(None);
            }
            at += 8;
        }
        arcs.push(arc);
    }
    Ok(Some(arcs))
}

fn times(file: &mut File<'_>, at: u64) -> Result<Times, Fault> {
    let [offset, scale] = [file.source.array(at)?, file.source.array(at + 8)?].map(f64::from_le_bytes);
    Ok(Times { offset, scale })
}

/// The layers below a layer.
pub(super) fn sublayers(file: &mut File<'_>, sections: &Sections, root: Spec) -> Result<Vec<(String, Times)>, Fault> {
    let Some(list) = sections.field(root, "subLayers")? else { return Ok(Vec::new()) };
    let count = file.source.number(list.offset())?;
    if list.kind() != kind::STRINGS || count > MOST {
        return Err(composed("the layer", "sublayers"));
    }
    let offsets = sections.field(root, "subLayerOffsets")?.filter(|rep| rep.kind() == kind::OFFSETS);
    let told = offsets.map_or(Ok(0), |rep| file.source.number(rep.offset()))?;
    let mut layers = Vec::new();
    for k in 0..count {
        let name = sections.string(u32::from_le_bytes(file.source.array(list.offset() + 8 + 4 * k)?));
        let moved = match offsets.filter(|_| k < told) {
            Some(rep) => times(file, rep.offset() + 8 + 16 * k)?,
            None => Times::default(),
        };
        layers.push((name, moved));
    }
    Ok(layers)
}

/// Sets of variants, and which one of each is chosen.
pub(super) fn chosen(file: &mut File<'_>, sections: &Sections, rep: Rep) -> Result<Vec<(String, String)>, Fault> {
    let mut chosen = Vec::new();
    if rep.kind() != kind::CHOSEN_VARIANTS || rep.is_inlined() {
        return Ok(chosen);
    }
    let count = file.source.number(rep.offset())?;
    let bytes = file.source.bytes(rep.offset() + 8, count, 8)?;
    for pair in bytes.as_chunks::<8>().0 {
        let [set, name] =
            [0, 4].map(|at| sections.string(u32::from_le_bytes([pair[at], pair[at + 1], pair[at + 2], pair[at + 3]])));
        file.source.allowance.take((set.len() + name.len()) as u64 + 48, 1)?;
        chosen.push((set, name));
    }
    Ok(chosen)
}
