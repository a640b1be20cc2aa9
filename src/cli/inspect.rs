//! `cager inspect`.

use super::args::InspectArgs;
use super::encode_summary::errors;
use super::stretches::StretchList;
use super::{counted, grouped, human_bytes, plain, print, warn};
use anyhow::Result;
use cager_capture::decode::{self, Container, DecodeError};
use cager_formats::missing_frames;
use cager_geometry::surface::{Part, PartRange};
use cager_proto::report::Report;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

pub(super) fn run(args: &InspectArgs) -> Result<()> {
    let Some(list) = StretchList::read(&args.input)? else {
        let found = Inspected::of(&args.input, decode::open(&args.input)?)?;
        if args.json {
            return print(&format!("{}\n", serde_json::to_string_pretty(&found)?));
        }
        return found.tell(&args.input);
    };
    let mut all = Vec::new();
    for (path, container) in list.containers(&args.input)? {
        let found = Inspected::of(&path, container)?;
        all.push((path, found));
    }
    if args.json {
        let all: Vec<&Inspected> = all.iter().map(|(_, found)| found).collect();
        return print(&format!("{}\n", serde_json::to_string_pretty(&all)?));
    }
    all.iter().try_for_each(|(path, found)| found.tell(path))
}

/// What `--json` prints.
#[derive(Serialize)]
struct Inspected {
    #[serde(flatten)]
    report: Report,
    parts: Vec<PartOf>,
    /// None where the whole cage carries every part.
    components: Vec<Component>,
    layers: Vec<Layer>,
    sections: Vec<Section>,
}

/// A part of the model: where its points and faces lie among those of the file, and what lies on them.
#[derive(Serialize)]
struct PartOf {
    path: String,
    first_point: usize,
    points: usize,
    first_face: usize,
    faces: usize,
    uv_sets: Vec<String>,
    color_sets: Vec<String>,
    materials: Vec<String>,
    /// Frames in which it is shown, from and to below, counted from 0; null where it always is.
    shown: Option<Vec<[u32; 2]>>,
}

/// A component of the cage, and the parts that it carries.
#[derive(Serialize)]
struct Component {
    first_vertex: u32,
    vertices: u32,
    /// By their paths.
    parts: Vec<String>,
}

/// A layer of edits.
#[derive(Serialize)]
struct Layer {
    /// From 1, in the order in which they are applied.
    number: usize,
    name: String,
    on: bool,
    /// The numbers of the first and the last frame.
    first: f64,
    last: f64,
    frames: usize,
    vertices: usize,
    bytes: u64,
}

impl Inspected {
    fn of(path: &Path, mut container: Container) -> Result<Self> {
        let fail = |cause| DecodeError::container(path, cause);
        container.verify().map_err(fail)?;
        let report = container.report().map_err(fail)?;
        let layers = layers(&mut container).map_err(fail)?;
        let parts = parts(&mut container).map_err(fail)?;
        let components = components(&mut container, &parts).map_err(fail)?;
        Ok(Self { report, parts, components, layers, sections: sections(&container) })
    }

    fn tell(&self, path: &Path) -> Result<()> {
        warn(&self.report.warnings);
        print(&self.as_text(&path.display().to_string())?)
    }

    fn as_text(&self, name: &str) -> Result<String> {
        let Self { report, parts, components, layers, sections } = self;
        let mut out = String::new();
        writeln!(out, "{name}: {}, every checksum matches", human_bytes(report.bytes.output))?;
        let (frames, points) = (counted(report.frames, "frame"), counted(report.points, "point"));
        writeln!(out, "  capture   {frames} of {points}")?;
        numbers(&mut out, report)?;
        if let Some([x, y, z]) = report.origin {
            writeln!(out, "  origin    {x} {y} {z}, added to all positions")?;
        }
        let unit = report.metres_per_unit.map(|metres| format!("1 is {metres} m"));
        let up = report.up.as_ref().map(|up| format!("{} up", plain(up).to_uppercase()));
        if let Some(units) = unit.into_iter().chain(up).reduce(|unit, up| format!("{unit}, {up}")) {
            writeln!(out, "  units     {units}")?;
        }
        for (k, part) in parts.iter().enumerate() {
            writeln!(out, "  {}{}", if k == 0 { "parts     " } else { "          " }, part.as_text())?;
        }
        let (vertices, faces) = (grouped(report.cage_vertices), grouped(report.cage_faces));
        writeln!(out, "  cage      {vertices} vertices, {faces} faces")?;
        for Component { first_vertex, vertices, parts } in components {
            let parts: Vec<String> = parts.iter().map(|path| plain(path)).collect();
            writeln!(out, "            {vertices} vertices from {first_vertex} carry {}", parts.join(" "))?;
        }
        // How many are read is known where not every point is.
        let read = match report.handle_indices.len() {
            count if count > 0 && report.handles != "all" => format!(" ({count})"),
            _ => String::new(),
        };
        writeln!(
            out,
            "  solver    coordinates {}, handles {}{read}, regularizer {}, spectrum {}, lambda {}",
            plain(&report.coordinates),
            plain(&report.handles),
            plain(&report.regularizer),
            report.spectrum,
            report.lambda
        )?;
        if !report.generator.is_empty() {
            encoded(&mut out, report, layers.iter().any(|layer| layer.on))?;
        }
        for layer in layers {
            let Layer { number, on, first, last, vertices, bytes, .. } = layer;
            let name = if layer.name.is_empty() { String::new() } else { format!(" {}", plain(&layer.name)) };
            let (state, bytes) = (if *on { "on" } else { "off" }, human_bytes(*bytes));
            let frames = if layer.frames == 1 { format!("frame {first}") } else { format!("frames {first} to {last}") };
            let moved = if *vertices == 1 { "vertex" } else { "vertices" };
            writeln!(out, "  layer {number:<4}{state}{name}: {frames}, {} {moved}, {bytes}", grouped(*vertices))?;
        }
        writeln!(out, "  sections  {:<6}{:>8}{:>12}{:>12}{:>8}", "tag", "number", "stored", "decoded", "share")?;
        for s in sections {
            let (bytes, raw_bytes) = (human_bytes(s.bytes), human_bytes(s.raw_bytes));
            let share = 100.0 * s.bytes as f64 / report.bytes.output.max(1) as f64;
            writeln!(out, "            {:<6}{:>8}{bytes:>12}{raw_bytes:>12}{share:>6.1} %", s.tag, s.count)?;
        }
        Ok(out)
    }
}

impl PartOf {
    fn as_text(&self) -> String {
        let path = if self.path.is_empty() { "one".to_owned() } else { plain(&self.path) };
        let mut text = format!("{path}: {} from {}", counted(self.points, "point"), grouped(self.first_point));
        text += &format!(", {}", counted(self.faces, "face"));
        let sets =
            [("texture coordinates", &self.uv_sets), ("colours", &self.color_sets), ("materials", &self.materials)];
        for (what, names) in sets.into_iter().filter(|(_, names)| !names.is_empty()) {
            let names: Vec<String> = names.iter().filter(|name| !name.is_empty()).map(|name| plain(name)).collect();
            text += &format!(", {what}");
            text += &if names.is_empty() { String::new() } else { format!(" {}", names.join(" ")) };
        }
        if self.shown.is_some() {
            text += ", hidden in some frames";
        }
        text
    }
}

fn parts(container: &mut Container) -> Result<Vec<PartOf>, cager_proto::container::Error> {
    let Some((surface, faces)) = container.surface()? else { return Ok(Vec::new()) };
    let names = |part: &Part| {
        let used: BTreeSet<u32> = part.materials.iter().copied().collect();
        used.iter().filter_map(|&k| Some(surface.materials.get(k as usize)?.name.clone())).collect()
    };
    let of = |(part, range): (&Part, PartRange)| PartOf {
        path: part.path.clone(),
        first_point: range.points.start,
        points: part.points,
        first_face: range.faces.start,
        faces: part.faces,
        uv_sets: part.uv_sets.iter().map(|set| set.name.clone()).collect(),
        color_sets: part.color_sets.iter().map(|set| set.name.clone()).collect(),
        materials: names(part),
        shown: part.shown.as_ref().map(|shown| shown.iter().map(|range| [range.start, range.end]).collect()),
    };
    Ok(surface.ranges(&faces).map(of).collect())
}

/// In the order of their vertices, with the parts that they carry.
fn components(container: &mut Container, parts: &[PartOf]) -> Result<Vec<Component>, cager_proto::container::Error> {
    let mut components: BTreeMap<u32, Component> = BTreeMap::new();
    for carrier in container.carriers()? {
        let (first_vertex, vertices) = (carrier.vertices.start, carrier.vertices.end - carrier.vertices.start);
        let new = Component { first_vertex, vertices, parts: Vec::new() };
        let component = components.entry(first_vertex).or_insert(new);
        let is_carried = |part: &&PartOf| carrier.points.contains(&(part.first_point as u32)) && part.points > 0;
        component.parts.extend(parts.iter().filter(is_carried).map(|part| part.path.clone()));
    }
    Ok(components.into_values().collect())
}

/// All of them; frames by their numbers.
fn layers(container: &mut Container) -> Result<Vec<Layer>, cager_proto::container::Error> {
    let numbers = container.frame_numbers()?;
    let bytes: Vec<u64> = container.sections().iter().filter(|s| s.tag == "EDIT").map(|s| s.bytes).collect();
    let number = |frame: usize| numbers.get(frame).copied().unwrap_or(frame as f64);
    let listed = container.layers()?.iter().zip(bytes).enumerate().map(|(k, (layer, bytes))| Layer {
        number: k + 1,
        name: layer.name.clone(),
        on: layer.is_on,
        first: number(layer.frames().start),
        last: number(layer.frames().end.saturating_sub(1)),
        frames: layer.frames().count(),
        vertices: layer.vertices.len(),
        bytes,
    });
    Ok(listed.collect())
}

/// Sections of one kind added up.
#[derive(Default, Serialize)]
struct Section {
    tag: String,
    count: usize,
    bytes: u64,
    raw_bytes: u64,
}

/// One for each kind, in the order of the file.
fn sections(container: &Container) -> Vec<Section> {
    let mut kinds: Vec<Section> = Vec::new();
    for section in container.sections() {
        let at = kinds.iter().position(|kind| kind.tag == section.tag).unwrap_or_else(|| {
            kinds.push(Section { tag: section.tag, ..Section::default() });
            kinds.len() - 1
        });
        kinds[at].count += 1;
        kinds[at].bytes += section.bytes;
        kinds[at].raw_bytes += section.raw_bytes;
    }
    kinds
}

fn numbers(out: &mut String, report: &Report) -> Result<()> {
    let rate = report.frame_rate.map(|rate| format!(", {rate} frames per second")).unwrap_or_default();
    let numbers = &report.frame_numbers;
    if let [first, .., last] | [first @ last] = numbers[..] {
        let gaps = missing_frames(numbers).map(|missing| format!(" without {missing}")).unwrap_or_default();
        writeln!(out, "  numbers   {first} to {last}{gaps}{rate}")?;
    } else if !rate.is_empty() && report.frames > 0 {
        writeln!(out, "  numbers   0 to {}{rate}", report.frames - 1)?;
    }
    Ok(())
}

/// What only the encoder can tell, of frames that are edited or not.
fn encoded(out: &mut String, report: &Report, is_edited: bool) -> Result<()> {
    let e = &report.error;
    writeln!(out, "  written   by {}", plain(&report.generator))?;
    let capture = human_bytes(report.bytes.capture);
    writeln!(out, "  size      {:.1} times smaller than {capture}", report.bytes.ratio)?;
    if e.l2_mean.is_nan() {
        writeln!(out, "  error     not measured, or not of every frame (--json has those that are)")?;
    } else {
        writeln!(out, "  error     {}", errors(e))?;
    }
    if let Some(coding) = &report.coding {
        let percent = |x: f64| format!("{:.4} %", 100.0 * x);
        let from = if is_edited { " from the captured motion with its edits added" } else { "" };
        let bound = coding.max_error.map_or_else(String::new, |error| {
            format!("every point of every frame guaranteed within {} of the diagonal{from}; ", percent(error))
        });
        let residual = coding.residual_step.map_or_else(String::new, |step| format!(", residual {}", percent(step)));
        writeln!(
            out,
            "  coding    {bound}steps: cages {}{residual}; groups of up to {} frames",
            percent(coding.cage_step),
            coding.group_frames
        )?;
    }
    let values = match report.singular_values[..] {
        [first, .., last] => format!("{first:.4} … {last:.4e}, "),
        _ => String::new(),
    };
    writeln!(
        out,
        "  spectrum  {values}rank {} of {}; condition {:.1} (all points {:.1})",
        report.rank, report.unknowns, report.condition_number.handles, report.condition_number.full
    )?;
    Ok(())
}
