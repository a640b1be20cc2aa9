//! The JSON of a file as the `gltf` crate's types, without what is not read. These refuse valid
//! documents too: scenes without nodes, `extras` of any type, channels of no node, whole numbers
//! written with a decimal point, and whatever is wrong with materials, pictures and cameras.

use gltf::json::{Root, Value};

use super::draco::DRACO;
use super::materials::{Look, materials};
use crate::error::Fault;
use crate::text::quoted;

/// Objects that any document may have, and bytes of JSON for each one beyond: real ones take twenty
/// and more, where `{}` takes three to make some hundred.
const MAX_OBJECTS_OF_ANY_FILE: usize = 100_000;
const BYTES_PER_OBJECT: usize = 12;

/// What the JSON says; the indices in it are not checked.
pub(super) struct Document {
    pub(super) root: Root,
    /// The number of the frame at 0 s and frames per second, where a program of ours wrote them.
    pub(super) frame_numbers: Option<[f64; 2]>,
    pub(super) materials: Vec<Look>,
}

/// Parses the JSON.
pub(super) fn document(json: &[u8]) -> Result<Document, Fault> {
    /// Characters of the reason that are shown.
    const SHOWN: usize = 160;
    // Some programs write a byte order mark, or zeros behind.
    let text = String::from_utf8_lossy(json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json));
    let text = text.trim_end_matches(|c: char| c == '\0' || c.is_ascii_whitespace());
    // Before any is made.
    let most = MAX_OBJECTS_OF_ANY_FILE + text.len() / BYTES_PER_OBJECT;
    if text.bytes().filter(|&b| b == b'{').count() > most {
        return Err(Fault::unsupported(format!(
            "describes more than {most} objects; export the mesh alone, without its scene"
        )));
    }
    let wrong = |cause: gltf::json::Error| {
        // It may repeat a text of the file, of any length.
        let cause = cause.to_string();
        let shown: String = cause.chars().take(SHOWN).collect();
        let more = if shown.len() < cause.len() { "…" } else { "" };
        Fault::damaged(format!("has JSON that is not glTF 2.0 ({shown}{more}); export the mesh again"))
    };
    let mut document: Value = gltf::json::deserialize::from_str(text).map_err(wrong)?;
    check_version(&document)?;
    let frame_numbers = frame_numbers(&document);
    simplify(&mut document);
    let materials = materials(&document, text.len());
    without_appearance(&mut document);
    for (list, required) in [
        ("scenes", &["nodes"][..]),
        ("animations", &["channels", "samplers"]),
        ("skins", &["joints"]),
        ("meshes", &["primitives"]),
    ] {
        for object in items_mut(&mut document, list).iter_mut().filter_map(Value::as_object_mut) {
            for key in required {
                object.entry(*key).or_insert_with(|| Value::Array(Vec::new()));
            }
        }
    }
    without_channels_of_no_node(&mut document)?;
    let root: Root = gltf::json::deserialize::from_value(document).map_err(wrong)?;
    match root.extensions_required.iter().find(|name| !is_read(name)) {
        Some(name) => {
            let name = quoted(name.as_bytes());
            Err(Fault::unsupported(format!(
                "needs the extension {name}, which is not read; export the mesh without it"
            )))
        }
        None => Ok(Document { root, frame_numbers, materials }),
    }
}

/// The first version is quite another format, as text too.
fn check_version(document: &Value) -> Result<(), Fault> {
    let version = match &document["asset"]["version"] {
        Value::String(version) => version.clone(),
        Value::Number(version) => version.to_string(),
        _ => return Ok(()),
    };
    if version.starts_with(['0', '1']) {
        let version: String = version.chars().take(8).filter(char::is_ascii_graphic).collect();
        return Err(Fault::unsupported(format!("is glTF {version}; export the mesh as glTF 2.0")));
    }
    Ok(())
}

pub(super) fn items<'a>(document: &'a Value, list: &str) -> &'a [Value] {
    document[list].as_array().map_or(&[], Vec::as_slice)
}

fn items_mut<'a>(document: &'a mut Value, list: &str) -> &'a mut [Value] {
    document.get_mut(list).and_then(Value::as_array_mut).map_or(&mut [], Vec::as_mut_slice)
}

/// Leaves out what is nothing or the application's own, and decimal points of whole numbers. JSON
/// is nested 128 times at the most.
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

/// Of materials and textures only how many there are is left.
fn without_appearance(document: &mut Value) {
    if let Some(document) = document.as_object_mut() {
        for list in ["images", "samplers", "cameras"] {
            document.remove(list);
        }
    }
    for list in ["materials", "textures"] {
        items_mut(document, list).iter_mut().for_each(|item| *item = Value::Object(Default::default()));
    }
}

/// Channels of animations that move no node are left out; what may move the mesh is refused.
fn without_channels_of_no_node(document: &mut Value) -> Result<(), Fault> {
    let mut moves = false;
    for animation in items_mut(document, "animations") {
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

/// Names in the `extras` of an animation.
pub(super) const FIRST_FRAME: &str = "cager_first_frame";
pub(super) const FRAME_RATE: &str = "cager_frame_rate";

fn frame_numbers(document: &Value) -> Option<[f64; 2]> {
    let extras = &document["animations"][0]["extras"];
    let [first, rate] = [extras[FIRST_FRAME].as_f64()?, extras[FRAME_RATE].as_f64()?];
    (first.abs() < 1e9 && crate::frames::RATES.contains(&rate)).then_some([first, rate])
}

/// Whether files that require an extension are read: it is understood, or changes no shape.
fn is_read(extension: &str) -> bool {
    /// Parts of the names of extensions for appearance, sound, behaviour and notes.
    const OTHER: &str = "_materials_ _texture_ _light _xmp _audio _animation_pointer _interactivity _node_visibility \
        _node_selectability _node_hoverability _mesh_features _structural_metadata";
    matches!(extension, DRACO | "KHR_mesh_quantization" | "EXT_meshopt_compression" | "KHR_meshopt_compression")
        || OTHER.split(' ').any(|part| extension.contains(part))
}
