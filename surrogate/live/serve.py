"""The page on 127.0.0.1: its files, and frames over a websocket to everyone who watches."""

import asyncio
import contextlib
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from surrogate.live import messages
from surrogate.live.controls import MOST_BYTES, Latest, Limits, controls_of
from surrogate.live.guard import App, guarded
from surrogate.live.moments import Moment
from surrogate.live.whole_page import PAGE
from surrogate.model.tracking.tracked import UNREADABLE, Tracked
from touchcal.lazy import needed

HOST = "127.0.0.1"
# Frames that wait for a watcher at most, before the oldest is left out; watchers at most
WAITING, WATCHERS = 25, 8
ENDED, SHOWN = "the input ended", "the recording ended; start the command again to see it again"


@dataclass(frozen=True, eq=False)
class Show:
    """What a page shows."""

    hello: dict[str, Any]  # messages.hello
    moments: Iterator[Moment]
    read: Callable[[Moment], Tracked]
    cautions: list[str]  # what was found of the untouched frame, in words, as it is found
    limits: Limits | None = None  # None where nothing can be pressed
    latest: Latest | None = None


@dataclass(eq=False)
class _Watchers:
    """Who watches, by the frames that wait for each."""

    waiting: list[deque[str]] = field(default_factory=list)
    there: threading.Event = field(default_factory=threading.Event)  # set while somebody is
    new: asyncio.Event = field(default_factory=asyncio.Event)
    hand: deque[str] | None = None  # the frames of who pressed last

    def join(self) -> deque[str]:
        """One more, with the frames to come."""
        queue: deque[str] = deque(maxlen=WAITING)
        self.waiting.append(queue)
        self.there.set()
        return queue

    def leave(self, queue: deque[str]) -> None:
        """One fewer."""
        self.waiting = [other for other in self.waiting if other is not queue]
        if not self.waiting:
            self.there.clear()

    def tell(self, text: str) -> None:
        """One more frame for all."""
        for queue in self.waiting:
            queue.append(text)
        self.new.set()
        self.new = asyncio.Event()


def check_installed() -> None:
    """ValueError with what to install where the page's server is missing."""
    for package in ("starlette", "uvicorn", "websockets"):
        needed(package, "pages")


def app_of(show: Show, hosts: tuple[str, ...], token: str) -> App:
    """The guarded app; a thread of its own reads the frames while it runs."""
    from starlette.applications import Starlette
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles
    from starlette.websockets import WebSocket, WebSocketDisconnect

    watchers = _Watchers()

    @contextlib.asynccontextmanager
    async def running(app: Any) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()
        threading.Thread(target=_reading, args=(show, loop, watchers), daemon=True).start()
        yield

    async def page(request: Any) -> Any:
        from starlette.responses import FileResponse

        return FileResponse(PAGE / "index.html")

    async def frames(socket: WebSocket) -> None:
        if len(watchers.waiting) >= WATCHERS:
            await socket.close(1013)
            return
        await socket.accept()
        queue = watchers.join()
        sending = asyncio.create_task(_send(socket, queue, watchers, show))
        try:
            while True:
                if _heard(await socket.receive_text(), show):
                    watchers.hand = queue
        except (WebSocketDisconnect, KeyError):  # KeyError: a binary message
            pass
        finally:
            watchers.leave(queue)
            sending.cancel()
            if show.latest is not None and watchers.hand is queue:
                show.latest.lift()

    return guarded(Starlette(lifespan=running, routes=[Mount(f"/{token}", routes=[
        Route("/", page), WebSocketRoute("/frames", frames), Mount("/", StaticFiles(directory=PAGE))])]), hosts, token)


async def _send(socket: Any, queue: deque[str], watchers: _Watchers, show: Show) -> None:
    import json

    with contextlib.suppress(Exception):  # a browser that goes away in the middle of a frame
        await socket.send_text(json.dumps(show.hello))
        while True:
            new = watchers.new
            while queue:
                await socket.send_text(queue.popleft())
            await new.wait()


def _heard(text: str, show: Show) -> bool:
    """Whether a browser's message was taken; what is no such message, or may not be pressed, changes nothing."""
    if show.limits is None or show.latest is None:
        return False
    try:
        show.latest.set(controls_of(text, show.limits))
    except ValueError:
        return False
    return True


def _reading(show: Show, loop: asyncio.AbstractEventLoop, watchers: _Watchers) -> None:
    """Read frame after frame, and tell who watches; only those of a device are taken while nobody does."""
    number, at_s = 0, 0.0
    if show.hello["source"] != "streamed":
        watchers.there.wait()
    try:
        for moment in show.moments:
            if show.latest is not None:
                watchers.there.wait()
            number, at_s, begun = number + 1, moment.time_s, time.perf_counter()
            found = show.read(moment)
            text = messages.frame(number, moment, found, show.hello, " ".join(show.cautions),
                                  (time.perf_counter() - begun) * 1e3)
            loop.call_soon_threadsafe(watchers.tell, text)
        problem = SHOWN if show.hello["source"] == "recorded" else ENDED
    except Exception as error:  # whatever the input holds, the page says it; a closed loop has nobody to say it to
        problem = f"stopped: {error}"
    none = np.full(4, np.nan)
    last = Tracked(at_s, UNREADABLE, none, np.zeros((4, 4)), none, none, np.zeros(0), np.nan, 0, "")
    text = messages.frame(number + 1, Moment(at_s, np.zeros(0), note=problem), last, show.hello, "", 0.0)
    with contextlib.suppress(RuntimeError):
        while True:  # for those who open the page later, too
            loop.call_soon_threadsafe(watchers.tell, text)
            time.sleep(1.0)


def serve(show: Show, port: int = 0, say: Callable[[str], object] = print) -> None:
    """Serve a page until Ctrl-C, on a free port where that is 0; `say` takes its address.

    ValueError where the server is not installed or the port is taken.
    """
    check_installed()
    import uvicorn

    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # else a frame that follows another waits until the browser acknowledges that one, which it delays by 40 ms
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            listening.bind((HOST, port))
        except OSError as error:
            raise ValueError(f"port {port} cannot be used ({error.strerror}). Choose another with `port`, or leave it "
                             "out.") from None
        listening.listen()
        port, token = listening.getsockname()[1], secrets.token_urlsafe(24)
        app = app_of(show, (f"{HOST}:{port}", f"localhost:{port}"), token)
        server = uvicorn.Server(uvicorn.Config(
            app, log_level="critical", access_log=False, ws_max_size=4 * MOST_BYTES, limit_concurrency=64,
            timeout_graceful_shutdown=1, server_header=False))
        say(f"http://{HOST}:{port}/{token}/")
        with contextlib.suppress(KeyboardInterrupt):
            server.run(sockets=[listening])
