//! Frames that are pushed one by one.

use cager_capture::encode::Encode;
use cager_capture::memory::Memory;
use cager_capture::{Animation, Cage, EncodeError, Goal, InvertError, Inverter};
use cager_core::cage::Carrier;
use cager_demo::{Capture, Options};
use cager_formats::{ScratchDir, Target};

fn demo() -> (cager_capture::Model, Cage, Vec<Vec<[f64; 3]>>) {
    let demo = Capture::new(&Options { points: 400, frames: 37, cage_vertices: 42 });
    let mut flat = Vec::new();
    let frames = (0..37)
        .map(|frame| {
            demo.frame(frame, &mut flat);
            flat.as_chunks().0.to_vec()
        })
        .collect();
    (demo.rest, Cage::new(demo.cage).expect("a cage"), frames)
}

#[test]
fn pushed_frames_give_the_bytes_that_a_reader_of_them_gives() {
    let (rest, cage, frames) = demo();
    let points = rest.points.len();
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let array = folder.path().join("frames.npy");
    let faces = Default::default();
    let mut writer = cager_formats::create_frames(&array, points, 37, &faces, &Default::default()).expect("an array");
    let single = |frame: &Vec<[f64; 3]>| frame.as_flattened().iter().map(|&x| x as f32).collect::<Vec<f32>>();
    frames.iter().for_each(|frame| writer.write_frame(&single(frame)).expect("a frame"));
    writer.finish().expect("an array");
    for goal in [None, Some(Goal::MaxError(1e-3)), Some(Goal::Size(60_000))] {
        let encode = || Encode::new(&rest, &cage).goal(goal);
        let mut reader = cager_formats::open_frames(&array, points).expect("frames");
        let read = folder.path().join("read.cager");
        let encoded = encode().run(reader.as_mut(), &Target::from(&read)).expect("an encoding");
        let of_reader = encoded.commit().expect("a file");
        let pushed = folder.path().join("pushed.cager");
        let mut encoder = encode().expect_frames(37).start(&pushed).expect("an encoder");
        for frame in &frames {
            let frame: Vec<[f64; 3]> = frame.iter().map(|p| p.map(|x| f64::from(x as f32))).collect();
            encoder.push(&frame).expect("a frame");
        }
        let report = encoder.finish().expect("a file");
        assert_eq!((report.frames, report.error.linf_max), (of_reader.frames, of_reader.error.linf_max), "{goal:?}");
        let mut decoded = [&read, &pushed].map(|path| Animation::open(path).expect("a container"));
        for frame in [0, 17, 36] {
            let [a, b] = decoded.each_mut().map(|animation| animation.frame(frame).expect("a frame"));
            assert_eq!(a, b, "{goal:?} {frame}");
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_and_leaves_no_file() {
    let (rest, cage, frames) = demo();
    let points = rest.points.len();
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let output = folder.path().join("out.cager");
    let mut encoder = Encode::new(&rest, &cage).start(&output).expect("an encoder");
    encoder.push(&frames[0]).expect("a frame");
    let short = encoder.push(&frames[1][1..]);
    let told = short.expect_err("a point is missing").to_string();
    assert!(told.starts_with(&format!("frame 1 has {} points where the rest pose has {points}", points - 1)), "{told}");
    let mut broken = frames[1].clone();
    broken[7][2] = f64::NAN;
    let refused = encoder.push(&broken);
    assert!(matches!(refused, Err(EncodeError::NotFinite { frame: 1, point: 7 })), "{refused:?}");
    drop(encoder);
    assert!(!output.exists());
    let unknown = Encode::new(&rest, &cage).goal(Goal::Size(60_000)).start(&output);
    assert!(matches!(unknown.err(), Some(EncodeError::UnknownLength)));
    let inverter = Inverter::new(&rest.points, &cage).expect("an inverter");
    assert_eq!(inverter.cage(&rest.points[..3]), Err(InvertError::Length { frame: 0, found: 3, expected: points }));
    let vertices = cage.vertices().len();
    assert_eq!(inverter.positions(&[]), Err(InvertError::Length { frame: 0, found: 0, expected: vertices }));
    let refused = inverter.cages(&[&frames[0], &broken]);
    assert_eq!(refused, Err(InvertError::NotFinite { frame: 1, position: 7 }));
}

#[test]
fn cages_of_any_number_of_frames_bring_the_frames_back_in_any_coordinates() {
    let (rest, cage, frames) = demo();
    let largest = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for system in cager_core::coordinates::SYSTEMS {
        let inverter = Inverter::with_coordinates(&rest.points, &cage, system).expect("an inverter");
        let cages = inverter.cages(&frames).expect("cages");
        assert_eq!(cages.len(), frames.len(), "{}", system.name());
        for (frame, found) in frames.iter().zip(&cages) {
            assert_eq!(Ok(found), inverter.cage(frame).as_ref(), "{}", system.name());
            let positions = inverter.positions(found).expect("positions");
            assert!(largest(&positions, frame) < 0.1, "{}: {}", system.name(), largest(&positions, frame));
        }
        assert_eq!(inverter.cages::<&[[f64; 3]]>(&[]), Ok(Vec::new()));
        let far: Vec<[f64; 3]> = rest.points.iter().map(|p| p.map(|x| 1e38 * x.signum())).collect();
        assert!(inverter.cage(&far).is_ok(), "{}", system.name());
    }
}

#[test]
fn an_encoder_that_lost_frames_refuses_to_go_on_and_leaves_no_file() {
    let (rest, cage, frames) = demo();
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let output = folder.path().join("out.cager");
    // So little memory that every frame is a group of its own.
    let mut encoder =
        Encode::new(&rest, &cage).max_error(1e-3).memory(Memory::at_most(1)).start(&output).expect("an encoder");
    let mut far = frames[0].clone();
    far[7][2] = 1e35;
    let mut pushed = frames[..16].iter().enumerate().map(|(k, frame)| encoder.push(if k == 3 { &far } else { frame }));
    assert!(pushed.by_ref().take(15).all(|pushed| pushed.is_ok()));
    let error = pushed.next().expect("a last frame").expect_err("a point too far away");
    assert!(matches!(error, EncodeError::Coding(_)), "{error}");
    drop(pushed);
    let refused = encoder.push(&frames[16]);
    assert!(matches!(refused, Err(EncodeError::Stopped { frame: 3 })), "{refused:?}");
    let refused = encoder.finish();
    assert!(matches!(refused, Err(EncodeError::Stopped { frame: 3 })), "{refused:?}");
    assert!(!output.exists());
}

#[test]
fn a_cage_whose_components_carry_other_points_is_refused_whatever_is_asked_for() {
    let (rest, cage, _) = demo();
    let folder = ScratchDir::create(std::env::temp_dir()).expect("a folder");
    let output = folder.path().join("out.cager");
    let (points, vertices) = (rest.points.len() as u32, cage.vertices().len() as u32);
    for carried in [points - 1, points + 1] {
        let carriers = vec![Carrier { points: 0..carried, vertices: 0..vertices }];
        let cage = cage.clone().with_carriers(carriers).expect("components");
        for goal in [None, Some(Goal::MaxError(1e-3)), Some(Goal::Preview)] {
            let refused = Encode::new(&rest, &cage).goal(goal).start(&output).err().map(|error| error.to_string());
            let told = format!("carry {carried} points, the model has {points}");
            assert!(refused.as_ref().is_some_and(|refused| refused.contains(&told)), "{goal:?}: {refused:?}");
        }
    }
}
