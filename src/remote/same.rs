//! Whether a session is of this very capture, before an upload goes on with it.

use super::{Difference, READY_TIMEOUT, RemoteError};
use cager_client::messages::{Sent, SentFile};
use cager_client::{Client, ClientError, FrameSource, MeshFile, NewSession};
use serde_json::{Map, Value};
use std::io;

/// Options that say nothing about what a session is of: its name is that of the output, and how a
/// cage came about is compared as a file.
const LEFT_OUT: [&str; 2] = ["name", "cage"];

/// Compares a session with what one would be made of now. Reads the frames that it has from `frames`.
///
/// # Errors
/// [`RemoteError::Different`] for the first difference; frames that cannot be read; those of the connection.
pub(super) async fn check(
    client: &Client,
    session: &str,
    new: &NewSession,
    frames: &mut impl FrameSource,
) -> Result<(), RemoteError> {
    let ready = client.wait_ready(session, READY_TIMEOUT).await?;
    let differs = |what| RemoteError::Different(Difference { session: session.to_owned(), what });
    let sent = match client.sent(session).await {
        // The session is there, so that it is the address that is not.
        Err(error) if error.status() == Some(404) => {
            let what = "the service is of an earlier version, which cannot tell what a session was sent";
            return Err(differs(what.to_owned()));
        }
        sent => sent?,
    };
    if let Some(what) = different_files(&sent, new) {
        return Err(differs(what));
    }
    // What was left out when the session was made has the value that the session says.
    let usual = object(&ready);
    if let Some(what) = different_options(&object(&sent.options), &object(&new.options), &usual) {
        return Err(differs(what));
    }
    if let (Some(last), Some(count)) = (sent.frames.last(), frames.frames())
        && last.frame >= count
    {
        let what = format!("the session has frame {}, and this capture only {count} frames from 0 on", last.frame);
        return Err(differs(what));
    }
    let handles = match sent.frames.iter().any(|frame| frame.handles_only) {
        true => client.handles(session).await?,
        false => Vec::new(),
    };
    let (mut values, mut bytes) = (Vec::new(), Vec::new());
    for known in &sent.frames {
        let failed = |cause| ClientError::Source { frame: known.frame, cause };
        frames.seek(known.frame).map_err(failed)?;
        if !frames.read(&mut values).map_err(failed)? {
            let what = format!("frame {} is not there any more; get the capture again", known.frame);
            return Err(failed(io::Error::other(what)).into());
        }
        bytes.clear();
        match known.handles_only {
            false => bytes.extend(values.iter().flat_map(|x| x.to_le_bytes())),
            true => {
                let rows = handles.iter().filter_map(|&handle| values.get(3 * handle as usize..)?.get(..3));
                bytes.extend(rows.flatten().flat_map(|x| x.to_le_bytes()));
            }
        }
        // Half of the digest is sent.
        if known.blake3.is_empty() || !blake3::hash(&bytes).to_hex().starts_with(&known.blake3) {
            return Err(differs(format!("frame {} differs from the one that the session has", known.frame)));
        }
    }
    frames.seek(0).map_err(|cause| ClientError::Source { frame: 0, cause })?;
    Ok(())
}

fn different_files(sent: &Sent, new: &NewSession) -> Option<String> {
    let pairs = [
        ("rest pose", Some(&sent.rest), Some(&new.rest)),
        ("cage", sent.cage.as_ref(), new.cage.as_ref()),
        ("matrix of the regularizer", sent.regularizer_matrix.as_ref(), new.regularizer_matrix.as_ref()),
    ];
    pairs.into_iter().find_map(|(what, there, here)| {
        let how = match (there, here) {
            (None, None) => return None,
            (Some(there), Some(here)) if is_same(there, here) => return None,
            (Some(there), Some(here)) => {
                format!("{} of {} bytes is another file than {}", there.name, there.bytes, here.name)
            }
            (Some(there), None) => format!("the session has {}, this command none", there.name),
            (None, Some(here)) => format!("no such file was sent to the session, this command has {}", here.name),
        };
        Some(format!("the {what} differs: {how}"))
    })
}

fn is_same(there: &SentFile, here: &MeshFile) -> bool {
    there.bytes == here.bytes.len() as u64 && there.blake3 == blake3::hash(&here.bytes).to_hex().as_str()
}

/// The first option that differs. Where the session was made without one that is given here, `usual` has what it took.
fn different_options(
    there: &Map<String, Value>,
    here: &Map<String, Value>,
    usual: &Map<String, Value>,
) -> Option<String> {
    let names = here.keys().chain(there.keys()).filter(|name| !LEFT_OUT.contains(&name.as_str()));
    names.map(|name| (name, here.get(name), there.get(name))).find_map(|(name, here, there)| {
        // Their number need not be known at the beginning.
        if name == "frames" && there.is_none() {
            return None;
        }
        let there = there.or_else(|| here.and(usual.get(name)));
        let said = |value: Option<&Value>| match value {
            None => "none".to_owned(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        };
        let (session, command) = (said(there), said(here));
        (here != there).then(|| format!("the option {name} differs: the session has {session}, this command {command}"))
    })
}

fn object(value: &impl serde::Serialize) -> Map<String, Value> {
    match serde_json::to_value(value) {
        Ok(Value::Object(members)) => members,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_client::messages::SessionOptions;

    #[test]
    fn options_are_compared_with_what_is_usual() {
        let options = |change: &dyn Fn(&mut SessionOptions)| {
            let mut options = SessionOptions { coordinates: Some("mvc".to_owned()), ..SessionOptions::default() };
            change(&mut options);
            object(&options)
        };
        let usual =
            object(&serde_json::json!({"coordinates": "mvc", "handles": "spread", "lambda": 1.0, "spectrum": 20}));
        let different = |there: &dyn Fn(&mut SessionOptions), here: &dyn Fn(&mut SessionOptions)| {
            different_options(&options(there), &options(here), &usual)
        };
        let nothing = |_: &mut SessionOptions| ();
        assert_eq!(different(&nothing, &nothing), None);
        assert_eq!(different(&nothing, &|o| o.name = Some("another".to_owned())), None);
        assert_eq!(different(&|o| o.coordinates = None, &nothing), None);
        assert_eq!(different(&nothing, &|o| o.spectrum = Some(20)), None);
        assert_eq!(different(&nothing, &|o| o.frames = Some(20)), None);
        let said = different(&|o| o.coordinates = Some("green".to_owned()), &nothing).expect("a difference");
        assert_eq!(said, "the option coordinates differs: the session has green, this command mvc");
        let said = different(&|o| o.max_error = Some(1e-3), &nothing).expect("a difference");
        assert_eq!(said, "the option max_error differs: the session has 0.001, this command none");
        assert!(
            different(&nothing, &|o| o.lambda = Some(0.5))
                .is_some_and(|said| said.contains("has 1.0, this command 0.5"))
        );
        assert!(different(&nothing, &|o| o.flip_cage = true).is_some_and(|said| said.contains("flip_cage")));
        assert!(different(&|o| o.frames = Some(30), &|o| o.frames = Some(20)).is_some());
    }
}
