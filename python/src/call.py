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
        await asyncio.wait([ended], timeout=10)
        # Its result goes now, not with what keeps this exception.
        ended = None
        raise
    return finish()
