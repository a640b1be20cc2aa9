//! Which mesh of an archive is meant.

use std::io::{Read, Seek};

use super::mesh::Mesh;
use super::objects::{Archive, Kind};
use super::ogawa::Failure;
use super::properties::Kind as PropertyKind;
use super::properties::find;
use crate::error::Fault;

/// Meshes that a message lists, and characters of the name of each.
const LISTED: usize = 6;
const SHOWN: usize = 200;
/// Bytes of the path of what an instance is of.
const LONGEST_PATH: usize = 4096;

/// The mesh that `prim` names by its path, by its own name or by one of what it lies below; the only mesh whatever `prim` is, since that is given for
/// the rest pose and the capture alike, which may call it differently.
pub(super) fn choose<R: Read + Seek>(archive: &mut Archive<R>, prim: Option<&str>) -> Result<usize, Failure> {
    let is_candidate = |k: &usize| matches!(archive.objects[*k].kind, Kind::Mesh | Kind::Instance);
    let all: Vec<usize> = (0..archive.objects.len()).filter(is_candidate).collect();
    if all.is_empty() {
        return Err(Fault::unsupported("holds no polygon mesh; export the mesh itself as Alembic").into());
    }
    if let &[only] = all.as_slice()
        && archive.objects[only].kind == Kind::Mesh
    {
        return Ok(only);
    }
    let found = prim.map_or_else(|| all.clone(), |prim| named(archive, &all, prim));
    match (found.as_slice(), prim) {
        (&[only], _) if archive.objects[only].kind == Kind::Mesh => Ok(only),
        (&[only], _) => {
            let (path, source) = (shown(&archive.path(only)), source(archive, only)?);
            let what = format!(
                "{path} is an instance of {source}, which is not read; make instances real where it is exported, or export {source} alone"
            );
            Err(Fault::unsupported(what).into())
        }
        ([], Some(prim)) => {
            let what =
                format!("holds no mesh {}, but {}; give one of these with --prim", shown(prim), list(archive, &all));
            Err(Fault::invalid(what).into())
        }
        (several, _) => {
            let what = format!(
                "holds {} meshes, {}; choose one by its path with --prim, where the command has it, or export the one mesh alone",
                several.len(),
                list(archive, several)
            );
            Err(Fault::invalid(what).into())
        }
    }
}

/// The candidates that a path or a name picks.
fn named<R: Read + Seek>(archive: &Archive<R>, all: &[usize], prim: &str) -> Vec<usize> {
    if prim.contains('/') {
        let names = || prim.trim_matches('/').rsplit('/').map(str::as_bytes);
        let depth = names().count();
        // Name by name, as paths may be far longer than what the archive holds of them.
        let begins = |k: usize| {
            let above = archive.objects[k].depth.checked_sub(depth);
            above.is_some_and(|above| {
                archive.ancestry(k).skip(above).map(|k| archive.objects[k].name.as_slice()).eq(names())
            })
        };
        let below: Vec<usize> = all.iter().copied().filter(|&k| begins(k)).collect();
        let exactly: Vec<usize> = below.iter().copied().filter(|&k| archive.objects[k].depth == depth).collect();
        return if exactly.is_empty() { below } else { exactly };
    }
    let is_called = |k: usize| archive.objects[k].name == prim.as_bytes();
    let exactly: Vec<usize> = all.iter().copied().filter(|&k| is_called(k)).collect();
    let below = || all.iter().copied().filter(|&k| archive.ancestry(k).any(is_called)).collect();
    if exactly.is_empty() { below() } else { exactly }
}

/// Meshes with their points, as far as a message has room.
fn list<R: Read + Seek>(archive: &mut Archive<R>, meshes: &[usize]) -> String {
    let mut words = Vec::new();
    for &mesh in meshes.iter().take(LISTED) {
        let path = shown(&archive.path(mesh));
        words.push(match archive.objects[mesh].kind {
            Kind::Instance => format!("{path} (an instance)"),
            _ => match Mesh::open(archive, mesh).and_then(|opened| opened.points(&mut archive.container, 0)) {
                Ok((points, _)) => format!("{path} ({points} points)"),
                Err(_) => format!("{path} (unreadable)"),
            },
        });
    }
    if meshes.len() > LISTED {
        words.push(format!("{} more", meshes.len() - LISTED));
    }
    let last = words.pop().unwrap_or_default();
    if words.is_empty() { last } else { format!("{} and {last}", words.join(", ")) }
}

/// What an instance is of.
fn source<R: Read + Seek>(archive: &mut Archive<R>, instance: usize) -> Result<String, Failure> {
    let properties = archive.top_properties(instance)?;
    let Some(told) = find(&properties, ".instanceSource", PropertyKind::Scalar) else {
        return Ok("another object".to_owned());
    };
    let bytes = told.table(&mut archive.container, 0, LONGEST_PATH)?;
    Ok(shown(String::from_utf8_lossy(&bytes).trim_end_matches('\0')))
}

/// A name as messages have it.
fn shown(name: &str) -> String {
    let more = if name.chars().nth(SHOWN).is_some() { "…" } else { "" };
    name.chars().take(SHOWN).flat_map(char::escape_debug).collect::<String>() + more
}
