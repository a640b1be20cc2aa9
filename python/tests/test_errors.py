"""What cannot be used is refused with a CagerError that names it; nothing else reaches Python."""

import numpy as np
import pytest

import cager


def with_value(array, place, value):
    changed = np.array(array, float)
    changed[place] = value
    return changed


REST = [
    (lambda s: s.rest[:, :2], "rest: has the shape 386 × 2; give an array of n × 3"),
    (lambda s: s.rest.ravel(), "rest: has the shape 1158"),
    (lambda s: 3.0, "rest: has a single number"),
    (lambda s: np.zeros((0, 3)), "rest: has no points"),
    (lambda s: with_value(s.rest, (7, 1), np.nan), "rest: point 7 has a coordinate that is NaN"),
    (lambda s: with_value(s.rest, (7, 1), np.inf), "rest: point 7 "),
    (lambda s: s.rest.astype(str), "rest: has elements of the type <U"),
    (lambda s: s.rest.astype(complex), "rest: has elements of the type complex128"),
    (lambda s: [[0, 0, 0], [1]], "rest: cannot be read as an array of numbers"),
    (lambda s: None, "rest: has elements of the type object"),
    (lambda s: np.zeros((386, 3)), "rest"),
    (lambda s: s.rest[:50], "frames: frame 0 has 386 points where 50 are expected"),
]

FACES = [
    ([[0, 1, 386]], "faces: face 0 names vertex 386, but there are 386"),
    ([[0, 1, 2], [0, -1, 2]], "faces: face 1 names vertex -1"),
    ([[0, 1]], "faces: face 0 has 2 vertices"),
    ([[0, 1, 2**40]], "faces: face 0 names vertex"),
    ([[0, 1, 2**80]], "faces: are no faces"),
    ([[0.5, 1, 2]], "faces: are no faces"),
    ([0, 1, 2], "faces: are no faces"),
    (5, "faces: are no faces"),
    ("abc", "faces: "),
]

FRAMES = [
    (lambda s: s.frames[0], "frames: has the shape 386 × 3; give an array of f × n × 3"),
    (lambda s: s.frames[:0], "frames: has no frames"),
    (lambda s: [], "frames: has no frames"),
    (lambda s: 7, "frames: are no frames"),
    (lambda s: "walk.npy", "frames: are no frames"),
    (lambda s: s.frames[:, 1:], "frames: frame 0 has 385 points where 386 are expected"),
    (lambda s: [*s.frames, s.frames[0][1:]], "frames: frame 10 has 385 points"),
    (lambda s: [s.frames[0], s.frames[0].T], r"frames\[1\]: has the shape 3 × 386"),
    (lambda s: with_value(s.frames, (4, 5, 0), np.nan), "frames: frame 4: point 5 has a coordinate that is NaN"),
    (lambda s: with_value(s.frames, (4, 5, 0), 1e39), "frame 4: point 5 has the coordinate 1e39, too large"),
    (lambda s: 1000 * s.frames, "frames: does not look like a capture of rest.*scale one of them, or pass force=True"),
    (lambda s: s.frames[:, np.random.default_rng(1).permutation(386)], "frames: does not look like a capture of rest"),
]

CAGES = [
    (lambda v, f: (v[:, :2], f), "cage: has the shape 42 × 2"),
    (lambda v, f: (v, f[:, ::-1]), r"cage: .*turn them with faces\[:, ::-1\]"),
    (lambda v, f: (v, f[1:]), "cage: the cage is open"),
    (lambda v, f: (v, f + 1), "cage faces: face [0-9]+ names vertex 42"),
    (lambda v, f: (with_value(v, (3, 0), np.nan), f), "cage: point 3 "),
    (lambda v, f: (v[:0], f[:0]), "cage: has no points"),
    (lambda v, f: (v, f[:0]), "cage: the cage has 42 vertices and 0 faces"),
]


@pytest.mark.parametrize("rest, words", REST)
def test_a_wrong_rest_pose_is_named(small, rest, words):
    with pytest.raises(cager.CagerError, match=words):
        cager.encode(rest(small), None, small.frames, small.cage)


@pytest.mark.parametrize("faces, words", FACES)
def test_wrong_faces_are_named(small, faces, words):
    with pytest.raises(cager.CagerError, match=words):
        cager.encode(small.rest, faces, small.frames, small.cage)


@pytest.mark.parametrize("frames, words", FRAMES)
def test_wrong_frames_are_named(small, frames, words):
    for call in (cager.encode, cager.design_cage):
        with pytest.raises(cager.CagerError, match=words):
            call(small.rest, small.faces, frames(small))


@pytest.mark.parametrize("change, words", CAGES)
def test_a_wrong_cage_is_named(small, change, words):
    cage = change(*small.cage)
    with pytest.raises(cager.CagerError, match=words):
        cager.encode(small.rest, small.faces, small.frames, cage)
    with pytest.raises(cager.CagerError, match=words):
        cager.coordinates(small.rest, *cage)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"max_error": 0}, "max_error: is 0"),
        ({"max_error": float("nan")}, "max_error: is NaN"),
        ({"max_error": 2}, "max_error: is 2"),
        ({"mean_error": -1}, "mean_error: is -1"),
        ({"max_error": 1e-3, "mean_error": 1e-3}, "max_error: either"),
        ({"max_error": 1e-12}, "below what positions in single precision can hold"),
        ({"coordinates": "bilinear"}, 'coordinates: there is no "bilinear"; give one of mvc'),
        ({"vertices": 30}, "vertices: either"),
        ({"frame_rate": 0}, "frame_rate: is 0"),
        ({"cage": None, "vertices": 1000}, "ask for fewer vertices"),
        ({"cage": None, "vertices": 3}, "vertices|cage"),
    ],
)
def test_wrong_options_are_named(small, options, words):
    with pytest.raises(cager.CagerError, match=words):
        cager.encode(small.rest, small.faces, small.frames, **{"cage": small.cage, **options})


def test_a_frame_that_departs_is_named_unless_it_is_forced(small):
    frames = [*small.frames, *(100 * small.frames[[9, 9, 8]]), small.frames[0]]
    with pytest.raises(cager.CagerError, match="frames: .*pass force=True to go on"):
        cager.encode(small.rest, small.faces, frames, small.cage)
    assert len(cager.encode(small.rest, small.faces, frames, small.cage, force=True)) == 14


def test_a_cage_of_another_model_is_named(small):
    vertices, faces = small.cage
    for wrong, words in (
        (0.3048 * vertices, "leaves 386 of 386 points of the rest pose outside, and .*scaled"),
        (vertices + [0, 0, 0.7], "leaves [0-9]+ of 386 points of the rest pose outside"),
        (100 * vertices, "is [0-9]+ times larger than the rest pose"),
    ):
        with pytest.raises(cager.CagerError, match=f"cage: {words}.*pass force=True to go on"):
            cager.encode(small.rest, small.faces, small.frames, (wrong, faces))


def test_files_that_are_no_containers_are_named(small, tmp_path):
    path = tmp_path / "walk.cager"
    for contents in (b"", b"not a container", bytes(100_000)):
        path.write_bytes(contents)
        with pytest.raises(cager.CagerError, match="walk.cager: "):
            cager.open(path)
    for missing in (tmp_path / "other.cager", tmp_path):
        with pytest.raises(cager.CagerError, match=str(missing)):
            cager.open(missing)
    cager.encode(small.rest, small.faces, small.frames, small.cage, max_error=1e-3).save(path, overwrite=True)
    whole = path.read_bytes()
    for at in range(8, len(whole), len(whole) // 60):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            capture = cager.open(path)
            capture.decode(), capture.cages
        except cager.CagerError as error:
            assert "walk.cager" in str(error)
        path.write_bytes(whole[:at])
        with pytest.raises(cager.CagerError):
            cager.open(path)


def raising(frames, error):
    yield frames[0]
    raise error


@pytest.mark.parametrize("error", [OSError("the disk is gone"), KeyboardInterrupt(), MemoryError()])
def test_what_an_iterator_raises_is_passed_on(small, error):
    with pytest.raises(type(error)):
        cager.encode(small.rest, small.faces, raising(small.frames, error), small.cage)


def test_the_error_is_a_value_error():
    assert issubclass(cager.CagerError, ValueError)
