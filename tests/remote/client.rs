//! The client crate against a service.

use crate::server::{Server, capture, ready};
use crate::support::{ENCODE, read_cages, read_frames};
use cager_client::cage_messages::CageState;
use cager_client::messages::{CageSource, FrameResult, Problem, Session, SessionOptions, SessionState};
use cager_client::{
    CageFrame, Client, ClientError, ClientOptions, FnFrames, Layer, LocalDecoder, MemoryFrames, MeshFile, NewCage,
    NewSession, Rows, UploadOptions,
};
use futures_util::{StreamExt as _, TryStreamExt as _};
use std::time::Duration;

async fn upload(client: &Client, session: &Session, points: usize, values: &[f32]) -> Vec<u32> {
    let mut reported = Vec::new();
    let mut on_frame = |result: FrameResult| {
        assert!(result.l2.is_some() && result.linf.is_some());
        reported.push(result.frame);
    };
    let options = UploadOptions { on_frame: Some(&mut on_frame), ..UploadOptions::default() };
    client.upload(session, MemoryFrames::new(points, values), options).await.expect("an upload");
    reported.sort_unstable();
    reported
}

#[tokio::test]
async fn cages_can_be_followed_decoded_and_downloaded() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let client = server.client();
    let session = ready(&client, &dir).await;
    let id = session.id.as_str();

    let (following, watching) = (client.follow(id, 0), client.events(id));
    let followed = tokio::spawn(following.try_collect::<Vec<CageFrame>>());
    let watched = tokio::spawn(watching.try_collect::<Vec<_>>());
    assert_eq!(upload(&client, &session, points, &values).await, (0..20).collect::<Vec<_>>());
    let completed = client.complete(id, 20).await.expect("complete");
    assert_eq!(completed.state, SessionState::Completed);
    assert_eq!(client.complete(id, 20).await.expect("complete again").frames.solved, 20);

    let followed = followed.await.expect("no panic").expect("all cages");
    assert_eq!(followed.iter().map(|c| c.frame).collect::<Vec<_>>(), (0..20).collect::<Vec<_>>());
    let progress = watched.await.expect("no panic").expect("progress");
    assert_eq!(progress.last().map(|p| (p.state, p.solved)), Some((SessionState::Completed, 20)));
    assert_eq!(client.cages(id, 3, 5).await.expect("cages"), followed[3..8]);
    let errors = client.errors(id).await.expect("errors");
    assert_eq!(
        errors.iter().map(|e| (e.l2, e.linf)).collect::<Vec<_>>(),
        followed.iter().map(|c| (c.l2, c.linf)).collect::<Vec<_>>()
    );
    assert_eq!(client.handles(id).await.expect("handles").len(), session.handle_count.expect("ready") as usize);

    let mut file = Vec::new();
    assert_eq!(client.download(id, &mut file).await.expect("a container"), file.len() as u64);
    dir.write("there.cager", &file);
    dir.cager(ENCODE).succeeds();
    assert!(dir.read("out.cager") == file, "other bytes than on this machine");
    let cages: Vec<Vec<f32>> = followed.into_iter().map(|c| c.values).collect();
    assert_eq!(read_cages(&dir.path("there.cager")), cages);

    // Three ways to positions, one result: here from Φ, by the service, and by a decoder of the file.
    let local = LocalDecoder::fetch(&client, id).await.expect("coordinates");
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let positions = local.decode(&views).expect("positions").concat();
    assert_eq!(client.decode(id, &cages.concat()).await.expect("positions"), positions);
    dir.cager("decode there.cager -o decoded.npy").succeeds();
    let decoded: Vec<f32> = read_frames(&dir.path("decoded.npy"), points).concat().iter().map(|&x| x as f32).collect();
    assert_eq!(decoded, positions);
    // The session's own model as another one, and a file that is no model.
    let rest = MeshFile::new("other.obj", dir.read("rest.obj"));
    let moved = client.decode_model(id, &rest, &cages.concat()).await.expect("positions");
    assert_eq!((moved.outside, moved.positions), (0, positions));
    let none = MeshFile::new("other.obj", "v 0 0\n");
    assert_eq!(client.decode_model(id, &none, &cages[0]).await.expect_err("no model").status(), Some(422));
    assert!(client.decode_model(id, &rest, &[0.0; 7]).await.is_err());

    assert_eq!(client.sessions().await.expect("sessions").len(), 1);
    client.delete(id).await.expect("deleted");
    assert_eq!(client.session(id).await.expect_err("gone").status(), Some(404));
    assert_eq!(client.delete(id).await.expect_err("gone").status(), Some(404));
}

#[tokio::test]
async fn a_coded_capture_is_followed_through_a_restart_and_decoded_by_layers() {
    let (dir, points, values) = capture();
    let mut server = Server::start(&dir);
    let place = server.place.clone();
    let client = server.client();
    let meshes = ["rest.obj", "cage.obj"].map(|name| MeshFile::new(name, dir.read(name)));
    let [rest, cage] = meshes;
    let options = SessionOptions { max_error: Some(1e-3), ..SessionOptions::default() };
    let new = NewSession { options, ..NewSession::new(rest, cage) };
    let id = client.create(&new).await.expect("a session").id;
    let session = client.wait_ready(&id, Duration::from_secs(60)).await.expect("ready");
    let (follower, followed_id) = (client.clone(), id.clone());
    let followed = tokio::spawn(async move {
        let mut out = Vec::new();
        follower.follow_container(&followed_id, &mut out).await.map(|bytes| (bytes, out))
    });
    let half = 3 * points * 10;
    upload(&client, &session, points, &values[..half]).await;
    server.kill();
    let _server = Server::start_at(&dir, &place, &[]);
    upload(&client, &session, points, &values).await;
    client.complete(&id, 20).await.expect("complete");
    let (bytes, followed) = followed.await.expect("no panic").expect("followed to the end");
    let mut file = Vec::new();
    client.download(&id, &mut file).await.expect("a container");
    assert!(bytes == file.len() as u64 && followed == file, "the stream is the container");

    dir.write("there.cager", &file);
    for (layer, name) in [(Layer::Cages, "cages"), (Layer::All, "all")] {
        dir.cager(&format!("decode there.cager -o {name}.npy --layer {name}")).succeeds();
        let decoded = read_frames(&dir.path(&format!("{name}.npy")), points);
        let here: Vec<f32> = decoded[5..9].concat().iter().map(|&x| x as f32).collect();
        assert_eq!(client.decode_frames(&id, 5..9, layer).await.expect("positions"), here, "{name}");
    }
    assert_eq!(client.decode_frames(&id, 15..21, Layer::All).await.expect_err("too many").status(), Some(409));
}

#[tokio::test]
async fn handle_rows_give_the_same_cages_over_http1_too() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let client = server.client().with_options(ClientOptions { http2: false, ..ClientOptions::default() });
    let (whole, handles) = (ready(&client, &dir).await, ready(&client, &dir).await);
    let options = UploadOptions { connections: 4, ..UploadOptions::default() };
    client.upload(&whole, MemoryFrames::new(points, values.as_slice()), options).await.expect("an upload");
    let options = UploadOptions { rows: Rows::Handles, ..UploadOptions::default() };
    let uploaded = client.upload(&handles, MemoryFrames::new(points, values), options).await.expect("an upload");
    assert_eq!(uploaded.sent_bytes, 20 * (28 + 12 * u64::from(handles.handle_count.expect("ready"))));
    let cages = |frames: Vec<CageFrame>| frames.into_iter().map(|c| c.values).collect::<Vec<_>>();
    let [a, b] = [whole, handles].map(|session| session.id);
    assert_eq!(
        cages(client.cages(&a, 0, 20).await.expect("cages")),
        cages(client.cages(&b, 0, 20).await.expect("cages"))
    );
}

#[tokio::test]
async fn gaps_are_filled_and_other_content_is_refused() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let client = server.client();
    let session = ready(&client, &dir).await;
    // Every third frame first, by hand.
    let http = reqwest::Client::new();
    for frame in (0..20).step_by(3) {
        let bytes: Vec<u8> = values[frame * 3 * points..][..3 * points].iter().flat_map(|x| x.to_le_bytes()).collect();
        let place = format!("{}/v1/sessions/{}/frames?first={frame}", server.address(), session.id);
        let request = http.post(place).header("content-type", "application/octet-stream").body(bytes);
        assert!(request.send().await.expect("an answer").status().is_success());
    }
    let error = client.complete(&session.id, 20).await.expect_err("frames are missing");
    assert_eq!(error.problem().map(Problem::word), Some("frames-missing"));
    assert_eq!(upload(&client, &session, points, &values).await, (0..20).collect::<Vec<_>>());

    let longer = [values.clone(), vec![0.0; 3 * points - 1], vec![f32::INFINITY]].concat();
    let error = client.upload(&session, MemoryFrames::new(points, longer), UploadOptions::default()).await;
    let problem = error.expect_err("not finite").problem().cloned().expect("a problem");
    assert_eq!((problem.word(), problem.frame), ("invalid-frame", Some(20)));
    client.complete(&session.id, 20).await.expect("complete");
}

#[tokio::test]
async fn a_bad_frame_in_a_long_upload_is_named_whatever_the_protocol() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    for http2 in [true, false] {
        let client = server.client().with_options(ClientOptions { http2, ..ClientOptions::default() });
        let session = ready(&client, &dir).await;
        let values = values.clone();
        // Far more than the connection's buffers hold comes after it.
        let frames = FnFrames::new(points, Some(5000), move |number, out| {
            out.extend_from_slice(&values[(number as usize % 20) * 3 * points..][..3 * points]);
            if number == 1234 {
                out[77] = f32::NAN;
            }
            Ok(true)
        });
        let error = client.upload(&session, frames, UploadOptions::default()).await.expect_err("a bad frame");
        let problem = error.problem().unwrap_or_else(|| panic!("http2 {http2}: {error}"));
        assert_eq!((problem.word(), problem.frame), ("invalid-frame", Some(1234)), "http2 {http2}");
    }
}

#[tokio::test]
async fn a_bad_pair_fails_with_the_reason() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let client = server.client();
    let cage = String::from_utf8(dir.read("cage.obj")).expect("text");
    let open =
        cage.lines().filter(|line| !line.starts_with("f ")).map(|l| format!("{l}\n")).collect::<String>() + "f 1 2 3\n";
    let new = NewSession::new(MeshFile::new("rest.obj", dir.read("rest.obj")), MeshFile::new("cage.obj", open));
    let outcome = match client.create(&new).await {
        Ok(session) => client.wait_ready(&session.id, Duration::from_secs(60)).await,
        refused => refused,
    };
    let error = outcome.expect_err("an open cage");
    assert_eq!(error.problem().map(Problem::word), Some("invalid-geometry"), "{error}");
}

#[tokio::test]
async fn a_session_deleted_under_an_upload_ends_it() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let client = server.client();
    let session = ready(&client, &dir).await;
    let follower = tokio::spawn(client.follow(&session.id, 0).try_collect::<Vec<CageFrame>>());
    // Slow enough to be deleted in the middle.
    let frame = move |number: u32, out: &mut Vec<f32>| {
        std::thread::sleep(Duration::from_millis(20));
        out.extend_from_slice(&values[(number as usize % 20) * 3 * points..][..3 * points]);
        Ok(true)
    };
    let (uploader, watched) = (client.clone(), session.clone());
    let frames = FnFrames::new(points, Some(1000), frame);
    let upload = tokio::spawn(async move { uploader.upload(&watched, frames, UploadOptions::default()).await });
    tokio::time::sleep(Duration::from_millis(300)).await;
    client.delete(&session.id).await.expect("deleted");
    let error = upload.await.expect("no panic").expect_err("deleted");
    assert!(matches!(error.status(), Some(404 | 410)), "{error}");
    let error = follower.await.expect("no panic").expect_err("deleted");
    assert!(matches!(&error, ClientError::Refused(_)) && error.status() == Some(404), "{error}");
}

#[tokio::test]
async fn a_cage_is_designed_followed_fetched_used_and_deleted() {
    let (dir, points, values) = capture();
    let server = Server::start(&dir);
    let client = server.client();
    let rest = || MeshFile::new("rest.obj", dir.read("rest.obj"));
    let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut new = NewCage::new(rest(), MeshFile::new("frames.f32", bytes));
    new.options.frames = Some((values.len() / points / 3) as u32);
    new.options.vertices = Some(60);
    new.options.time_limit_s = Some(3.0);
    new.idempotency_key = Some("the same".to_owned());
    let job = client.design_cage(&new).await.expect("a design");
    assert_eq!(client.design_cage(&new).await.expect("the same design").id, job.id);
    let heard: Vec<_> = client.cage_events(&job.id).collect().await;
    let last = heard.last().expect("an event").as_ref().expect("progress");
    assert_eq!((last.state, last.fraction), (CageState::Completed, 1.0));
    let job = client.wait_cage(&job.id, Duration::from_secs(60)).await.expect("a cage");
    assert_eq!(client.cage_jobs().await.expect("designs"), std::slice::from_ref(&job));
    let obj = client.cage_obj(&job.id).await.expect("a cage");
    assert!(obj.starts_with(b"v "));
    let mut new = NewSession::new(rest(), MeshFile::new("cage.obj", obj));
    new.cage = None;
    new.options.cage = Some(CageSource { id: Some(job.id.clone()), ..CageSource::default() });
    let session = client.create(&new).await.expect("a session");
    client.delete_cage(&job.id).await.expect("deleted");
    assert!(matches!(client.cage_job(&job.id).await, Err(ClientError::Refused(problem)) if problem.status == 404));
    let session = client.wait_ready(&session.id, Duration::from_secs(60)).await.expect("a ready session");
    assert_eq!(session.cage_vertices, job.vertices);
}
