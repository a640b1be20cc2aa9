//! A person, by the rig and manifold that the command line makes.

use super::{complete, completed, container, create, post};
use crate::support::{TestApp, file, text};
use cager_formats::{open_frames, read_model, write_model};
use cager_geometry::mesh::Model;
use cager_proto::recovery_messages::{Recovery, RecoveryProgress};
use reqwest::multipart::Form;
use serde_json::json;
use std::path::Path;
use std::process::Command;

#[tokio::test]
#[ignore = "needs the captures: make captures"]
async fn a_person_is_recovered_with_the_joints_of_the_command_line() {
    let data = std::env::var("CAGER_CAPTURES").unwrap_or(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data").into());
    let man = Path::new(&data).join("anny-man-02_02");
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let rest = read_model(&man.join("rest.obj")).expect("a rest pose");
    let mut reader = open_frames(man.join("frames.npy"), rest.points.len()).expect("frames");
    let mut form = Form::new();
    for frame in 0..3 {
        let (mut numbers, name) = (Vec::new(), format!("scan_{frame}.obj"));
        reader.read_next(&mut numbers).expect("a frame");
        let posed = Model { points: numbers.as_chunks().0.to_vec(), ..rest.clone() };
        write_model(&path(&name), &posed).expect("a file");
        form = form.part("frame", file(&name, &std::fs::read(path(&name)).expect("a file")));
    }
    std::fs::copy(man.join("rest.obj"), path("rest.obj")).expect("a file");
    let cager = |arguments: &str| {
        let done = Command::new(env!("CARGO_BIN_EXE_cager"))
            .args(arguments.split(' '))
            .current_dir(folder.path())
            .output()
            .expect("the program runs");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    };
    cager("rig rest.obj --up z -o rig.json");
    cager(&format!("manifold {data}/bvh/02_02.bvh --rig rig.json --dims 5 --poses 40 -o poses.json"));
    let recover = "recover --template rest.obj --frames scan_*.obj --rig rig.json --manifold poses.json --points 2000";
    cager(&format!("{recover} --joints joints.csv -o out.cager"));

    let app = TestApp::start();
    let read = |name: &str| std::fs::read(path(name)).expect("a file");
    let parts = [("template", "rest.obj"), ("rig", "rig.json"), ("manifold", "poses.json")];
    let asked = Form::new().part("options", text(&json!({"points": 2000})));
    let asked = parts.iter().fold(asked, |form, (part, name)| form.part(*part, file(name, &read(name))));
    let job: Recovery = create(&app, asked, None).await.is(202);
    assert!(job.joints);
    let events = {
        let (api, path) = (app.stranger(), format!("/v1/recoveries/{}/events", job.id));
        tokio::spawn(async move { api.get(&path).await.expect(200).text() })
    };
    post(&app, &job.id, 0, form).await.expect(200);
    complete(&app, &job.id, 3).await.expect(202);
    completed(&app, &job.id).await;
    assert!(container(&app, &job.id).await == read("out.cager"), "another file than that of the command line");
    let joints = app.get(&format!("/v1/recoveries/{}/joints.csv", job.id)).await.expect(200).body;
    assert!(joints == read("joints.csv"), "other joints than those of the command line");
    let told = events.await.expect("a stream");
    let told =
        told.lines().filter_map(|line| serde_json::from_str::<RecoveryProgress>(line.strip_prefix("data: ")?).ok());
    let with_joints = told.flat_map(|progress| progress.frames).filter(|frame| frame.joints.len() > 10);
    assert_eq!(with_joints.count(), 3);
}
