"""The client for asyncio, beside a service of the program on a port of its own."""

import asyncio
import hashlib
import re
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_program import PROGRAM, write_obj

import cager

pytestmark = pytest.mark.skipif(not PROGRAM, reason="CAGER_BINARY names no program")

TOKEN = "0123456789abcdef0123456789abcdef"


def start(folder):
    tokens = folder / "tokens.toml"
    digest = hashlib.sha256(TOKEN.encode()).hexdigest()
    tokens.write_text(f'[[token]]\nname = "a"\ntenant = "t"\nsha256 = "{digest}"\n')
    command = [PROGRAM, "serve", "--listen", "127.0.0.1:0", "--data", folder / "data", "--tokens", tokens]
    process = subprocess.Popen([*command, "--log-filter", "warn"], stdout=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    assert line.startswith("listening on "), line
    return SimpleNamespace(process=process, url="http://" + line.split()[-1])


def stop(service):
    service.process.kill()
    service.process.wait()
    service.process.stdout.close()


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    service = start(tmp_path_factory.mktemp("service"))
    yield service
    stop(service)


@pytest.fixture
def client(service):
    return cager.Client(service.url, TOKEN)


@pytest.fixture(scope="module")
def single(small):
    """The capture as it is sent, in single precision."""
    return SimpleNamespace(**{**vars(small), "frames": small.frames.astype(np.float32)})


def encoding(client, capture, **options):
    return client.encode(capture.rest, capture.faces, capture.frames, **{"cage": capture.cage, **options})


def contents(capture, path):
    capture.save(path, overwrite=True)
    return path.read_bytes()


@pytest.mark.parametrize(
    "options, arguments",
    [
        ({}, []),
        ({"max_error": 1e-3}, ["--max-error", "1e-3"]),
        ({"mean_error": 2e-3, "frame_rate": 25}, ["--mean-error", "2e-3", "--fps", "25"]),
        ({"coordinates": "green"}, ["--coordinates", "green"]),
        # The service knows neither, and both are added to what it sends.
        ({"unit": "cm", "start": 1001}, ["--unit", "cm", "--start", "1001"]),
        ({"max_error": 1e-3, "start": -2.5}, ["--max-error", "1e-3", "--start", "-2.5"]),
        ({"cage": None, "max_error": 1e-3, "vertices": 30, "seed": 4}, ["--max-error", "1e-3", "--cage-vertices", "30", "--seed", "4"]),
        ({"cage": None, "max_error": 1e-3}, ["--max-error", "1e-3"]),
    ],
)
def test_the_program_writes_the_same_bytes(client, single, tmp_path, options, arguments):
    write_obj(tmp_path / "rest.obj", single.rest, single.faces)
    write_obj(tmp_path / "cage.obj", *single.cage)
    np.save(tmp_path / "frames.npy", single.frames)
    cage = ["--cage", "cage.obj"] if options.get("cage", True) else []
    command = [PROGRAM, "encode", "--rest", "rest.obj", "--frames", "frames.npy", "-o", "program.cager"]
    subprocess.run([*command, *cage, *arguments], cwd=tmp_path, check=True, capture_output=True)
    capture = asyncio.run(encoding(client, single, **options))
    assert contents(capture, tmp_path / "service.cager") == (tmp_path / "program.cager").read_bytes()
    assert asyncio.run(client.sessions()) == []


def test_a_capture_far_from_the_origin_keeps_its_place(client, small, tmp_path):
    away = np.array([4e6, -3e6, 5e5])
    vertices, faces = small.cage
    moved = SimpleNamespace(rest=small.rest + away, faces=small.faces, frames=small.frames + away, cage=(vertices + away, faces))
    capture = asyncio.run(encoding(client, moved, max_error=1e-3))
    assert np.linalg.norm(capture.decode() - moved.frames, axis=2).max() < 1.01e-3 * small.diagonal


def test_captures_are_encoded_at_once_while_the_loop_goes_on(client, single, tmp_path):
    async def both():
        told, ticks = [], 0

        async def tick():
            nonlocal ticks
            while True:
                await asyncio.sleep(0.001)
                ticks += 1

        ticking = asyncio.create_task(tick())
        progress = lambda stage, fraction: told.append((stage, fraction))
        reversed_ = SimpleNamespace(**{**vars(single), "frames": list(single.frames[::-1])})
        captures = await asyncio.gather(
            encoding(client, single, max_error=1e-3, on_progress=progress), encoding(client, reversed_, max_error=1e-3)
        )
        ticking.cancel()
        return captures, told, ticks

    (forward, backward), told, ticks = asyncio.run(both())
    assert ticks > 10
    assert told[-1] == ("encoding", 1.0) and all(0 <= fraction <= 1 for _, fraction in told)
    for capture, frames in ((forward, single.frames), (backward, single.frames[::-1])):
        assert np.linalg.norm(capture.decode() - frames, axis=2).max() < 1.01e-3 * single.diagonal


def test_a_task_that_is_cancelled_ends_its_request_and_leaves_nothing(client, single):
    async def cancelled():
        long = SimpleNamespace(**{**vars(single), "frames": np.tile(single.frames, (200, 1, 1))})
        told = []

        def progress(stage, fraction):
            told.append((stage, fraction))
            if stage == "encoding":
                # Again and again, as a shutdown and a time limit do: what is created is deleted all the same.
                for milliseconds in range(20):
                    loop.call_later(milliseconds / 1000, task.cancel)

        loop = asyncio.get_running_loop()
        task = asyncio.create_task(encoding(client, long, on_progress=progress))
        with pytest.raises(asyncio.CancelledError):
            await task
        assert told[-1][0] == "encoding"
        return await client.sessions()

    assert asyncio.run(cancelled()) == []


def test_what_the_callback_raises_is_passed_on_and_leaves_nothing(client, single):
    def progress(stage, fraction):
        raise LookupError(stage)

    for options in ({}, {"cage": None, "max_error": 1e-3}):
        with pytest.raises(LookupError):
            asyncio.run(encoding(client, single, on_progress=progress, **options))
    assert asyncio.run(client.sessions()) == []


async def interrupted(cages):
    """The frames of cages, where two of three calls are cancelled at one moment or another."""
    frames, calls = [], 0
    while True:
        call = asyncio.ensure_future(cages.__anext__())
        await asyncio.sleep(0.0002 * (calls % 7))
        calls += 1
        if calls % 3:
            call.cancel()
        try:
            frames.append((await call)[0])
        except asyncio.CancelledError:
            continue
        except StopAsyncIteration:
            return frames


def test_a_kept_session_is_listed_followed_downloaded_and_deleted(client, single, tmp_path):
    async def kept():
        capture = await encoding(client, single, name="walk", keep=True)
        (listed,) = await client.sessions()
        session = await client.session(listed["id"])
        assert (session["name"], session["state"], session["points"]) == ("walk", "completed", 386)
        cages = [(frame, cage) async for frame, cage in client.follow(session["id"], first=4)]
        assert [frame for frame, _ in cages] == [4, 5, 6, 7, 8, 9]
        assert np.array_equal(np.stack([cage for _, cage in cages]), capture.cages[4:])
        # A cancelled call keeps its turn from nobody.
        for _ in range(30):
            frames = asyncio.wait_for(interrupted(client.follow(session["id"], first=4)), 30)
            assert await frames == [4, 5, 6, 7, 8, 9]
        path = tmp_path / "walk.cager"
        await client.download(session["id"], path)
        assert path.read_bytes() == contents(capture, tmp_path / "other.cager")
        with pytest.raises(cager.CagerError, match="walk.cager: is there already.*or pass overwrite=True"):
            await client.download(session["id"], path)
        await client.download(session["id"], path, overwrite=True)
        await client.delete(session["id"])
        with pytest.raises(cager.CagerError, match="there is no session with this id"):
            await client.session(session["id"])
        with pytest.raises(cager.CagerError, match="there is no session with this id"):
            await anext(client.follow(session["id"]))
        return await client.sessions()

    assert asyncio.run(kept()) == []


def test_an_address_that_leads_nowhere_is_named(service, single, tmp_path):
    client = cager.Client(service.url + "/nowhere", TOKEN)

    async def first():
        return await anext(client.follow("x"))

    for call in (client.sessions, lambda: client.download("x", tmp_path / "x.cager"), lambda: encoding(client, single), first):
        with pytest.raises(cager.CagerError, match="^" + service.url + "/nowhere: a service answers there, but has no such route"):
            asyncio.run(call())


def test_what_cannot_be_used_is_named_before_anything_is_sent(client, single):
    bad = np.array(single.frames)
    bad[4, 5, 0] = np.nan
    for frames, words in ((bad, "frames: frame 4: point 5 has"), (single.frames[:, 1:], "frames: frame 0 has 385")):
        with pytest.raises(cager.CagerError, match=words):
            asyncio.run(encoding(client, SimpleNamespace(**{**vars(single), "frames": frames})))
    with pytest.raises(cager.CagerError, match="max_error: is 2"):
        encoding(client, single, max_error=2)
    with pytest.raises(cager.CagerError, match="is not the address of a service"):
        cager.Client("ftp://here")


def test_a_wrong_token_is_told_and_never_shown(service):
    for token in ("f" * 32, None):
        client = cager.Client(service.url, token)
        with pytest.raises(cager.CagerError, match="token"):
            asyncio.run(client.sessions())
        assert token is None or token not in repr(client)


def test_a_service_that_is_gone_is_told(single, tmp_path):
    service = start(tmp_path)
    client = cager.Client(service.url, TOKEN)
    assert asyncio.run(client.sessions()) == []
    long = SimpleNamespace(**{**vars(single), "frames": np.tile(single.frames, (200, 1, 1))})

    async def interrupted():
        # It may come back: whoever does not want to wait for that says for how long.
        gone = asyncio.Event()

        def progress(stage, fraction):
            if stage == "encoding" and not gone.is_set():
                stop(service)
                gone.set()

        task = asyncio.create_task(encoding(client, long, on_progress=progress))
        await asyncio.wait_for(gone.wait(), 60)
        await asyncio.wait_for(task, 1)

    began = time.monotonic()
    with pytest.raises(asyncio.TimeoutError):
        asyncio.run(interrupted())
    assert time.monotonic() - began < 20
    with pytest.raises(cager.CagerError, match="cannot be reached .*check the address and whether the service is running"):
        asyncio.run(cager.Client(service.url, TOKEN).sessions())


def test_the_example_of_the_readme_runs(service, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CAGER_SERVER", service.url)
    monkeypatch.setenv("CAGER_TOKEN", TOKEN)
    readme = Path(__file__).parents[1] / "README.md"
    example = re.findall(r"```python\n(.*?)```", readme.read_text(), re.S)[1]
    exec(compile(example, str(readme), "exec"), {})
    assert "encoding: 100%" in capsys.readouterr().out
    assert len(cager.open("take-0.cager")) == len(cager.open("take-1.cager")) == 12
