"""Awaits what runs on other threads."""

import asyncio


async def call(start):
    loop = asyncio.get_running_loop()
    ended = loop.create_future()

    def end(finish):
        if ended and not ended.done():
            ended.set_result(finish)

    stop = start(loop.call_soon_threadsafe, end)
    try:
        finish = await asyncio.shield(ended)
    except asyncio.CancelledError:
        stop()
        await cleaned_up(ended, loop.time() + 10)
        # Its result goes now, not with what keeps this exception.
        ended = None
        raise
    return finish()


async def cleaned_up(ended, limit):
    """Waits for the end, also where the task is cancelled again meanwhile: by a callback, a time limit, a shutdown."""
    loop = asyncio.get_running_loop()
    while not ended.done() and loop.time() < limit:
        try:
            await asyncio.wait([ended], timeout=limit - loop.time())
        except asyncio.CancelledError:
            pass
