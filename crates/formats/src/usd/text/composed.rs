//! What a text says of other prims and files, and of variants.

use super::parser::{Owner, Parser};
use crate::error::Fault;
use crate::scene::Node;
use crate::usd::layer::{Arc, DEEPEST, Prim, Variant, too_deep};

/// Arcs of one prim; programs write a handful.
const MOST_ARCS: usize = 64;

impl Parser<'_, '_> {
    /// Other prims and files that a value names, which is passed over; none where it is not plain.
    pub(super) fn arcs(&mut self, words: &'static str) -> Result<Option<Vec<Arc>>, Fault> {
        self.scanner.solid()?;
        let start = self.scanner.place();
        let (mut arcs, mut is_plain) = (Vec::new(), true);
        let is_list = self.scanner.has(b'[')?;
        while is_plain && !(is_list && self.scanner.solid()? == Some(b']')) {
            let mut arc = Arc { words, ..Arc::default() };
            if self.scanner.solid()? == Some(b'@') {
                arc.asset = self.scanner.enclosed()?;
                is_plain = !arc.asset.is_empty();
            }
            if self.scanner.solid()? == Some(b'<') {
                arc.prim = self.scanner.enclosed()?;
                is_plain &= !arc.prim.is_empty();
            }
            is_plain &= !(arc.asset.is_empty() && arc.prim.is_empty()) && arcs.len() < MOST_ARCS;
            if is_plain && self.scanner.has(b'(')? {
                while is_plain && !self.scanner.has(b')')? {
                    let key = self.word()?;
                    match key.as_str() {
                        "offset" => {
                            self.scanner.expect(b'=')?;
                            arc.times.offset = self.scanner.number()?;
                        }
                        "scale" => {
                            self.scanner.expect(b'=')?;
                            arc.times.scale = self.scanner.number()?;
                        }
                        _ => is_plain = false,
                    }
                }
            }
            arcs.push(arc);
            if !is_list || !self.scanner.has(b',')? {
                break;
            }
        }
        self.scanner.go(start)?;
        self.scanner.pass()?;
        Ok(Some(arcs).filter(|_| is_plain))
    }

    /// Whether a variant is next, or the end of their set.
    pub(super) fn is_in_set(&self) -> bool {
        self.sets.last().is_some_and(|(depth, ..)| *depth == self.open.len())
    }

    pub(super) fn variant(&mut self) -> Result<(), Fault> {
        let Some((_, prim, set)) = self.sets.last().cloned() else { return Ok(()) };
        if self.open.len() == DEEPEST as usize {
            return Err(too_deep());
        }
        let name = self.scanner.string()?;
        let (index, depth) = (self.contents.prims.len(), self.open.len() + 1);
        self.contents.nodes.push(Node { name: format!("{{{name}}}").into_bytes().into(), parent: None, depth });
        self.contents.prims.push(Prim::new(self.contents.prims[prim].kind, false));
        self.contents.prims[prim].vary(Variant { set, name, prim: index });
        if self.scanner.solid()? == Some(b'(') {
            self.fields(&Owner::Prim(index))?;
        }
        self.open.push(index);
        self.scanner.expect(b'{')
    }

    /// Which variants are chosen: strings by the names of sets.
    pub(super) fn chosen(&mut self, prim: usize) -> Result<(), Fault> {
        self.scanner.expect(b'{')?;
        while !self.scanner.has(b'}')? {
            self.word()?;
            let set = self.short()?;
            self.scanner.expect(b'=')?;
            let name = self.scanner.string()?;
            self.contents.prims[prim].chosen.push((set, name));
        }
        Ok(())
    }
}
