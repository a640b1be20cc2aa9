//! Valid documents that the types of the `gltf` crate refuse: scenes without nodes, `extras` of any type, channels of no node, whole numbers written with a
//! decimal point, and whatever is wrong with pictures and cameras, which are not read.

use gltf::json::{Root, Value};

use crate::error::Fault;

/// The document without what is refused and not needed; none where the bytes are no JSON.
pub(super) fn parse(json: &[u8]) -> Result<Option<Result<Root, gltf::json::Error>>, Fault> {
    let text = String::from_utf8_lossy(json);
    let Ok(mut document) = gltf::json::deserialize::from_str::<Value>(&text) else { return Ok(None) };
    check_version(&document)?;
    simplify(&mut document);
    without_appearance(&mut document);
    for (list, required) in [
        ("scenes", &["nodes"][..]),
        ("animations", &["channels", "samplers"]),
        ("skins", &["joints"]),
        ("meshes", &["primitives"]),
    ] {
        for object in items(&mut document, list).iter_mut().filter_map(Value::as_object_mut) {
            for key in required {
                object.entry(*key).or_insert_with(|| Value::Array(Vec::new()));
            }
        }
    }
    without_channels_of_no_node(&mut document)?;
    Ok(Some(gltf::json::deserialize::from_value(document)))
}

/// The first version is quite another format, as text too.
fn check_version(document: &Value) -> Result<(), Fault> {
    let version = match &document["asset"]["version"] {
        Value::String(version) => version.clone(),
        Value::Number(version) => version.to_string(),
        _ => return Ok(()),
    };
    if version.starts_with('1') || version.starts_with('0') {
        let version: String = version.chars().take(8).filter(char::is_ascii_graphic).collect();
        return Err(Fault::unsupported(format!("is glTF {version}; export the mesh as glTF 2.0")));
    }
    Ok(())
}

/// An array of the document.
fn items<'a>(document: &'a mut Value, list: &str) -> &'a mut [Value] {
    document.get_mut(list).and_then(Value::as_array_mut).map_or(&mut [], Vec::as_mut_slice)
}

/// Leaves out what is nothing or the application's own, and decimal points of whole numbers. JSON is nested 128 times at the most.
fn simplify(value: &mut Value) {
    match value {
        Value::Object(object) => {
            object.retain(|key, value| match key.as_str() {
                "extras" => false,
                "name" => value.is_string(),
                "extensions" => value.is_object(),
                _ => !value.is_null(),
            });
            object.iter_mut().for_each(|(_, value)| simplify(value));
        }
        Value::Array(values) => values.iter_mut().for_each(simplify),
        Value::Number(number) if number.is_f64() => {
            const MOST: f64 = (1_u64 << 53) as f64;
            if let Some(whole) = number.as_f64().filter(|x| (0.0..MOST).contains(x) && x.fract() == 0.0) {
                *value = Value::from(whole as u64);
            }
        }
        _ => {}
    }
}

/// Only how many materials and textures there are is told.
fn without_appearance(document: &mut Value) {
    if let Some(document) = document.as_object_mut() {
        for list in ["images", "samplers", "cameras"] {
            document.remove(list);
        }
    }
    for list in ["materials", "textures"] {
        items(document, list).iter_mut().for_each(|item| *item = Value::Object(Default::default()));
    }
}

/// Readers have to leave out channels of animations that move no node. What may move the mesh is refused.
fn without_channels_of_no_node(document: &mut Value) -> Result<(), Fault> {
    let mut moves = false;
    for animation in items(document, "animations") {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        channels.retain(|channel| {
            let has_node = channel["target"].get("node").is_some();
            let pointer = channel["target"]["extensions"]["KHR_animation_pointer"]["pointer"].as_str();
            moves |= !has_node && pointer.is_some_and(|to| to.starts_with("/nodes/") || to.starts_with("/meshes/"));
            has_node
        });
    }
    if moves {
        return Err(Fault::unsupported(
            "moves nodes by KHR_animation_pointer, which is not read; export them with channels of their own",
        ));
    }
    Ok(())
}

/// Where frames are in time that a program of ours wrote: the number of the frame at 0 s, and frames per second.
pub(super) fn frame_numbers(json: &[u8]) -> Option<[f64; 2]> {
    let key = FIRST_FRAME.as_bytes();
    if !json.windows(key.len()).any(|word| word == key) {
        return None;
    }
    let document: Value = gltf::json::deserialize::from_slice(json).ok()?;
    let extras = &document["animations"][0]["extras"];
    let [first, rate] = [extras[FIRST_FRAME].as_f64()?, extras[FRAME_RATE].as_f64()?];
    (first.abs() < 1e9 && crate::frames::RATES.contains(&rate)).then_some([first, rate])
}

/// Names in the `extras` of an animation.
pub(super) const FIRST_FRAME: &str = "cager_first_frame";
pub(super) const FRAME_RATE: &str = "cager_frame_rate";
