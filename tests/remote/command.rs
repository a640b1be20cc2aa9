//! `cager encode --server`.

use crate::server::{Server, capture, sessions};
use crate::support::{ENCODE, Small, npy_f64, read_frames, split};
use cager_proto::container::ContainerReader;
use serde_json::Value;
use std::collections::HashSet;
use std::io::Cursor;

/// The beginning of a picture.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n of one texel";

/// A token and its SHA-256.
const TOKEN: &str = "open-sesame-open-sesame-open-sesame";
const HASH: &str = "2482b372f3c76c863606bc41264596d81f6a2bd5cfd3d5c389f1436040912d4f";

#[test]
fn a_service_gives_the_bytes_and_the_report_that_this_machine_gives() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let head = "%%MatrixMarket matrix coordinate real general\n";
    let columns = Small::new().cage.vertices.len();
    dir.write("d.mtx", format!("{head}2 {columns} 3\n1 1 1\n1 2 -1\n2 3 0.5\n"));
    for options in [
        "",
        " --handles all",
        " --regularizer tikhonov --lambda 0.01",
        " --spectrum 3",
        " --handles spread",
        " --handles rectangular --handle-count 100",
        " --regularizer differential --spectrum all",
        " --regularizer temporal",
        " --regularizer matrix --regularizer-matrix d.mtx",
        " --coordinates harmonic",
        " --coordinates green --handles maxvol",
        " --coordinates green-free",
        " --max-error 1e-3",
        " --quality preview --coordinates green",
        " --quality standard --exact-rest",
        " --mean-error 1e-3",
        " --mean-error 1e-3 --coordinates green-free",
        " --max-error 1e-3 --handles spread",
        " --max-error 1e-3 --lambda 0.5",
        " --max-error 1e-3 --spectrum 3",
        " --max-error 1e-3 --regularizer laplacian",
        " --target-size 20KB",
    ] {
        dir.cager(&format!("{ENCODE} --report here.json{options}")).succeeds();
        let here = dir.read("out.cager");
        let said =
            dir.cager(&format!("{ENCODE} --report there.json{options} --server {}", server.address())).succeeds();
        assert!(dir.read("out.cager") == here, "{options}: other bytes");
        let [mut here, mut there] = ["here.json", "there.json"].map(|name| dir.json(name));
        for report in [&mut here, &mut there] {
            assert!(report["seconds"]["total"].as_f64() > Some(0.0));
            report["seconds"] = Value::Null;
            // A service knows the worst frame, but has not kept the point.
            assert!(report["error"]["worst"]["frame"].is_u64(), "{report}");
            report["error"]["worst"] = Value::Null;
            // Nor how the iteration of each frame went.
            report["consistency"] = Value::Null;
            // Coded files leave out the spectrum.
            if report["coding"].is_object() {
                report["singular_values"] = Value::Null;
            }
        }
        assert_eq!(here, there, "{options}");
        assert!(said.stdout.contains("20 frames of") && said.stdout.contains(&server.address()), "{}", said.stdout);
    }
}

#[test]
fn the_cage_of_a_container_is_sent_as_a_mesh() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    dir.cager(ENCODE).succeeds();
    dir.write("first.cager", dir.read("out.cager"));
    let line = ENCODE.replace("cage.obj", "first.cager");
    dir.cager(&format!("{line} --server {}", server.address())).succeeds();
    assert!(dir.read("out.cager") == dir.read("first.cager"), "another cage");
}

#[test]
fn a_capture_in_doubles_is_sent_in_singles() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let singles = read_frames(&dir.path("frames.npy"), Small::new().rest.points.len());
    let doubles: Vec<Vec<f64>> = singles.iter().map(|frame| frame.iter().map(|x| x * (1.0 + 1e-9)).collect()).collect();
    assert_ne!(doubles, singles);
    dir.cager(ENCODE).succeeds();
    let rounded = dir.read("out.cager");
    dir.write("frames.npy", npy_f64(&doubles));
    dir.cager(&format!("{ENCODE} --server {}", server.address())).succeeds();
    assert!(dir.read("out.cager") == rounded, "other bytes than those of the rounded capture");
}

#[test]
fn pictures_go_through_a_service() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let text = String::from_utf8(dir.read("rest.obj")).expect("text");
    let (faces, points): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with("f "));
    let corners = |line: &str| line.split(' ').skip(1).map(|word| format!(" {word}/1")).collect::<String>();
    let faces: String = faces.into_iter().map(|line| format!("f{}\n", corners(line))).collect();
    dir.write("rest.obj", format!("mtllib a.mtl\n{}\nvt 0.5 0.25\nusemtl skin\n{faces}", points.join("\n")));
    dir.write("a.mtl", "newmtl skin\nmap_Kd maps/skin.png\nmap_Pr maps/rough.png\n");
    ["maps/skin.png", "maps/rough.png"].iter().for_each(|name| dir.write(name, PNG));
    dir.write("maps/rough.png", [PNG, b"another"].concat());
    for options in ["", " --max-error 1e-3", " --unit cm", " --max-error 1e-3 --unit cm"] {
        let line = format!("{ENCODE}{options} --textures embed");
        dir.cager(&line).succeeds();
        let here = dir.read("out.cager");
        dir.cager(&format!("{line} --server {}", server.address())).succeeds();
        let there = dir.read("out.cager");
        let pictures = |bytes: &[u8]| {
            ContainerReader::open(Cursor::new(bytes)).expect("a container").pictures().expect("pictures")
        };
        assert_eq!(pictures(&here).len(), 2, "{options}");
        assert_eq!(pictures(&there), pictures(&here), "{options}");
        assert!(there == here, "{options}: other bytes");
        dir.cager("decode out.cager -o decoded.usdc --overwrite").succeeds();
        assert_eq!(dir.read("decoded_textures/skin.png"), PNG, "{options}");
    }
    // A cage that the service designs from the packed rest pose.
    let line = ENCODE.replace(" --cage cage.obj", "") + " --cage-vertices 60 --textures embed";
    dir.cager(&format!("{line} --server {}", server.address())).succeeds();
    dir.cager("decode out.cager -o designed.usdc").succeeds();
    assert_eq!(dir.read("designed_textures/skin.png"), PNG);
    // Pictures that are not asked for are not sent.
    dir.cager(&format!("{ENCODE} --server {}", server.address())).succeeds();
    assert!(!dir.cager("inspect out.cager").succeeds().stdout.contains("pict"));
}

#[test]
fn seams_are_welded_before_anything_is_sent() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let mut small = Small::new();
    small.rest.colors = (0..small.rest.points.len()).map(|k| [k as u8, (k / 256) as u8, 255]).collect();
    let (rest, from) = split(&small.rest);
    dir.model("rest.obj", &rest);
    let seamed = |frame: &Vec<f64>| from.iter().flat_map(|&v| [0, 1, 2].map(|k| frame[3 * v + k])).collect();
    let frames: Vec<Vec<f64>> = small.frames.iter().map(seamed).collect();
    let rounded: Vec<Vec<f64>> =
        frames.iter().map(|frame| frame.iter().map(|&x| f64::from(x as f32)).collect()).collect();
    dir.write("frames.npy", npy_f64(&rounded));
    dir.cager(&format!("{ENCODE} --weld")).succeeds();
    let here = dir.read("out.cager");
    // Each point keeps the colour of the first of those that became it.
    let mut seen = HashSet::new();
    let firsts = from.iter().filter(|&&v| seen.insert(v)).map(|&v| small.rest.colors[v]);
    let found = ContainerReader::open(Cursor::new(&here)).expect("a container").colors().expect("colours");
    assert_eq!(found, firsts.collect::<Vec<_>>());
    dir.cager(&format!("{ENCODE} --weld --server {}", server.address())).succeeds();
    assert!(dir.read("out.cager") == here, "other bytes");
}

#[test]
fn without_a_cage_the_service_designs_one_and_keeps_nothing_of_the_design() {
    let (dir, ..) = capture();
    let server = Server::start(&dir);
    let encode = ENCODE.replace(" --cage cage.obj", "") + " --report r.json --server " + &server.address();
    dir.cager(&format!("{encode} --cage-vertices 60")).succeeds();
    let report = dir.json("r.json");
    assert!(report["cage_vertices"].as_u64().is_some_and(|vertices| vertices <= 60), "{report}");
    assert_eq!(report["frames"], 20);
    assert_eq!(report["design"]["vertices"], report["cage_vertices"]);
    assert!(report["design"]["stages"].as_array().is_some_and(|stages| stages.len() > 1), "{report}");
    assert_eq!(designs(&server), 0);
    // The container has the cage, so that it decodes without the service.
    dir.cager("decode out.cager -o decoded.npy").succeeds();

    // For an error the number of vertices is found before, from the frames that are here.
    let said = dir.cager(&format!("{encode} --max-error 0.05 --time-limit 1")).succeeds().stdout;
    assert!(said.contains("vertices, estimated from what a small cage leaves"), "{said}");
    assert!(dir.json("r.json")["cage_vertices"].as_u64().is_some_and(|vertices| vertices <= 80), "{said}");

    for (options, status, word) in [
        ("--mean-error -1", 1, "--mean-error: is -1"),
        ("--mean-error 0.01 --cage-vertices 60", 2, "cannot be used with"),
        ("--cage-vertices 3", 2, "3 is not in"),
        ("--spectrum all", 1, "--spectrum all"),
    ] {
        let said = dir.cager(&format!("{encode} {options}")).run();
        assert_eq!(said.status, Some(status), "{options}");
        assert!(said.stderr.contains(word), "{options}: {}", said.stderr);
    }
    assert_eq!((designs(&server), sessions(&server).len()), (0, 2));
}

#[tokio::main(flavor = "current_thread")]
async fn designs(server: &Server) -> usize {
    server.client().cage_jobs().await.expect("designs").len()
}

#[test]
fn an_address_without_a_service_is_told_at_once() {
    let (dir, ..) = capture();
    let free = std::net::TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a port");
    let said = dir.cager(&format!("{ENCODE} --server http://{free}")).run();
    assert_eq!(said.status, Some(1));
    assert!(said.stderr.contains(&format!("http://{free} cannot be reached")), "{}", said.stderr);
    let said = dir.cager(&format!("{ENCODE} --server localhost:8080")).run();
    assert!(said.stderr.contains("not the address of a service"), "{}", said.stderr);
    assert!(!dir.path("out.cager").exists());
}

#[test]
fn a_guarded_service_wants_a_token_from_the_command_line_or_the_environment() {
    let (dir, ..) = capture();
    dir.write("tokens.toml", format!("[[token]]\nname = \"me\"\ntenant = \"us\"\nsha256 = \"{HASH}\"\n"));
    restrict(&dir, "tokens.toml");
    let server = Server::start_at(&dir, "127.0.0.1:0", &["--tokens", "tokens.toml"]);
    let encode = format!("{ENCODE} --server {}", server.address());
    let said = dir.cager(&encode).env("CAGER_TOKEN", "").run();
    assert_eq!(said.status, Some(1));
    assert!(said.stderr.contains("needs a token"), "{}", said.stderr);
    let said = dir.cager(&format!("{encode} --token wrong")).run();
    assert!(said.status == Some(1) && !said.stderr.contains("wrong"), "{}", said.stderr);
    dir.cager(&format!("{encode} --token {TOKEN}")).succeeds();
    dir.cager(&encode).env("CAGER_TOKEN", TOKEN).succeeds();
}

#[test]
fn a_service_behind_tls_is_used_if_its_certificate_is_trusted() {
    let (dir, ..) = capture();
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    dir.write("certificate.pem", made.cert.pem());
    dir.write("key.pem", made.signing_key.serialize_pem());
    restrict(&dir, "key.pem");
    let files = ["--tls-certificate", "certificate.pem", "--tls-key", "key.pem"];
    let server = Server::start_at(&dir, "127.0.0.1:0", &files);
    let place = server.place.replace("127.0.0.1", "localhost");
    let encode = format!("{ENCODE} --server https://{place}");
    dir.cager(&encode).env("SSL_CERT_FILE", "certificate.pem").succeeds();
    let said = dir.cager(&encode).run();
    assert_eq!(said.status, Some(1));
    assert!(said.stderr.contains("certificate"), "{}", said.stderr);
}

#[cfg(unix)]
fn restrict(dir: &crate::support::Dir, name: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(dir.path(name), std::fs::Permissions::from_mode(0o600)).expect(name);
}
