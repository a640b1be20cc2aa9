//! Finishing of a simplified cage: vertices relaxed and edges flipped, as far as it stays valid.

use super::patch::{EnclosedPoints, FaceReplacement, PatchMesh, normal, quality};
use super::quadric::Quadric;
use glam::DVec3;

/// Weight of the middle of a vertex's neighbours beside its quadric.
const SMOOTHNESS: f64 = 0.12;

/// Makes faces more even and the surface smoother in some rounds.
pub(super) fn fair(mesh: &mut PatchMesh, quadrics: &[Quadric], enclosed: &EnclosedPoints) {
    for _ in 0..6 {
        flip_edges(mesh, enclosed);
        for v in 0..mesh.positions.len() as u32 {
            relax(mesh, v, quadrics[v as usize], enclosed);
        }
    }
    flip_edges(mesh, enclosed);
}

/// Moves a vertex towards where its quadric and the distance from its neighbours' middle are least.
fn relax(mesh: &mut PatchMesh, v: u32, quadric: Quadric, enclosed: &EnclosedPoints) {
    let ring = mesh.ring(v);
    let middle = ring.iter().map(|&w| mesh.positions[w as usize]).sum::<DVec3>() / ring.len() as f64;
    let at = mesh.positions[v as usize];
    let goal = quadric.least(middle, SMOOTHNESS);
    let old = mesh.around[v as usize].clone();
    let new: Vec<[u32; 3]> = old.iter().map(|&f| mesh.faces[f as usize]).collect();
    let worst = old.iter().map(|&f| quality(mesh.corners(f))).fold(1.0, f64::min);
    let mut replacement = FaceReplacement { old, new, moved: None };
    for share in [1.0, 0.5, 0.2] {
        replacement.moved = Some((v, at.lerp(goal, share)));
        let shaped = replacement.new.iter().zip(&replacement.old).all(|(&face, &f)| {
            let after = mesh.corners_after(face, replacement.moved);
            quality(after) >= worst.min(0.4) && normal(after).dot(normal(mesh.corners(f))) > 0.5
        });
        if shaped && mesh.check(&replacement, enclosed).is_ok() {
            mesh.apply(&replacement);
            return;
        }
    }
}

/// Flips edges of nearly coplanar faces where that makes the worse of the two better.
fn flip_edges(mesh: &mut PatchMesh, enclosed: &EnclosedPoints) {
    for f in 0..mesh.faces.len() as u32 {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| mesh.faces[f as usize][(k + i) % 3]);
            if b < a {
                continue;
            }
            let across = mesh.around[a as usize].iter().find(|&&g| g != f && mesh.faces[g as usize].contains(&b));
            let Some(&g) = across else { continue };
            let Some(&d) = mesh.faces[g as usize].iter().find(|&&v| v != a && v != b) else { continue };
            let joined = mesh.around[c as usize].iter().any(|&h| mesh.faces[h as usize].contains(&d));
            if joined || [a, b].iter().any(|&v| mesh.around[v as usize].len() < 4) {
                continue;
            }
            let replacement = FaceReplacement { old: vec![f, g], new: vec![[c, a, d], [d, b, c]], moved: None };
            let before = [f, g].map(|h| mesh.corners(h));
            let after = [0, 1].map(|i| mesh.corners_after(replacement.new[i], None));
            let worse = |t: [[DVec3; 3]; 2]| quality(t[0]).min(quality(t[1]));
            let turns = |t: [[DVec3; 3]; 2]| normal(t[0]).dot(normal(t[1]));
            let flat = turns(before) > 0.8 && turns(after) > 0.8 && normal(before[0]).dot(normal(after[0])) > 0.8;
            if flat && worse(after) > 1.05 * worse(before) && mesh.check(&replacement, enclosed).is_ok() {
                mesh.apply(&replacement);
                break;
            }
        }
    }
}
