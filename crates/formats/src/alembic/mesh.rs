//! What an archive says of polygon meshes and the transforms above them.

use std::collections::{HashMap, HashSet};
use std::io::{Read, Seek};
use std::sync::Arc;

use cager_geometry::surface::Part;

use super::instances::Room;
use super::objects::{Archive, Kind as ObjectKind, Object};
use super::ogawa::DOUBLES;
use super::properties::{BOOL, F32, F64, I32, Kind, Property, U8, U32, find};
use super::sampling::{Sampling, timing};
use super::surface::{self, Materials};
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::scene::{
    Chain, MOST_OPERATIONS, MeshTracks, MovingScene, Operation, SceneTracks, Steps, Timeline, Track, Tree, Visibility,
    Wanted, ancestry, check_held, choose, damaged, no_points, path, said, union,
};

/// Of what is shown or hidden as what is above it.
const DEFERRED: i8 = -1;
/// Frames per second where an archive does not say them.
const USUAL_RATE: f64 = 24.0;
/// Shares of the mean distance of two samples within which two times are one.
const NEAR: f64 = 1e-6;

/// Opens the meshes that are wanted; tells what lies on their faces, and what is not read of them,
/// where that is wanted.
pub(crate) fn open<'a>(
    source: impl Read + Seek + Send + 'a,
    length: u64,
    wanted: Wanted<'_>,
    dropped: Option<&mut Dropped>,
) -> Result<MovingScene<'a>, Fault> {
    let mut archive = Archive::open(Box::new(source), length)?;
    let notes = archive.expand_instances()?;
    let objects = find_meshes(&mut archive, wanted, &notes)?;
    let mut tracks = SceneTracks { notes, ..SceneTracks::default() };
    let mut room = Room::of(&archive);
    let (mut moving, mut held, several) = (Vec::new(), Vec::new(), objects.len() > 1);
    let (mut visibility, mut groups) = (Visibility::default(), HashSet::new());
    for &object in &objects {
        let name = path(archive.nodes(), object);
        let named = |fault: Fault| if several { fault.within(&name) } else { fault };
        archive.container.allow(4);
        let (mut mesh, positions) = read_mesh(&mut archive, object, &mut moving).map_err(named)?;
        mesh.shown = visible(&mut archive, object, &mut visibility).map_err(named)?;
        if archive.objects[object].is_copy {
            let points = archive.points(object).unwrap_or(0);
            room.take(&mut archive, &mesh, points).map_err(named)?;
        }
        if groups.insert(positions.group) {
            held.push(positions);
        }
        tracks.meshes.push(mesh);
    }
    tracks.timeline = timeline(&mut archive, &held, &tracks.meshes, moving)?;
    let is_sparse = tracks.meshes.iter().any(|mesh| mesh.chain.moving().next().is_some());
    tracks.notes.extend(sparse(&tracks.timeline.at, archive.frame_rate).filter(|_| is_sparse));
    if let Some(dropped) = dropped {
        // What lies on faces is held, so that samples that meshes share are not free.
        archive.container.allow(8);
        let (mut materials, mut known) = (Materials::default(), HashMap::<u64, (Part, Vec<[f32; 3]>)>::new());
        for (mesh, &object) in tracks.meshes.iter_mut().zip(&objects) {
            let Object { group, is_copy, .. } = archive.objects[object];
            let read = match known.get(&group) {
                Some(read) => Ok(read.clone()),
                None => surface::read(&mut archive, object, &mut materials, dropped),
            };
            let Ok((part, normals)) = read else {
                // That is no reason to refuse a mesh.
                dropped.add_on_faces("what lies on faces, as it is damaged or too large");
                continue;
            };
            if is_copy {
                room.take_part(&part, normals.len())?;
                known.entry(group).or_insert_with(|| (part.clone(), normals.clone()));
            }
            mesh.part = Part { path: std::mem::take(&mut mesh.part.path), ..part };
            mesh.normals = normals;
        }
        tracks.materials = materials.list;
        archive.container.allow(4);
    }
    // Faces of instances are read once more for each.
    archive.container.source.allowance.0 = archive.container.source.allowance.0.saturating_add(room.taken);
    MovingScene::new(Box::new(archive.container), tracks)
}

/// A mesh, and its positions; adds the tables of times of what moves it.
fn read_mesh(
    archive: &mut Archive<'_>,
    object: usize,
    moving: &mut Vec<usize>,
) -> Result<(MeshTracks, Property), Fault> {
    let positions = positions(archive, object)?;
    let properties = archive.schema(object, ".geom")?;
    let parts = [array(&properties, ".faceCounts")?, array(&properties, ".faceIndices")?];
    if parts.iter().any(|faces| !matches!(faces.number, I32 | U32)) {
        return Err(damaged("its faces are not whole numbers of four bytes"));
    }
    let mut tracks = MeshTracks { is_clockwise: true, ..MeshTracks::default() };
    moving.extend(Some(positions.sampling).filter(|_| !positions.is_constant()));
    for above in ancestry(archive.nodes(), object).skip(1).collect::<Vec<_>>() {
        if archive.objects[above].kind == ObjectKind::Transform
            && !add_transform(archive, above, &mut tracks.chain, moving)?
        {
            break;
        }
    }
    tracks.positions = archive.track(&positions)?;
    if positions.number == F64 {
        let all = tracks.positions.values.iter_mut().chain(&mut tracks.positions.default);
        all.for_each(|value| value.0 |= DOUBLES);
    }
    tracks.faces = [archive.track(&parts[0])?, archive.track(&parts[1])?];
    tracks.part.path = path(archive.nodes(), object);
    Ok((tracks, positions))
}

/// The meshes that are wanted.
fn find_meshes(archive: &mut Archive<'_>, wanted: Wanted<'_>, missing: &[String]) -> Result<Vec<usize>, Fault> {
    let is_mesh = |&k: &usize| matches!(archive.objects[k].kind, ObjectKind::Mesh | ObjectKind::Subdivision);
    let meshes: Vec<usize> = (0..archive.objects.len()).filter(is_mesh).collect();
    match (meshes.is_empty(), missing.first()) {
        (false, _) => choose(archive, &meshes, wanted),
        (true, Some(missing)) => Err(Fault::invalid(format!("{missing}; export it with what it is of"))),
        (true, None) => Err(Fault::unsupported("holds no polygon mesh; export the mesh itself as Alembic")),
    }
}

/// When an object is shown: what is hidden hides what is below it, unless that says otherwise.
fn visible(archive: &mut Archive<'_>, object: usize, known: &mut Visibility) -> Result<Arc<Steps>, Fault> {
    let above: Vec<usize> = ancestry(&archive.nodes, object).collect();
    known.of(&above, |object| {
        let properties = archive.top_properties(object)?;
        let told = find(&properties, "visible", Kind::Scalar).filter(|told| told.samples > 0);
        let track = told.map_or(Ok(Track::default()), |told| archive.track(told))?;
        said(&track, |value| {
            let bytes = archive.container.small(value, 8, "visible")?;
            Ok(bytes.first().filter(|&&byte| byte as i8 != DEFERRED).map(|&byte| byte != 0))
        })
    })
}

impl Tree for Archive<'_> {
    fn nodes(&self) -> &[crate::scene::Node] {
        &self.nodes
    }

    fn points(&mut self, mesh: usize) -> Option<u64> {
        let positions = positions(self, mesh).ok()?;
        let first = positions.first(&mut self.container).ok()?;
        let size = if positions.number == F64 { 24 } else { 12 };
        Some(self.container.sample(first).ok()?.length / size)
    }
}

pub(super) fn array(properties: &[Property], name: &str) -> Result<Property, Fault> {
    let found = find(properties, name, Kind::Array).filter(|property| property.samples > 0);
    found.cloned().ok_or_else(|| Fault::invalid(format!("has a mesh without samples of {name}; export it again")))
}

fn positions(archive: &mut Archive<'_>, object: usize) -> Result<Property, Fault> {
    let positions = array(&archive.schema(object, ".geom")?, "P")?;
    if positions.extent != 3 || !matches!(positions.number, F32 | F64) {
        let what = "has positions that are not three numbers of single or double precision; export it again";
        return Err(Fault::unsupported(what));
    }
    Ok(positions)
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
    positions: &[Property],
    meshes: &[MeshTracks],
    mut moving: Vec<usize>,
) -> Result<Timeline, Fault> {
    let (length, mut bytes) = (archive.container.source.length, 0_u64);
    for positions in positions {
        let first = positions.first(&mut archive.container)?;
        bytes = bytes.saturating_add(archive.container.sample(first)?.length);
    }
    if bytes == 0 {
        return Err(no_points());
    }
    let is_held = |frames: usize| check_held(frames, bytes.saturating_mul(frames as u64) / 2 <= length);
    let of_mesh = |mesh: &'_ MeshTracks| {
        let moved = mesh.chain.moving().flatten();
        mesh.positions.times.iter().chain(moved).copied().collect::<Vec<f64>>()
    };
    let mut samples: Vec<f64> = meshes.iter().flat_map(of_mesh).collect();
    if samples.is_empty() {
        let longest = positions.iter().max_by_key(|positions| positions.samples);
        if let Some(positions) = longest {
            is_held(positions.samples)?;
            moving = vec![positions.sampling];
            samples = archive.samplings[positions.sampling].times(positions.samples)?;
        }
    }
    let [low, high] = [f64::min, f64::max].map(|pick| samples.iter().copied().reduce(pick).unwrap_or_default());
    let near = NEAR * (high - low) / samples.len() as f64;
    let at = union(samples, near);
    check_held(at.len(), (at.len() as u64).saturating_mul(4) <= length)?;
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
            "its transforms have samples up to {longest:.4} s apart, and the motion between them is not read; export \
             it with a sample of each frame"
        )
    })
}
