//! What a text says in round brackets of a layer, a prim or a property.

use super::parser::{Owner, Parser, is_wanted};
use super::scanner::is_letter;
use crate::error::Fault;
use crate::usd::layer::{COMPOSED, Kind, composed};

impl Parser<'_, '_> {
    /// What is said in round brackets of a layer, a prim or a property.
    pub(super) fn fields(&mut self, owner: &Owner) -> Result<(), Fault> {
        self.scanner.expect(b'(')?;
        while !self.scanner.has(b')')? {
            // A comment has no key.
            if matches!(self.scanner.solid()?, Some(b'"' | b'\'')) {
                self.scanner.string()?;
                continue;
            }
            let (key, is_removed) = self.key()?;
            self.scanner.expect(b'=')?;
            match (owner, self.open.last()) {
                (Owner::Layer, _) => self.layer_field(&key)?,
                (Owner::Prim(prim), _) => self.prim_field(*prim, &key, is_removed)?,
                (Owner::Property(name), Some(&prim)) if key == "interpolation" => {
                    let value = self.short()?;
                    if is_wanted(self.contents.prims[prim].kind, name) {
                        self.contents.interpolations.insert((prim, name.clone()), value);
                    }
                }
                (Owner::Property(name), Some(&prim))
                    if key == "weight" && self.contents.prims[prim].kind == Kind::Motion =>
                {
                    let weight = self.scanner.number()?;
                    self.contents.weights.insert((prim, name.clone()), weight);
                }
                (Owner::Property(_), _) => {
                    self.scanner.pass()?;
                }
            }
            // The prim in another file, and by how much its times are moved.
            while matches!(self.scanner.solid()?, Some(b'<' | b'(')) {
                self.scanner.pass()?;
            }
        }
        Ok(())
    }

    /// A value that is a word or a string; empty for others, which are passed over.
    pub(super) fn short(&mut self) -> Result<String, Fault> {
        match self.scanner.solid()? {
            Some(b'"' | b'\'') => self.scanner.string(),
            Some(byte) if is_letter(byte) || b"+-.".contains(&byte) => Ok(self.scanner.word(b"+-._")?.to_owned()),
            _ => self.scanner.pass().map(|_| String::new()),
        }
    }

    fn layer_field(&mut self, key: &str) -> Result<(), Fault> {
        if key == "subLayers" {
            let arcs = self.arcs("sublayers")?.ok_or_else(|| composed("the layer", "sublayers"))?;
            self.contents.stage.sublayers = arcs.into_iter().map(|arc| (arc.asset, arc.times)).collect();
            return Ok(());
        }
        let value = self.short()?;
        let number = value.parse().ok();
        let stage = &mut self.contents.stage;
        match key {
            "defaultPrim" => stage.default_prim = value,
            "upAxis" => stage.up_is_z = Some(value == "Z"),
            "metersPerUnit" => stage.metres_per_unit = number,
            "timeCodesPerSecond" => stage.time_codes_per_second = number,
            "framesPerSecond" => stage.frames_per_second = number,
            "startTimeCode" => stage.start = number,
            "endTimeCode" => stage.end = number,
            _ => {}
        }
        Ok(())
    }

    fn prim_field(&mut self, prim: usize, key: &str, is_removed: bool) -> Result<(), Fault> {
        if let Some((_, words)) = COMPOSED[..2].iter().find(|(field, _)| *field == key) {
            match self.arcs(words)?.filter(|_| !is_removed) {
                Some(arcs) => {
                    let all = &mut self.contents.prims[prim].arcs;
                    all.extend(arcs);
                    all.sort_by_key(|arc| arc.words == "payloads");
                }
                None => self.contents.prims[prim].composed = Some(words),
            }
            return Ok(());
        }
        if key == "variants" {
            return self.chosen(prim);
        }
        if key == "clips" && self.scanner.solid()? == Some(b'{') {
            let clips = self.clips()?;
            let prim = &mut self.contents.prims[prim];
            prim.composed = if clips.is_none() { Some("value clips") } else { prim.composed };
            prim.clips = clips.map(Box::new);
            return Ok(());
        }
        let value = self.short()?;
        let prim = &mut self.contents.prims[prim];
        if key == "active" {
            prim.is_inactive = matches!(value.as_str(), "false" | "0");
            prim.is_there &= !prim.is_inactive;
        }
        let told = COMPOSED.iter().find(|(field, _)| *field == key);
        prim.composed = told.map(|(_, words)| *words).or(prim.composed);
        Ok(())
    }
}
