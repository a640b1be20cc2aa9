//! Git LFS pointers in place of files.

use crate::refused::refused;
use crate::support::Dir;

const POINTER: &str = "is a Git LFS pointer, not the file itself; run git lfs pull";

fn pointers() -> Dir {
    Dir::with_case("18-git-lfs-pointers")
}

#[test]
fn a_pointer_in_place_of_a_mesh_is_called_one() {
    let dir = pointers();
    for name in ["pointer.obj", "pointer.ply", "pointer.off", "pointer.stl", "pointer.glb"] {
        refused(&dir, &format!("cage --rest {name} --vertices 30 -o c.obj"), &[name, POINTER]);
    }
    refused(
        &dir,
        "encode --rest rest.obj --cage pointer.obj --frames pointer.npy -o o.cager",
        &["pointer.obj", POINTER],
    );
}

#[test]
fn a_pointer_in_place_of_frames_is_called_one() {
    let dir = pointers();
    for name in ["pointer.npy", "pointer.npz", "pointer.pc2", "pointer.mdd"] {
        dir.write(name, dir.read("pointer.npy"));
        let line = format!("encode --rest rest.obj --cage cage.obj --frames {name} -o out.cager");
        refused(&dir, &line, &[name, POINTER]);
    }
    dir.write("frames/f0.obj", dir.read("rest.obj"));
    dir.write("frames/f1.obj", dir.read("pointer.obj"));
    let line = "encode --rest rest.obj --cage cage.obj --frames frames -o out.cager";
    refused(&dir, line, &["f1.obj", "frame 1", POINTER]);
}

#[test]
fn a_pointer_in_place_of_a_container_is_called_one() {
    let dir = pointers();
    for line in [
        "inspect pointer.cager",
        "decode pointer.cager -o out.npy",
        "edit pointer.cager --with-cages frames.npy -o out.cager",
    ] {
        refused(&dir, line, &["pointer.cager", POINTER]);
    }
}

#[test]
fn what_else_stands_in_place_of_a_file_is_called_by_its_name() {
    let dir = pointers();
    for (name, bytes, what) in [
        ("old.ply", b"version https://hawser.github.com/spec/v1\noid sha256:00\nsize 1\n".as_slice(), POINTER),
        ("annex.stl", b"/annex/objects/SHA256E-s1048576--00.stl\n", "is a git-annex pointer"),
        ("page.glb", b"404: Not Found", "is a web page, not the file itself"),
        ("packed.obj", b"\x1f\x8b\x08\0\0\0\0\0\0\x03", "is packed with gzip; unpack it first"),
        ("scene.obj", b"Kaydara FBX Binary  \0\x1a\0", "is not a .obj file but a file of the kind .fbx"),
        ("rest.off", &dir.read("rest.obj"), "is not a .off file but a file of the kind .obj; rename it"),
    ] {
        dir.write(name, bytes);
        refused(&dir, &format!("cage --rest {name} --vertices 30 -o c.obj"), &[name, what]);
    }
}
