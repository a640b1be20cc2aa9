"""The cages of a session, followed while it is sent, and followers that are closed."""

import asyncio
import contextlib
from types import SimpleNamespace

import numpy as np
import pytest
from test_client import client, encoding, pytestmark, service, single  # noqa: F401 (what the tests are given)

import cager


def test_a_session_is_followed_while_it_is_sent(client, single):
    async def followed():
        sent = asyncio.create_task(encoding(client, single, name="live", keep=True))
        while not (found := [session for session in await client.sessions() if session["unknowns"]]):
            await asyncio.sleep(0.01)
        frames = [frame async for frame, _ in client.follow(found[0]["id"])]
        await sent
        await client.delete(found[0]["id"])
        return frames

    assert asyncio.run(followed()) == list(range(10))


def test_followers_are_closed(client, single):
    async def closed():
        await encoding(client, single, keep=True)
        (session,) = await client.sessions()
        async with contextlib.aclosing(client.follow(session["id"])) as cages:
            assert (await anext(cages))[0] == 0
        with pytest.raises(StopAsyncIteration):
            await anext(cages)
        await cages.aclose()
        await client.delete(session["id"])

    asyncio.run(closed())


def test_a_follower_that_is_awaited_is_not_closed(client, single):
    async def refused():
        waiting = SimpleNamespace(**{**vars(single), "frames": np.tile(single.frames, (1000, 1, 1))})
        sent = asyncio.create_task(encoding(client, waiting))
        while not (found := [session for session in await client.sessions() if session["unknowns"]]):
            await asyncio.sleep(0.01)
        cages = client.follow(found[0]["id"], first=9999)
        call = asyncio.create_task(anext(cages))
        # Where it has not its turn yet, it is closed, and the call begins anew with the next.
        for _ in range(100):
            await asyncio.sleep(0.02)
            try:
                await cages.aclose()
            except cager.CagerError as error:
                assert "the next cage is being awaited; cancel that" in str(error)
                break
            cages = client.follow(found[0]["id"], first=9999)
            call = asyncio.create_task(anext(cages))
        else:
            pytest.fail("it was never refused")
        for task in (call, sent):
            task.cancel()
        await asyncio.gather(call, sent, return_exceptions=True)
        await cages.aclose()

    asyncio.run(refused())
