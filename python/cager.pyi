"""Captures of animated meshes as numpy arrays, in light and editable .cager files.

n points, f frames, m vertices of the cage, k faces. Positions are arrays of any memory order; float32 and float64
are read where they lie, other numbers are converted. Vertices are counted from 0. Errors are fractions of the
diagonal of the rest pose's bounding box. Functions release the GIL while they compute.

In a process that is forked off one that has used the module, only files are opened and saved:
threads do not survive a fork. Start workers with ``multiprocessing.get_context("spawn")``.

A callback ``progress(stage, fraction)`` is told what is done and how much of it, from 0 to 1; an exception in it ends
the computation and is passed on. So does an interrupt, Ctrl-C; what cannot stop at once then ends by itself on another
thread, within seconds.
"""

from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator, Sequence
from os import PathLike
from typing import Any, Literal, NoReturn, SupportsIndex, TypedDict, TypeVar, final, overload, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Faces = ArrayLike | Sequence[Sequence[int]]
_Frames = ArrayLike | Iterable[ArrayLike]
_Progress = Callable[[str, float], object]
_Kind = Literal["mvc", "harmonic", "green", "green-free"]
_Up = Literal["y", "z"]
_Unit = Literal["mm", "cm", "m", "in", "ft"] | float
_Positions = NDArray[np.float32] | NDArray[np.float64]
_Out = TypeVar("_Out", NDArray[np.float32], NDArray[np.float64])

__all__ = ["Capture", "CagerError", "Client", "coordinates", "design_cage", "encode", "open"]
__version__: str

class CagerError(ValueError):
    """What was given cannot be used, or a file cannot be read or written; the message says which and what to do."""

@type_check_only
class _Layer(TypedDict):
    """What was added to vertices of the cage in some frames."""

    name: str
    on: bool
    frames: range
    vertices: NDArray[np.int64]

@final
class Capture:
    """A capture in a .cager file. ``len`` is the number of frames, which ``capture[t]`` decodes one by one.

    Nothing in it changes, so that copies are the capture itself. It is not pickled: save it, send the path, open it there.
    """

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[_Positions]: ...
    def __reversed__(self) -> Iterator[_Positions]: ...
    def __copy__(self) -> Capture: ...
    def __deepcopy__(self, memo: Any, /) -> Capture: ...
    def __reduce__(self) -> NoReturn: ...
    def __getitem__(self, frame: SupportsIndex | slice, /) -> _Positions:
        """Positions of frame t, (n, 3), or of a slice of frames, (f, n, 3).

        float32; float64 for a capture so far from the origin that single precision would lose it.
        Raises IndexError for a frame that is not there.
        """
    @overload
    def decode(self, out: None = None) -> _Positions: ...
    @overload
    def decode(self, out: _Out) -> _Out:
        """All frames, (f, n, 3), as ``capture[:]``, or written into ``out``: float32 or float64, of any memory order.

        float32 is refused where it would lose more than 1e-4 of the diagonal, as it does far from the origin.
        """
    def save(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the .cager file; it appears whole or not at all. What has that name is replaced with ``overwrite``."""
    def export(
        self,
        path: str | PathLike[str],
        overwrite: bool = False,
        with_cage: bool = False,
        *,
        up: _Up | None = None,
        unit: _Unit | None = None,
    ) -> list[str]:
        """Write all frames in a format of other programs: .usdc, .usdz, .abc, .glb, .gltf, .npy, .pc2, .mdd, a .vat folder,
        or a folder or pattern of mesh files, as the path says.

        Returns what the file loses, in sentences. ``with_cage`` keeps the cage beside the model, in USD alone.
        Positions are turned to ``up`` and scaled to ``unit``, of a capture that knows its own; glTF is in metres with Y up.
        """
    def pose(self, cage: ArrayLike) -> _Positions:
        """What a cage, (m, 3), alone makes of the model, (n, 3): ``with_cages([cage])[0]`` without a file between.

        float64 far from the origin.
        """
    def with_cages(self, edited: _Frames, *, name: str = "") -> Capture:
        """The same capture with other cages, (f, m, 3): one more layer, of this name, says what is moved, and all else stays.

        What a cage left over is kept: positions are what they were plus what the cage is moved by. As many bytes as
        ``cager edit --with-cages`` writes. Cages of another number of frames take the place of all there are: what they
        left over is dropped, and errors of changed frames are not measured.
        """
    @property
    def layers(self) -> list[_Layer]:
        """The layers of edits, in the order in which they are applied: name, whether it is on, frames and vertices."""
    def remove_layer(self, layer: SupportsIndex = -1) -> Capture:
        """The capture without a layer, counted from 0, or from the end where it is negative. Raises IndexError."""
    def switch_layer(self, layer: SupportsIndex, on: bool) -> Capture:
        """The capture with a layer switched on or off: what is off is kept and not applied. Raises IndexError."""
    def flatten(self) -> Capture:
        """The capture whose cages have the layers in them that are on, and which has no layers."""
    @property
    def cages(self) -> _Positions:
        """The cage of every frame, (f, m, 3); float64 far from the origin."""
    @property
    def cage_faces(self) -> NDArray[np.int64]:
        """Triangles of the cage, (k, 3)."""
    @property
    def rest_cage(self) -> NDArray[np.float64]:
        """Vertices of the cage around the rest pose, (m, 3)."""
    @property
    def rest(self) -> NDArray[np.float64]:
        """Points of the rest pose, (n, 3)."""
    @property
    def faces(self) -> NDArray[np.int64] | list[NDArray[np.int64]]:
        """Faces of the model: (k, 3) or (k, 4) where all have as many vertices, else an array for each."""
    @property
    def parts(self) -> list[dict[str, Any]]:
        """The meshes that the model is made of, with what lies on their faces, these in the order of the source: dictionaries of path, points
        (first and last + 1), face_counts, face_points (of the part's own points), uvs and colors (arrays by corner, by name), materials (of faces;
        -1 for none, None without) and shown (ranges of frames, None for all)."""
    @property
    def materials(self) -> list[dict[str, Any]]:
        """The materials that parts count: name, base_color, opacity, roughness, metalness, and by channel textures and
        texture_sequences, the picture of each frame where not all have the same."""
    @property
    def frame_rate(self) -> float | None:
        """Frames per second, where known."""
    @property
    def unit(self) -> float | None:
        """Metres of 1 in its positions, where known."""
    @property
    def up(self) -> _Up | None:
        """The axis that points up, where known."""
    @property
    def times(self) -> NDArray[np.float64]:
        """The number of each frame where it comes from, (f,): 0, 1, 2, … where nobody says otherwise."""
    @property
    def report(self) -> dict[str, Any]:
        """Sizes, errors and warnings of the encoding: the keys of ``cager inspect --json``."""

def open(path: str | PathLike[str]) -> Capture:
    """Open a .cager file. Frames are decoded when they are asked for."""

def encode(
    rest: ArrayLike,
    faces: _Faces | None,
    frames: _Frames,
    cage: tuple[ArrayLike, _Faces] | None = None,
    max_error: float | None = None,
    mean_error: float | None = None,
    progress: _Progress | None = None,
    *,
    vertices: int | None = None,
    seed: int = 0,
    coordinates: _Kind = "mvc",
    frame_rate: float | None = None,
    unit: _Unit | None = None,
    up: _Up | None = None,
    start: float | None = None,
    times: ArrayLike | None = None,
    force: bool = False,
) -> Capture:
    """Encode a capture: the same bytes as ``cager encode`` writes of the same numbers.

    rest: points of the rest pose, (n, 3).
    faces: (k, 3), (k, 4), or a list of vertices for each face; None for a point cloud.
    frames: (f, n, 3), or an iterable of (n, 3), which is read to its end first.
    cage: its vertices, (m, 3), and faces; without it a cage is designed from the frames, of ``vertices`` vertices
        at the most, drawn with ``seed``.
    max_error: no point of any frame is farther from where it was; without it and ``mean_error`` frames are stored
        as the cage follows them.
    mean_error: the mean L2 error of the file, or of the cage that is designed for it; what no cage meets is coded.
    frame_rate: frames per second, kept with the capture.
    unit: what 1 in the positions is, "cm" say or its metres, and up: the axis that points up. Both are kept with the
        capture, for programs that read what is exported; positions stay as they are.
    start: number of the first frame, 1001 say, or times: the number of each, ascending, (f,), with fractions such as
        1001.5 for what lies between two frames. Without them they are 0, 1, 2, …
    force: go on where rest pose, cage and frames look as if they did not belong together.
    """

def design_cage(
    rest: ArrayLike,
    faces: _Faces | None,
    frames: _Frames,
    vertices: int | None = None,
    *,
    mean_error: float | None = None,
    style: Literal["free", "editable"] = "free",
    seed: int = 0,
    time_limit: float | None = None,
    force: bool = False,
    progress: _Progress | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Design a cage from a capture: its vertices, (m, 3), and triangles, (k, 3).

    vertices: at the most; 350 where neither they nor ``mean_error``, the error that the cage is to meet, are given.
    time_limit: seconds after which the best cage so far is taken; none where it is infinite.
    """

def coordinates(
    rest: ArrayLike, cage_vertices: ArrayLike, cage_faces: _Faces, kind: _Kind = "mvc"
) -> NDArray[np.float64]:
    """Coordinates of points in a cage, (n, m): ``coordinates(...) @ cage_vertices`` gives the points.

    With kind "green" and "green-free" columns for the triangles of the cage follow those of its m vertices. They are
    multiplied with the triangles' unit normals, each times the root of the mean area of all triangles. Of a cage of
    triangles, as ``design_cage`` and ``capture.cage_faces`` give (faces of more corners are cut into triangles from their
    first corner on):

        normals = np.cross(*(cage_vertices[cage_faces[:, 1:]] - cage_vertices[cage_faces[:, :1]]).swapaxes(0, 1))
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        points = phi @ np.vstack([cage_vertices, normals / lengths * np.sqrt(lengths.mean() / 2)])

    To move the points with the cage, "green" takes the unit normals of the moved triangles, each also times its stretch;
    "green-free" takes any. docs/FORMAT.md defines both under "Coordinate systems".
    """

@final
@type_check_only
class _Cages(AsyncIterator[tuple[int, NDArray[np.float32]]]):
    def __aiter__(self) -> _Cages: ...
    def __anext__(self) -> Awaitable[tuple[int, NDArray[np.float32]]]: ...
    async def aclose(self) -> None:
        """End it, as ``contextlib.aclosing`` does: what is connected is closed, and no cage follows."""

@final
class Client:
    """A client of the encoding service, ``cager serve``, for asyncio.

    url: http://host:port, perhaps with a prefix, or https://.
    token: sent with every request, where the service wants one.

    What is safe to repeat is tried again where a connection breaks; errors are those of ``CagerError``. A task that is
    cancelled ends its request, and any number of calls can be awaited at once. The work runs on other threads.
    """

    def __new__(cls, url: str, token: str | None = None) -> Client: ...
    async def encode(
        self,
        rest: ArrayLike,
        faces: _Faces | None,
        frames: _Frames,
        cage: tuple[ArrayLike, _Faces] | None = None,
        max_error: float | None = None,
        mean_error: float | None = None,
        on_progress: _Progress | None = None,
        *,
        vertices: int | None = None,
        seed: int = 0,
        coordinates: _Kind = "mvc",
        frame_rate: float | None = None,
        unit: _Unit | None = None,
        up: _Up | None = None,
        start: float | None = None,
        times: ArrayLike | None = None,
        force: bool = False,
        name: str | None = None,
        keep: bool = False,
    ) -> Capture:
        """Encode a capture on the service: arguments and bytes as of ``cager.encode``, of frames in float32.

        frames: (f, n, 3), or an iterable of (n, 3); float64 is sent in single precision. They are read while they are
            sent: leave them as they are until then.
        cage: without it the service designs one.
        on_progress: called on the event loop, with the newest stage and fraction where the loop is busy.
        name: of the session, for people.
        keep: leave the session on the service, whatever happens; without it, it is deleted in the end, also where the
            task is cancelled.
        """
    async def session(self, id: str) -> dict[str, Any]:
        """A session as it is now: the keys of ``GET /v1/sessions/{id}``."""
    async def sessions(self) -> list[dict[str, Any]]:
        """All sessions, newest first."""
    async def download(self, id: str, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the .cager file of a completed session; it appears whole or not at all."""
    async def delete(self, id: str) -> None:
        """Delete a session with all its results, and stop work for it."""
    def follow(self, id: str, first: int = 0) -> _Cages:
        """Frames from ``first`` on, in order, each with its cage, (m, 3), as they are solved, until the session is complete.

        With coordinates "green-free" normals of the faces follow the vertices. Where a capture lies far from the
        origin, positions are those that were sent: about its own.
        """
