//! What every transfer keeps: rest poses, similarity motions, and turns of everything together.

use crate::common::{Caged, lumpy, model_of};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_geometry::spatial::Surface;
use cager_geometry::vector::distance;
use cager_shape::deformation::Detail;
use cager_shape::registration::Observation;
use cager_shape::transfer::RIGIDITY;
use cager_shape::transfer::alignment::{AlignBy, align_surfaces};
use cager_shape::transfer::fitted::{CagedTarget, FittedTransfer};
use cager_shape::transfer::public::PublicTransfer;
use cager_shape::transfer::public_cage::PublicCage;
use cager_shape::transfer::{FittedOptions, Pose};
use cager_shape::{Similarity, TransferError};
use glam::{DMat3, DQuat, DVec3};

fn pair() -> (Caged, TriMesh) {
    let target = lumpy(14, [1.1, 0.9, 0.7], 0.25);
    (Caged::new(lumpy(16, [1.0, 0.8, 0.6], 0.3), 60), target)
}

/// A frame of the source to a pose of the target.
type Method<'a> = dyn Fn(&[Point]) -> Vec<Point> + 'a;

fn relative() -> FittedOptions<'static> {
    FittedOptions { pose: Pose::Relative, ..FittedOptions::default() }
}

fn farthest(a: &[Point], b: &[Point]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(p, q)| distance(*p, *q)).fold(0.0, f64::max) / diagonal(b)
}

fn motion() -> Similarity {
    let rotation = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.9, -0.7, 1.3)));
    Similarity { rotation, scale: 1.3, translation: DVec3::new(2.0, -1.0, 0.5) }
}

/// What the target does where the source moves by `motion`, in the target's space.
fn same_motion(motion: &Similarity, aligned: &Similarity, rest: &[Point]) -> Vec<Point> {
    aligned.after(&motion.after(&aligned.inverse())).apply_all(rest)
}

fn in_cage(target: &TriMesh) -> (Model, Caged) {
    let model = model_of(target);
    (model, Caged::new(target.clone(), 60))
}

/// A smooth bend that is no similarity.
fn bent(rest: &[Point]) -> Vec<Point> {
    rest.iter().map(|p| [p[0] + 0.3 * p[2] * p[2], p[1] + 0.2 * p[0], p[2] - 0.2 * p[0] * p[1]]).collect()
}

#[test]
fn a_source_at_rest_leaves_the_target_at_rest_and_one_that_moves_as_a_whole_takes_it_along() {
    let (source, target) = pair();
    let fitted = FittedTransfer::new(&source.source(), &target, &relative()).unwrap();
    let (model, caged) = in_cage(&target);
    let body = CagedTarget { model: &model, cage: &caged.cage, phi: caged.phi.as_ref() };
    let through = FittedTransfer::through_cage(&source.source(), &body, &relative()).unwrap();
    let aligned = fitted.report().aligned.similarity;
    let around = TriMesh { vertices: aligned.apply_all(&source.rest.vertices), ..source.rest.clone() };
    let cage = Cage::new(PublicCage::Sphere(42).around(&around, &target).unwrap()).unwrap();
    let public = PublicTransfer::new(&source.rest, &target, aligned, &cage, &MeanValue, None).unwrap();
    let rigid = PublicTransfer::new(&source.rest, &target, aligned, &cage, &MeanValue, Some(RIGIDITY)).unwrap();
    let methods: [(&str, &Method<'_>); 4] = [
        ("fitted", &|frame| fitted.pose(0, frame).unwrap()),
        ("through a cage", &|frame| through.pose(0, frame).unwrap()),
        ("public", &|frame| public.pose(0, frame).unwrap()),
        ("rigid", &|frame| rigid.pose(0, frame).unwrap()),
    ];
    let moved = motion().apply_all(&source.rest.vertices);
    let wanted = same_motion(&motion(), &aligned, &target.vertices);
    for (name, method) in methods {
        let (still, along) =
            (farthest(&method(&source.rest.vertices), &target.vertices), farthest(&method(&moved), &wanted));
        assert!(still < 1e-10 && along < 1e-8, "{name}: at rest {still:e}, moved {along:e}");
    }
    let detail = Detail::new(&target).unwrap();
    assert!(farthest(&detail.add(&target.vertices), &target.vertices) < 1e-10);
    assert!(farthest(&detail.add(&wanted), &wanted) < 1e-8);
}

#[test]
fn green_coordinates_keep_rest_poses_and_similarity_motions_with_consistent_normals() {
    use cager_core::coordinates::Green;
    let (source, target) = pair();
    let cage = Cage::new(PublicCage::Sphere(42).around(&source.rest, &target).unwrap()).unwrap();
    let of = |aligned| PublicTransfer::new(&source.rest, &target, aligned, &cage, &Green::Consistent, None);
    let green = of(Similarity::IDENTITY).unwrap();
    let still = farthest(&green.pose(0, &source.rest.vertices).unwrap(), &target.vertices);
    let moved = green.pose(0, &motion().apply_all(&source.rest.vertices)).unwrap();
    let along = farthest(&moved, &motion().apply_all(&target.vertices));
    assert!(still < 1e-10 && along < 1e-8, "at rest {still:e}, moved {along:e}");
    let far = of(Similarity { translation: DVec3::splat(5.0), ..Similarity::IDENTITY });
    assert!(matches!(far, Err(TransferError::Outside { whose: "source", .. })));
}

#[test]
fn turning_source_and_target_together_turns_the_result() {
    let (source, target) = pair();
    let turn = Similarity { scale: 1.0, ..motion() };
    let turned = |mesh: &TriMesh| TriMesh { vertices: turn.apply_all(&mesh.vertices), ..mesh.clone() };
    let turned_pair = |caged: &Caged| Caged::within(turned(&caged.rest), turned(caged.cage.mesh()));
    let around = in_cage(&target).1;
    let (turned_source, turned_around) = (turned_pair(&source), turned_pair(&around));
    let frame = bent(&source.rest.vertices);
    let check = |name: &str, plain: &FittedTransfer, other: &FittedTransfer| {
        let wanted = turn.apply_all(&plain.pose(0, &frame).unwrap());
        let found = other.pose(0, &turn.apply_all(&frame)).unwrap();
        let error = farthest(&found, &wanted);
        assert!(error < 1e-6, "{name}: {error:e}");
        let [one, two] = [plain, other].map(|transfer| transfer.report().registration.score);
        assert!((one - two).abs() < 1e-6, "{name}: {one} {two}");
    };
    for (pose, faces) in [(Pose::Relative, true), (Pose::Absolute, false)] {
        let options = FittedOptions { pose, ..FittedOptions::default() };
        let on_mesh =
            |source: &Caged, target: &TriMesh| FittedTransfer::new(&source.source(), target, &options).unwrap();
        check(&format!("{pose:?}"), &on_mesh(&source, &target), &on_mesh(&turned_source, &turned(&target)));
        let in_cage = |source: &Caged, around: &Caged| {
            let model = model_of(&around.rest);
            let model = if faces { model } else { Model { points: model.points, ..Model::default() } };
            let body = CagedTarget { model: &model, cage: &around.cage, phi: around.phi.as_ref() };
            FittedTransfer::through_cage(&source.source(), &body, &options).unwrap()
        };
        let name = format!("{pose:?}, through a cage, with faces: {faces}");
        check(&name, &in_cage(&source, &around), &in_cage(&turned_source, &turned_around));
    }
}

#[test]
fn points_under_the_target_lie_near_it_by_every_method() {
    let (source, target) = pair();
    let fitted = FittedTransfer::new(&source.source(), &target, &relative()).unwrap();
    let aligned = fitted.report().aligned.similarity;
    let around = TriMesh { vertices: aligned.apply_all(&source.rest.vertices), ..source.rest.clone() };
    let cage = Cage::new(PublicCage::Sphere(42).around(&around, &target).unwrap()).unwrap();
    let public = PublicTransfer::new(&source.rest, &target, aligned, &cage, &MeanValue, None).unwrap();
    let rigid = PublicTransfer::new(&source.rest, &target, aligned, &cage, &MeanValue, Some(RIGIDITY)).unwrap();
    let moved = motion().apply_all(&source.rest.vertices);
    let wanted = same_motion(&motion(), &aligned, &target.vertices);
    for under in [fitted.under(0, &moved), public.under(0, &moved), rigid.under(0, &moved)] {
        assert!(farthest(&under.unwrap(), &wanted) < 0.2);
    }
    assert!(matches!(public.under(4, &moved[1..]), Err(TransferError::FramePoints { frame: 4, .. })));
}

#[test]
fn copies_turned_at_random_are_aligned_exactly_or_known_to_be_doubtful() {
    let mut random = fastrand::Rng::with_seed(11);
    let source = lumpy(16, [1.0, 0.8, 0.6], 0.3);
    let seen = |mesh: &TriMesh| Observation::of_mesh(&mesh.vertices, &mesh.triangles, &Default::default()).unwrap().0;
    let mut exact = 0;
    for k in 0..12 {
        let axis = DVec3::from_array(std::array::from_fn(|_| random.f64() - 0.5)).normalize();
        let rotation = DMat3::from_axis_angle(axis, std::f64::consts::PI * random.f64());
        let copy = Similarity { rotation, scale: 0.5 + random.f64(), translation: DVec3::splat(random.f64()) };
        let target = TriMesh { vertices: copy.apply_all(&source.vertices), ..source.clone() };
        let surface = Surface::from(&target);
        let found = align_surfaces(&seen(&source), &seen(&target), Some(&surface), AlignBy::Surfaces, None)[0];
        let error = found.similarity.rotation * copy.rotation.transpose();
        let degrees = DQuat::from_mat3(&error).to_scaled_axis().length().to_degrees();
        let degrees = degrees.min(360.0 - degrees);
        assert!(degrees < 0.01 || found.is_ambiguous(), "{k}: {degrees} {}", found.runner_up);
        if degrees < 0.01 {
            exact += 1;
            assert!((found.similarity.scale / copy.scale - 1.0).abs() < 1e-4, "{k}: {}", found.similarity.scale);
        }
    }
    assert!(exact >= 10, "{exact} of 12");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let (source, target) = pair();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let transfer = FittedTransfer::new(&source.source(), &target, &relative()).unwrap();
            transfer.pose(0, &bent(&source.rest.vertices)).unwrap()
        })
    };
    assert_eq!(on(1), on(3));
}
