//! Encodes one capture: create a session, upload its frames, complete it, download the container.

use cager_client::{Client, FnFrames, MeshFile, NewSession, UploadOptions};
use std::{env, fs, time::Duration};

#[tokio::main]
pub(crate) async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut client = Client::new(env::var("CAGER_SERVER").as_deref().unwrap_or("http://127.0.0.1:8080"))?;
    if let Some(token) = env::var("CAGER_TOKEN").ok().filter(|token| !token.is_empty()) {
        client = client.with_token(&token);
    }
    let (rest, cage) = (fs::read("rest.obj")?, fs::read("cage.obj")?);
    let session =
        client.create(&NewSession::new(MeshFile::new("rest.obj", rest), MeshFile::new("cage.obj", cage))).await?;
    let session = client.wait_ready(&session.id, Duration::from_secs(600)).await?;
    // Frames may come from anywhere; here frame 12 is the little-endian file 12.f32, one x y z after another.
    let frames = FnFrames::new(session.points.unwrap_or(0) as usize, None, |frame, out| {
        let Ok(bytes) = fs::read(format!("{frame}.f32")) else { return Ok(false) };
        out.extend(bytes.as_chunks().0.iter().map(|&value| f32::from_le_bytes(value)));
        Ok(true)
    });
    let uploaded = client.upload(&session, frames, UploadOptions::default()).await?;
    client.complete(&session.id, uploaded.frames).await?;
    client.download(&session.id, &mut fs::File::create("capture.cager")?).await?;
    Ok(())
}
