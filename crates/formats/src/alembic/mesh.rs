//! What an archive says of one polygon mesh and the transforms above it.

use std::io::{Read, Seek};

use super::objects::{Archive, Kind as ObjectKind};
use super::properties::{BOOL, F32, F64, I32, Kind, Property, U8, U32, find};
use super::sampling::{Sampling, timing};
use super::unread;
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::frames::Scalar;
use crate::scene::{
    Chain, MOST_OPERATIONS, MeshTracks, MovingMesh, Operation, Timeline, Tree, Values, ancestry, check_held, choose,
    damaged, no_points, shown, shown_path, union,
};

/// Bytes of the path of what an instance is of.
const LONGEST_PATH: u64 = 4096;
/// Frames per second where an archive does not say them.
const USUAL_RATE: f64 = 24.0;
/// Shares of the mean distance of two samples within which two times are one.
const NEAR: f64 = 1e-6;

/// Opens the mesh that `prim` names, or the only one; tells what is not read of it where that is
/// wanted.
pub(crate) fn open<'a>(
    source: impl Read + Seek + Send + 'a,
    length: u64,
    prim: Option<&str>,
    dropped: Option<&mut Dropped>,
) -> Result<MovingMesh<'a>, Fault> {
    let mut archive = Archive::open(Box::new(source), length)?;
    let object = find_mesh(&mut archive, prim)?;
    archive.container.allow(4);
    let (positions, scalar) = positions(&mut archive, object)?;
    archive.container.scalar = scalar;
    let properties = archive.schema(object, ".geom")?;
    let parts = [array(&properties, ".faceCounts")?, array(&properties, ".faceIndices")?];
    if parts.iter().any(|faces| !matches!(faces.number, I32 | U32)) {
        return Err(damaged("its faces are not whole numbers of four bytes"));
    }
    let mut tracks = MeshTracks { is_clockwise: true, ..MeshTracks::default() };
    let mut moving: Vec<usize> = Some(positions.sampling).filter(|_| !positions.is_constant()).into_iter().collect();
    for above in ancestry(archive.nodes(), object).skip(1).collect::<Vec<_>>() {
        if archive.objects[above].kind == ObjectKind::Transform
            && !add_transform(&mut archive, above, &mut tracks.chain, &mut moving)?
        {
            break;
        }
    }
    tracks.positions = archive.track(&positions)?;
    tracks.faces = [archive.track(&parts[0])?, archive.track(&parts[1])?];
    tracks.timeline = timeline(&mut archive, &positions, &tracks, moving)?;
    let is_sparse = tracks.chain.moving().next().is_some();
    tracks.notes.extend(sparse(&tracks.timeline.at, archive.frame_rate).filter(|_| is_sparse));
    tracks.notes.extend(unread::visibility(&mut archive, object).unwrap_or_default());
    if let Some(dropped) = dropped {
        archive.container.allow(4);
        // What cannot be named is no reason to refuse a mesh.
        unread::add(&mut archive, object, dropped).unwrap_or_default();
    }
    MovingMesh::new(Box::new(archive.container), tracks)
}

fn find_mesh(archive: &mut Archive<'_>, prim: Option<&str>) -> Result<usize, Fault> {
    let is_candidate = |k: &usize| matches!(archive.objects[*k].kind, ObjectKind::Mesh | ObjectKind::Instance);
    let all: Vec<usize> = (0..archive.objects.len()).filter(is_candidate).collect();
    if all.is_empty() {
        return Err(Fault::unsupported("holds no polygon mesh; export the mesh itself as Alembic"));
    }
    let chosen = choose(archive, &all, prim)?;
    if archive.objects[chosen].kind == ObjectKind::Mesh {
        return Ok(chosen);
    }
    let properties = archive.top_properties(chosen)?;
    let source = match find(&properties, ".instanceSource", Kind::Scalar) {
        Some(told) => {
            let bytes = told.small(&mut archive.container, LONGEST_PATH)?;
            shown(String::from_utf8_lossy(&bytes).trim_end_matches('\0'))
        }
        None => "another object".to_owned(),
    };
    let path = shown_path(archive.nodes(), chosen);
    let what = format!(
        "{path} is an instance of {source}, which is not read; make instances real where it is exported, or export {source} alone"
    );
    Err(Fault::unsupported(what))
}

impl Tree for Archive<'_> {
    fn nodes(&self) -> &[crate::scene::Node] {
        &self.nodes
    }

    fn describe(&mut self, mesh: usize) -> String {
        if self.objects[mesh].kind == ObjectKind::Instance {
            return "an instance".to_owned();
        }
        let points = positions(self, mesh).and_then(|(positions, scalar)| {
            self.container.scalar = scalar;
            let first = positions.first(&mut self.container)?;
            self.container.points(first)
        });
        points.map_or_else(|_| "unreadable".to_owned(), |points| format!("{} points", points.count))
    }
}

fn array(properties: &[Property], name: &str) -> Result<Property, Fault> {
    let found = find(properties, name, Kind::Array).filter(|property| property.samples > 0);
    found.cloned().ok_or_else(|| Fault::invalid(format!("has a mesh without samples of {name}; export it again")))
}

/// The positions of a mesh, and how they are stored.
fn positions(archive: &mut Archive<'_>, object: usize) -> Result<(Property, Scalar), Fault> {
    let positions = array(&archive.schema(object, ".geom")?, "P")?;
    let scalar = match (positions.extent, positions.number) {
        (3, F32) => Scalar::F32Little,
        (3, F64) => Scalar::F64Little,
        _ => {
            let what = "has positions that are not three numbers of single or double precision; export it again";
            return Err(Fault::unsupported(what));
        }
    };
    Ok((positions, scalar))
}

/// Adds a transform, and its times where it moves; gives whether what is above it moves it too.
fn add_transform(
    archive: &mut Archive<'_>,
    object: usize,
    chain: &mut Chain,
    moving: &mut Vec<usize>,
) -> Result<bool, Fault> {
    let properties = archive.schema(object, ".xform")?;
    let named = |name: &str| properties.iter().find(|property| property.name == name.as_bytes());
    if let (Some(operations), Some(values)) = (named(".ops"), named(".vals")) {
        if operations.number != U8 || values.number != F64 || values.samples == 0 || operations.samples == 0 {
            return Err(damaged("a transform has no numbers, or of an unknown type"));
        }
        let codes = operations.small(&mut archive.container, MOST_OPERATIONS as u64)?;
        let operations = codes.iter().map(|code| operation(code >> 4, codes.len())).collect::<Result<_, _>>()?;
        let track = archive.track(values)?;
        moving.extend(Some(values.sampling).filter(|_| !values.is_constant()));
        chain.push(&mut archive.container, track, operations, false)?;
    }
    let Some(told) = find(&properties, ".inherits", Kind::Scalar).filter(|told| told.number == BOOL) else {
        return Ok(true);
    };
    if !told.is_constant() {
        let what = "has a transform that is moved by what is above it in some frames only; bake it into the points";
        return Err(Fault::unsupported(what));
    }
    Ok(told.small(&mut archive.container, 1)?.first() != Some(&0))
}

/// An operation by its kind, of so many.
fn operation(kind: u8, count: usize) -> Result<Operation, Fault> {
    Ok(match kind {
        0 => Operation::Scale(0, 3),
        1 => Operation::Translate(0, 3),
        2 => Operation::Turn,
        3 if count == 1 => Operation::Rigid,
        3 => Operation::Matrix,
        4 => Operation::Rotate(&[0]),
        5 => Operation::Rotate(&[1]),
        6 => Operation::Rotate(&[2]),
        _ => return Err(Fault::unsupported("has a transform of an unknown kind; bake it into the points")),
    })
}

/// A frame at each sample of all that moves, `moving` the tables of its times, or of positions.
fn timeline(
    archive: &mut Archive<'_>,
    positions: &Property,
    tracks: &MeshTracks,
    mut moving: Vec<usize>,
) -> Result<Timeline, Fault> {
    let length = archive.container.source.length;
    let first = positions.first(&mut archive.container)?;
    let bytes = archive.container.sample(first)?.length;
    if bytes == 0 {
        return Err(no_points());
    }
    let is_held = |frames: usize| check_held(frames, bytes.saturating_mul(frames as u64) / 2 <= length);
    let moved = tracks.chain.moving().flatten();
    let mut samples: Vec<f64> = tracks.positions.times.iter().chain(moved).copied().collect();
    if samples.is_empty() {
        is_held(positions.samples)?;
        moving = vec![positions.sampling];
        samples = archive.samplings[positions.sampling].times(positions.samples)?;
    }
    check_held(samples.len(), (samples.len() as u64).saturating_mul(4) <= length)?;
    let [low, high] = [f64::min, f64::max].map(|pick| samples.iter().copied().reduce(pick).unwrap_or_default());
    let near = NEAR * (high - low) / samples.len() as f64;
    let at = union(samples, near);
    moving.sort_unstable();
    moving.dedup();
    is_held(at.len())?;
    let times = match moving.as_slice() {
        // What programs give that know no times.
        [0] => crate::frames::Times { frame_rate: archive.frame_rate, ..Default::default() },
        &[only] => timing(&at, archive.samplings[only].step(), archive.frame_rate)?,
        _ => timing(&at, Sampling::step_of(&at), archive.frame_rate)?,
    };
    Ok(Timeline { times, at })
}

/// A note of transforms whose samples are far apart: scenes show what is between.
fn sparse(times: &[f64], told: Option<f64>) -> Option<String> {
    let longest = times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    let frame = 1.0 / told.unwrap_or(USUAL_RATE).min(USUAL_RATE);
    (longest > 1.01 * frame).then(|| {
        format!(
            "its transforms have samples up to {longest:.4} s apart, and the motion between them is not read; export it with a sample of each frame"
        )
    })
}
