//! Shared content and prepared solvers.

use super::{Given, KEY, SOLVER, content, prepare_with};
use crate::store::ContentKey;
use cager_core::inversion::{BATCH, Handles, Rows, Solver, SolverOptions};
use cager_core::regularize::Regularizer;

/// Bits of everything a solver is used for.
fn bits(solver: &Solver) -> Vec<u64> {
    let n = solver.decoder().points();
    let frames: Vec<Vec<f64>> =
        (0..BATCH).map(|f| (0..3 * n).map(|i| ((i * 7 + f * 13) % 101) as f64 * 0.01).collect()).collect();
    let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
    let inverted = solver.invert(Rows::All, None, &frames);
    let cages: Vec<&[f32]> = inverted.iter().map(|inverted| inverted.cage.as_slice()).collect();
    let errors = solver.decoder().measure(&cages, &frames);
    let errors = errors.iter().flat_map(|e| [e.l2, e.linf, e.squared, e.spread]).map(f64::to_bits);
    cages.iter().flat_map(|cage| cage.iter()).map(|x| u64::from(x.to_bits())).chain(errors).collect()
}

#[test]
fn a_solver_comes_back_the_same_to_the_bit() {
    let given = Given::new();
    let store = given.open().store;
    let spread = Handles::Spread { count: None };
    let kinds = [
        ("mvc", Handles::MaxVol, Regularizer::Laplacian),
        ("mvc", Handles::All, Regularizer::Laplacian),
        ("mvc", spread, Regularizer::Differential),
        ("mvc", spread, Regularizer::Temporal),
        ("green", spread, Regularizer::Laplacian),
        ("harmonic", spread, Regularizer::Laplacian),
    ];
    for (i, (system, handles, regularizer)) in kinds.into_iter().enumerate() {
        let key = ContentKey([i as u8; 32]);
        let solver = prepare_with(system, SolverOptions { handles, regularizer, ..SolverOptions::PAPER });
        assert_eq!(solver.dependent().is_some(), system == "green");
        assert_eq!(solver.preparation().plan.is_some(), system == "harmonic");
        assert!(store.prepared(&key).unwrap().is_none());
        store.put_prepared(&key, &solver).unwrap();
        let found = store.prepared(&key).unwrap().unwrap();
        assert_eq!(bits(&found), bits(&solver));
        assert_eq!(found.handles(), solver.handles());
        assert_eq!(found.diagonal().to_bits(), solver.diagonal().to_bits());
        assert_eq!(format!("{:?}", found.preparation()), format!("{:?}", solver.preparation()));
        assert_eq!(found.size_bytes(), solver.size_bytes());
    }
}

#[test]
fn a_damaged_solver_is_set_aside_and_made_anew() {
    let given = Given::new();
    let store = given.open().store;
    store.put_prepared(&KEY, &SOLVER).unwrap();
    let path = given.root().join(format!("prepared/{KEY}.solver"));
    let file = std::fs::read(&path).unwrap();
    let gone = |bytes: &[u8], what: &str| {
        std::fs::write(&path, bytes).unwrap();
        assert!(store.prepared(&KEY).unwrap().is_none(), "{what}");
        assert!(!path.exists(), "{what}");
    };
    // Every byte of the header's begin and some of the rest.
    for at in (0..220).chain((220..file.len()).step_by(1009)).chain(file.len() - 8..file.len()) {
        let mut changed = file.clone();
        changed[at] ^= 1 << (at % 8);
        gone(&changed, &format!("byte {at} changed"));
        gone(&file[..at], &format!("cut to {at} bytes"));
        std::fs::remove_dir_all(given.root().join("quarantine")).unwrap();
        std::fs::create_dir(given.root().join("quarantine")).unwrap();
    }
    // Shapes that lie.
    let header = 8 + u64::from_le_bytes(*file.first_chunk().unwrap()) as usize;
    let text = String::from_utf8(file[8..header].to_vec()).unwrap();
    for (at, _) in text.match_indices("\"shape\":[") {
        let from = at + "\"shape\":[".len();
        let to = from + text[from..].find(',').unwrap();
        for number in ["0", "1", "4294967296", "9223372036854775808", "18446744073709551615"] {
            let lie = format!("{}{number}{}", &text[..from], &text[to..]);
            if lie != text {
                let changed = [&(lie.len() as u64).to_le_bytes(), lie.as_bytes(), &file[header..]].concat();
                gone(&changed, &format!("the shape at {at} is {number}"));
            }
        }
    }
    store.put_prepared(&KEY, &SOLVER).unwrap();
    assert!(store.prepared(&KEY).unwrap().is_some());
    let other = ContentKey([1; 32]);
    std::fs::copy(&path, given.root().join(format!("prepared/{other}.solver"))).unwrap();
    assert!(store.prepared(&other).unwrap().is_none(), "a solver of other content");
}

#[test]
fn a_solver_of_another_version_is_made_anew_and_not_called_damaged() {
    let given = Given::new();
    let store = given.open().store;
    store.put_prepared(&KEY, &SOLVER).unwrap();
    let path = given.root().join(format!("prepared/{KEY}.solver"));
    let file = std::fs::read(&path).unwrap();
    let text = String::from_utf8_lossy(&file[..300]).into_owned();
    let version = r#""solver":""#;
    let at = text.find(version).expect("a version") + version.len();
    let newer = [&file[..at], &[file[at] + 1], &file[at + 1..]].concat();
    for other in [newer, b"CGRSOLV\x04 and more".to_vec(), b"CGRSOLV\x03".to_vec()] {
        std::fs::write(&path, other).unwrap();
        assert!(store.prepared(&KEY).unwrap().is_none());
        assert!(!store.keeps_contents().unwrap());
        store.put_prepared(&KEY, &SOLVER).unwrap();
        assert!(store.prepared(&KEY).unwrap().is_some(), "nothing took its place");
    }
}

#[test]
fn a_cage_is_read_without_its_rest_pose() {
    let given = Given::new();
    let store = given.open().store;
    assert!(store.content_cage(&KEY).unwrap().is_none());
    store.put_content(&KEY, &content()).unwrap();
    let place = given.root().join(format!("contents/{KEY}"));
    std::fs::remove_file(place.join("rest")).unwrap();
    assert_eq!(store.content_cage(&KEY).unwrap(), Some(content().cage));
    std::fs::write(place.join("cage"), b"v 0 0 0").unwrap();
    assert!(store.content_cage(&KEY).is_err() && store.keeps_contents().unwrap());
}

#[test]
fn many_may_put_at_once() {
    let given = Given::new();
    let store = given.open().store;
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                store.put_prepared(&KEY, &SOLVER).unwrap();
                store.put_content(&KEY, &content()).unwrap();
                assert_eq!(bits(&store.prepared(&KEY).unwrap().unwrap()), bits(&SOLVER));
                assert_eq!(store.content(&KEY).unwrap(), Some(content()));
            });
        }
    });
    for (folder, count) in [("tmp", 0), ("prepared", 1), ("contents", 1), ("quarantine", 0)] {
        assert_eq!(std::fs::read_dir(given.root().join(folder)).unwrap().count(), count, "{folder}");
    }
}

#[test]
fn the_least_recently_used_go_first() {
    let given = Given::new();
    let store = given.open().store;
    let keys = [1, 2, 3].map(|i| ContentKey([i; 32]));
    for key in &keys {
        store.put_prepared(key, &SOLVER).unwrap();
    }
    let one = std::fs::metadata(given.root().join(format!("prepared/{}.solver", keys[0]))).unwrap().len();
    assert_eq!(store.prepared_files().unwrap(), keys.map(|key| (key, one)));
    store.prepared(&keys[0]).unwrap().unwrap();
    assert_eq!(store.prepared_files().unwrap(), [1, 2, 0].map(|k| (keys[k], one)));
    store.remove_prepared(&keys[1]).unwrap();
    store.remove_prepared(&keys[1]).unwrap();
    let left = keys.map(|key| store.prepared(&key).unwrap().is_some());
    assert_eq!(left, [true, false, true]);
}

#[test]
fn damaged_content_is_reported_once_and_replaced() {
    let given = Given::new();
    let store = given.open().store;
    assert_eq!(store.content(&KEY).unwrap(), None);
    let place = given.root().join(format!("contents/{KEY}"));
    for name in ["content.json", "rest", "cage"] {
        store.put_content(&KEY, &content()).unwrap();
        let mut bytes = std::fs::read(place.join(name)).unwrap();
        bytes[30] ^= 4;
        std::fs::write(place.join(name), bytes).unwrap();
        assert!(store.content(&KEY).unwrap_err().to_string().contains(name));
        assert_eq!(store.content(&KEY).unwrap(), None);
        // A missing part is seen at the next upload at the latest.
        store.put_content(&KEY, &content()).unwrap();
        std::fs::remove_file(place.join(name)).unwrap();
        store.put_content(&KEY, &content()).unwrap();
        assert_eq!(store.content(&KEY).unwrap(), Some(content()));
    }
    store.remove_content(&KEY).unwrap();
    store.remove_content(&KEY).unwrap();
    assert_eq!(store.content(&KEY).unwrap(), None);
}

#[test]
fn keys_are_hexadecimal() {
    let text = KEY.to_string();
    assert_eq!(text, "a7".repeat(32));
    assert_eq!(text.parse(), Ok(KEY));
    assert_eq!(serde_json::to_string(&KEY).unwrap(), format!("{text:?}"));
    assert_eq!(serde_json::from_str::<ContentKey>(&format!("{text:?}")).unwrap(), KEY);
    for wrong in ["", "a7", &"A7".repeat(32), &"g0".repeat(32), &"é".repeat(32)] {
        assert!(wrong.parse::<ContentKey>().is_err(), "{wrong}");
    }
}
