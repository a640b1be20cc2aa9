//! What users rely on when Maya's geometry caches are read and written: Maya's own files are read,
//! and what is written is laid out as they are.

#[path = "../../../proto/tests/support/memory.rs"]
mod memory;
mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cager_formats::{
    CacheFormat, Error, FrameOptions, FrameReader, FrameSelection, Target, create_frames, open_frames,
    open_frames_bytes, open_selected_frames,
};
use cager_geometry::mesh::Polygons;
use memory::peak_of;
use support::message;
use tempfile::{TempDir, tempdir};

fn frames(count: u16) -> Vec<Vec<f32>> {
    (0..count).map(|k| (0..9_u8).map(|i| f32::from(k) + 0.1 * f32::from(i)).collect()).collect()
}

fn written(name: &str, frames: &[Vec<f32>], options: &FrameOptions) -> (TempDir, PathBuf) {
    let folder = tempdir().unwrap();
    let path = folder.path().join(name);
    let mut writer = create_frames(&path, 3, frames.len(), &Polygons::new(), options).unwrap();
    frames.iter().for_each(|frame| writer.write_frame(frame).unwrap());
    writer.finish().unwrap();
    (folder, path)
}

fn all(reader: &mut dyn FrameReader) -> Vec<Vec<f64>> {
    let (mut frames, mut values) = (Vec::new(), Vec::new());
    while reader.read_next(&mut values).unwrap() {
        frames.push(values.clone());
    }
    frames
}

fn numbers(reader: &dyn FrameReader) -> Vec<f64> {
    (0..reader.frames()).map(|frame| reader.number(frame)).collect()
}

#[test]
fn caches_come_back_as_they_were_written() {
    let frames = frames(20);
    let wide: Vec<Vec<f64>> = frames.iter().map(|frame| frame.iter().map(|&x| x.into()).collect()).collect();
    for name in ["my walk.mcx", "walk.mc"] {
        for (fps, first, step) in
            [(24.0, 0.0, 1.0), (25.0, 1001.0, 1.0), (30000.0 / 1001.0, -3.0, 1.0), (48.0, 2.0, 1.0)]
        {
            let told: Vec<f64> = (0..20).map(|k| first + step * f64::from(k)).collect();
            let options = FrameOptions { fps, numbers: told.clone(), ..FrameOptions::default() };
            let (_folder, path) = written(name, &frames, &options);
            let mut reader = open_frames(&path, 3).unwrap();
            assert!(reader.frame_rate().is_some_and(|rate| (rate - fps).abs() < 1e-2), "{:?}", reader.frame_rate());
            assert!(numbers(&*reader).iter().zip(&told).all(|(a, b)| (a - b).abs() < 1e-2), "{:?}", numbers(&*reader));
            assert_eq!(all(&mut *reader), wide);
        }
    }
    let told = vec![1.0, 2.0, 5.0, 9.0];
    let options = FrameOptions { fps: 25.0, numbers: told.clone(), ..FrameOptions::default() };
    let (_folder, path) = written("a.mcx", &frames[..4], &options);
    let reader = open_frames(&path, 3).unwrap();
    assert_eq!((numbers(&*reader), reader.frame_rate()), (told, Some(25.0)));
    assert!(fs::read_to_string(path.with_extension("xml")).unwrap().contains("SamplingType=\"Irregular\""));
    // What lies far away keeps its place, in double precision.
    let origin = [1e7 + 0.125, -3.5e6, 1.0 / 3.0];
    let options = FrameOptions { origin: Some(origin), ..FrameOptions::default() };
    let (_folder, path) = written("a.mcx", &frames[..1], &options);
    let expected: Vec<f64> = wide[0].iter().zip(origin.iter().cycle()).map(|(x, o)| x + o).collect();
    assert_eq!(all(&mut *open_frames(&path, 3).unwrap()), [expected]);
}

#[test]
fn rates_come_back_exactly_and_those_of_television_from_ticks() {
    for fps in [24_000.0 / 1001.0, 30_000.0 / 1001.0, 59.94, 24.0, 12.5, 100.0 / 3.0] {
        let options = FrameOptions { fps, numbers: (1001..1041).map(f64::from).collect(), ..FrameOptions::default() };
        let rate = if fps == 59.94 { 60_000.0 / 1001.0 } else { fps };
        for name in ["a.mcx", "a.mc"] {
            let (_folder, path) = written(name, &frames(40), &options);
            let reader = open_frames(&path, 3).unwrap();
            assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(rate), options.numbers.clone()));
            // As Maya writes the text, which says whole ticks.
            let text = fs::read_to_string(path.with_extension("xml")).unwrap();
            let (before, behind) = text.split_once("  <extra>frames per second ").unwrap();
            fs::write(path.with_extension("xml"), format!("{before}{}", behind.split_once('\n').unwrap().1)).unwrap();
            let reader = open_frames(&path, 3).unwrap();
            if fps < 59.0 && fps != 100.0 / 3.0 {
                assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(rate), options.numbers.clone()), "{fps}");
            }
        }
    }
}

/// A frame of a cache with a file for each, which has its time in the header.
fn frame_of_maya(is_wide: bool, tick: i32, value: f32) -> Vec<u8> {
    let group: &[u8; 4] = if is_wide { b"FOR8" } else { b"FOR4" };
    let part = |tag, payload: &[u8]| chunk(is_wide, tag, payload);
    let time = tick.to_be_bytes();
    let head = [&b"CACH"[..], &part(b"VRSN", b"0.1\0"), &part(b"STIM", &time), &part(b"ETIM", &time)].concat();
    let values: Vec<u8> = [value; 9].iter().flat_map(|x| x.to_be_bytes()).collect();
    let channel = |name: &[u8]| [part(b"CHNM", name), part(b"SIZE", &[0, 0, 0, 3]), part(b"FVCA", &values)].concat();
    [part(group, &head), part(group, &[&b"MYCH"[..], &channel(b"bodyShape\0"), &channel(b"hatShape\0")].concat())]
        .concat()
}

#[test]
fn caches_with_a_file_for_each_frame_are_read_by_the_frames_and_ticks_of_their_names() {
    let prim = FrameSelection { prims: vec!["hatShape".to_owned()], ..FrameSelection::default() };
    for extension in ["mcx", "mc"] {
        let folder = tempdir().unwrap();
        let text =
            "<Autodesk_Cache_File><cacheType Type=\"OneFilePerFrame\"/><cacheTimePerFrame TimePerFrame=\"250\"/>";
        fs::write(folder.path().join("walk.xml"), text).unwrap();
        for tick in (-250_i32..=500).step_by(125) {
            let (frame, rest) = (tick.div_euclid(250), tick.rem_euclid(250));
            let ticks = if rest == 0 { String::new() } else { format!("Tick{rest}") };
            let name = format!("walkFrame{frame}{ticks}.{extension}");
            fs::write(folder.path().join(name), frame_of_maya(extension == "mcx", tick, tick as f32)).unwrap();
        }
        for source in [folder.path().to_owned(), folder.path().join(format!("walkFrame*.{extension}"))] {
            let mut reader = open_selected_frames(&source, 3, &prim).unwrap();
            assert_eq!(
                (reader.frame_rate(), numbers(&*reader)),
                (Some(24.0), vec![-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0])
            );
            let values: Vec<f64> = all(&mut *reader).iter().map(|frame| frame[0]).collect();
            assert_eq!(values, [-250.0, -125.0, 0.0, 125.0, 250.0, 375.0, 500.0]);
        }
        // One alone is one frame, and says what it belongs to.
        let path = folder.path().join(format!("walkFrame1Tick125.{extension}"));
        let reader = open_selected_frames(&path, 3, &prim).unwrap();
        assert_eq!((reader.frames(), reader.number(0)), (1, 1.5));
        assert!(reader.notes()[0].contains(&format!("walkFrame*.{extension}'")), "{:?}", reader.notes());
        let said = message(open_frames(folder.path().join("walk.xml"), 3).map(|_| ()));
        assert!(
            said.contains("describes a cache of Maya; give the .mcx or .mc file beside it, or the pattern"),
            "{said}"
        );
    }
}

#[test]
fn cache_and_text_appear_together_or_not_at_all() {
    let (folder, path) = written("a.mcx", &frames(2), &FrameOptions::default());
    fs::remove_file(&path).unwrap();
    let create = |target| create_frames(target, 3, 1, &Polygons::new(), &FrameOptions::default());
    assert!(create(Target::New(path.clone())).is_err(), "the text is another's");
    drop(create(Target::Replacing(path.clone())).unwrap());
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["a.xml"]);
    let late = FrameOptions { numbers: vec![0.0, 1e-6], ..FrameOptions::default() };
    let done = create_frames(folder.path().join("b.mcx"), 3, 2, &Polygons::new(), &late);
    assert!(message(done.map(|_| ())).contains("6000ths of a second"));
}

/// A chunk as Maya writes it: of `.mcx`, with whatever was in memory behind the letters.
fn chunk(is_wide: bool, tag: &[u8; 4], payload: &[u8]) -> Vec<u8> {
    let size = (payload.len() as u64).to_be_bytes();
    let mut chunk = tag.to_vec();
    chunk.extend(if is_wide { [&[0xab, 1, 0, 0], &size[..]].concat() } else { size[4..].to_vec() });
    chunk.extend(payload);
    let group = tag.starts_with(b"FOR");
    while !group
        && payload.len().next_multiple_of(if is_wide { 8 } else { 4 }) > chunk.len() - if is_wide { 16 } else { 8 }
    {
        chunk.push(0);
    }
    chunk
}

/// A cache of these channels of single vectors, at 12.5 and 25 frames per second, as Maya writes
/// several meshes into one file.
fn as_of_maya(is_wide: bool, channels: &[(&str, u32)], times: &[i32]) -> Vec<u8> {
    let group: &[u8; 4] = if is_wide { b"FOR8" } else { b"FOR4" };
    let part = |tag, payload: &[u8]| chunk(is_wide, tag, payload);
    let head =
        [&b"CACH"[..], &part(b"VRSN", b"0.1\0"), &part(b"STIM", &[0; 4]), &part(b"ETIM", &[0, 0, 0, 1])].concat();
    let mut file = part(group, &head);
    for time in times {
        let mut block = [&b"MYCH"[..], &part(b"TIME", &time.to_be_bytes())].concat();
        for (k, (name, points)) in channels.iter().enumerate() {
            block.extend(part(b"CHNM", format!("{name}\0").as_bytes()));
            block.extend(part(b"SIZE", &points.to_be_bytes()));
            let values: Vec<u8> = (0..3 * points).flat_map(|i| (i as f32 + 100.0 * k as f32).to_be_bytes()).collect();
            block.extend(part(b"FVCA", &values));
        }
        file.extend(part(group, &block));
    }
    file
}

fn opened<'a>(bytes: &'a [u8], points: usize) -> Result<Box<dyn FrameReader + 'a>, Error> {
    open_frames_bytes(CacheFormat::Mcx, Path::new("a.mcx"), bytes, points)
}

#[test]
fn files_of_maya_are_read_one_channel_of_several() {
    for is_wide in [true, false] {
        let one = as_of_maya(is_wide, &[("bodyShape", 3), ("bodyShape_normals", 12)], &[250, 500, 750]);
        let mut reader = opened(&one, 3).unwrap();
        assert_eq!((reader.frames(), reader.frame_rate(), reader.number(0)), (3, Some(24.0), 1.0));
        assert_eq!(all(&mut *reader)[2], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert!(message(opened(&one, 4).map(|_| ())).contains("has 3 points where 4 are expected"));
        let folder = tempdir().unwrap();
        let path = folder.path().join("a.mc");
        fs::write(&path, as_of_maya(is_wide, &[("bodyShape", 3), ("hatShape", 2)], &[250, 375, 625])).unwrap();
        let said = message(open_frames(&path, 3).map(|_| ()));
        assert!(
            said.contains("2 channels of positions, among them bodyShape (3 points), hatShape (2 points)"),
            "{said}"
        );
        // Times that are uneven are kept at the rate that the text says.
        fs::write(folder.path().join("a.xml"), "<cacheTimePerFrame TimePerFrame=\"125\"/>").unwrap();
        let selection = FrameSelection { prims: vec!["hatShape".to_owned()], ..FrameSelection::default() };
        let mut reader = open_selected_frames(&path, 2, &selection).unwrap();
        assert_eq!((reader.frame_rate(), numbers(&*reader)), (Some(48.0), vec![2.0, 3.0, 5.0]));
        assert_eq!(all(&mut *reader)[0], [100.0, 101.0, 102.0, 103.0, 104.0, 105.0]);
    }
}

#[test]
fn what_is_no_whole_cache_is_refused_in_words_that_say_what_to_do() {
    for is_wide in [true, false] {
        let whole = as_of_maya(is_wide, &[("a", 3), ("a_normals", 3)], &[0, 250]);
        let header = as_of_maya(is_wide, &[], &[]).len();
        for length in 0..whole.len() {
            let (cut, peak) = peak_of(|| opened(&whole[..length], 3).map(|reader| reader.frames()));
            let block = header + (whole.len() - header) / 2;
            assert!(cut.is_err() || length == block && cut.is_ok_and(|frames| frames == 1), "cut to {length}");
            assert!(peak < 1 << 20, "{peak}");
        }
        // Sizes that promise more than there is take no memory.
        for at in (0..whole.len()).step_by(4) {
            for value in [[0xff; 4], [0x7f, 0xff, 0xff, 0xff], [0, 0xff, 0xff, 0xff], [0; 4]] {
                let mut bytes = whole.clone();
                bytes[at..at + 4].copy_from_slice(&value);
                let ((), peak) = peak_of(|| {
                    let Ok(mut reader) = opened(&bytes, 3) else { return };
                    let mut frame = Vec::new();
                    while reader.read_next(&mut frame).is_ok_and(|more| more) {}
                });
                assert!(peak < 1 << 20, "{peak} bytes at {at}");
            }
        }
        let no_time: Vec<u8> = {
            let mut bytes = whole.clone();
            let at = bytes.windows(4).position(|word| word == b"TIME").unwrap();
            bytes[at..at + 4].copy_from_slice(b"tIME");
            bytes
        };
        // The other frames have none either.
        let said = message(opened(&no_time, 3).map(|_| ()));
        assert!(said.contains("frame 0 has no time"), "{said}");
        let said = message(opened(&as_of_maya(is_wide, &[("a_normals", 3)], &[0]), 3).map(|_| ()));
        assert!(said.contains("0 channels of positions"), "{said}");
        let none = message(opened(&as_of_maya(is_wide, &[], &[]), 3).map(|_| ()));
        assert!(none.contains("holds no frames"), "{none}");
    }
    let other = [as_of_maya(true, &[("a", 3)], &[0]), as_of_maya(true, &[("a", 2)], &[250]).split_off(92)].concat();
    assert!(message(opened(&other, 3).map(|_| ())).contains("2 points in frame 1, and 3 in frame 0"));
    assert!(message(opened(b"FOR8\0\0\0\0\0\0\0\0\0\0\0\x04Maya", 3).map(|_| ())).contains("does not begin as one"));
}

/// `tests/peers/maya.py` knows the format from Maya's own files, and shares nothing with this program.
#[test]
fn another_reader_finds_what_is_written() {
    let python = std::env::var("CAGER_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/maya.py");
    if !Command::new(&python).arg("--version").output().is_ok_and(|found| found.status.success()) {
        eprintln!("skipped: there is no {python}");
        return;
    }
    let uneven = FrameOptions { fps: 25.0, numbers: vec![1.0, 2.0, 5.0, 9.0], ..FrameOptions::default() };
    let far = FrameOptions { origin: Some([1e7 + 0.125, -3.5e6, 1.0 / 3.0]), ..FrameOptions::default() };
    for (name, options, count) in [("my walk.mcx", uneven, 4), ("a.mc", FrameOptions::default(), 9), ("a.mcx", far, 1)]
    {
        let (_folder, path) = written(name, &frames(count), &options);
        let done = Command::new(&python).arg(&script).arg(path.with_extension("xml")).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        let own = all(&mut *open_frames(&path, 3).unwrap());
        assert_eq!(text.lines().count(), own.len());
        for (frame, (line, own)) in text.lines().zip(&own).enumerate() {
            let values: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
            let number = options.numbers.get(frame).copied().unwrap_or(frame as f64);
            assert_eq!(values[0], (number * 6000.0 / options.fps).round(), "frame {frame}");
            assert_eq!(&values[1..], own, "frame {frame}");
        }
    }
}
