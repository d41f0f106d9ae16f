"""A rod followed live: lines come in at one side, records go out at the other, and what is stale in between is left out.

One `LiveSession` follows one rod. A thread feeds it with `receive`, another one works in `follow`; between them wait at most
one pose (the newest) or, with `keep_all`, at most `MOST_WAITING`. Nothing grows with the number of poses. `follow_stream` is
a session between two files, `LiveServer` one for each client of a websocket.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from batten.errors import BattenError, InvalidInputError
from batten.io.live_records import (
    LONGEST_LINE,
    SHOWN,
    LiveError,
    LivePose,
    RecordStyle,
    Tracker,
    error_record,
    line_of,
    parse_line,
    pose_record,
    unwrapped,
)

MOST_WAITING = 64
"""Records that wait at most: errors, and with `keep_all` poses as well."""

MOST_CLIENTS = 8
"""Clients that are served at a time."""

_LARGEST_MESSAGE = 2**20  # bytes of a websocket message, which may hold many lines; a larger one ends the connection
_LOOPBACK = ("localhost", "127.0.0.1", "::1")
_PATIENCE_S = 1.0  # for the record that is being worked on when everything shall end


@dataclass
class LiveCounts:
    """What happened: poses = followed + dropped + those among the errors that could not be followed."""

    poses: int = 0
    followed: int = 0
    dropped: int = 0
    errors: int = 0
    snaps: int = 0

    def add(self, other: LiveCounts) -> None:
        """Add another's counts to these."""
        for field in fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))

    def __str__(self) -> str:
        return ", ".join(f"{getattr(self, field.name)} {field.name}" for field in fields(self))


class LineCutter:
    """Cuts bytes, as they come, into lines; holds no more than `LONGEST_LINE` of them.

    A longer line is given out once, cut off one byte after that length, and the rest of it is skipped.

    Example:
        >>> cutter = LineCutter()
        >>> cutter.cut(b"one\\ntw"), cutter.cut(b"o\\nthr"), cutter.rest()
        ([b'one'], [b'two'], b'thr')
    """

    def __init__(self) -> None:
        self._part = bytearray()
        self._skipping = False

    def cut(self, data: bytes) -> list[bytes]:
        """The lines that these bytes complete, without their ends."""
        lines = []
        for i, piece in enumerate(data.split(b"\n")):
            if i > 0:
                if not self._skipping:
                    lines.append(bytes(self._part))
                self._part.clear()
                self._skipping = False
            if not self._skipping:
                self._part += piece[: LONGEST_LINE + 1 - len(self._part)]
                if len(self._part) > LONGEST_LINE:
                    lines.append(bytes(self._part))
                    self._part.clear()
                    self._skipping = True
        return lines

    def rest(self) -> bytes:
        """The last line, if nothing ends it."""
        return bytes(self._part)


@dataclass(frozen=True)
class Arrival:
    """A line that waits: its number, when it came (s, monotonic), what it is."""

    n: int
    time_s: float
    content: LivePose | LiveError


class Waiting:
    """The lines between the one who reads and the one who follows; safe to use from two threads.

    Without `keep_all` at most one pose waits: a newer one takes its place. Beyond `MOST_WAITING` errors the oldest goes.
    With `keep_all` nothing is left out: `put` waits until there is room.
    """

    def __init__(self, keep_all: bool) -> None:
        self.keep_all = keep_all
        self.dropped = 0
        self.unreported = 0
        self._items: deque[Arrival] = deque()
        self._pose: Arrival | None = None  # the one that a newer one would replace
        self._ended = False
        self._changed = threading.Condition()

    def put(self, arrival: Arrival) -> bool:
        """Let a line wait; False once nobody takes it any more."""
        with self._changed:
            while self.keep_all and len(self._items) >= MOST_WAITING and not self._ended:
                self._changed.wait()
            if self._ended:
                return False
            if not self.keep_all:
                self._make_room(arrival)
            self._items.append(arrival)
            self._changed.notify_all()
            return True

    def _make_room(self, arrival: Arrival) -> None:
        if isinstance(arrival.content, LivePose):
            if self._pose is not None:
                self._items.remove(self._pose)
                self.dropped += 1
            self._pose = arrival
        elif len(self._items) - (self._pose is not None) >= MOST_WAITING:
            del self._items[1 if self._items[0] is self._pose else 0]
            self.unreported += 1

    def take(self) -> tuple[Arrival, int, int] | None:
        """The next line, as soon as there is one, with `dropped` and `unreported` up to it; None after the end."""
        with self._changed:
            while not self._items and not self._ended:
                self._changed.wait()
            if not self._items:
                return None
            arrival = self._items.popleft()
            if arrival is self._pose:
                self._pose = None
            self._changed.notify_all()
            return arrival, self.dropped, self.unreported

    def end(self) -> None:
        """No more lines come; those that wait are still given out."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def stop(self) -> None:
        """Nothing more is given out; the poses that wait are dropped."""
        with self._changed:
            self._ended = True
            self.dropped += sum(isinstance(item.content, LivePose) for item in self._items)
            self._items.clear()
            self._pose = None
            self._changed.notify_all()


class LiveSession:
    """One rod, followed.

    Parameters:
        tracker: follows the rod; used from the thread of `follow` alone.
        style: what the records show; `style.length` must be the tracker's.
        keep_all: follow every pose instead of the newest one; who feeds has to wait then.

    Example:
        >>> class Straight:
        ...     def move(self, pose):
        ...         raise InvalidInputError("this one never bends")
        >>> session = LiveSession(Straight(), RecordStyle(1.0))
        >>> _ = session.receive(b'{"start": [0, 0, 0], "end": [1, 0, 0], "id": 5}\\n')
        >>> session.end()
        >>> session.follow(print)
        {"id":5,"n":1,"error":"this one never bends","line":"{\\"start\\": [0, 0, 0], \\"end\\": [1, 0, 0], \\"id\\": 5}"}
        >>> print(session.counts())
        1 poses, 0 followed, 0 dropped, 1 errors, 0 snaps
    """

    def __init__(self, tracker: Tracker, style: RecordStyle, *, keep_all: bool = False) -> None:
        self.tracker = tracker
        self.style = style
        self.waiting = Waiting(keep_all)
        self._cutter = LineCutter()
        self._last: LivePose | None = None
        self._poses = self._wrong = self._followed = self._refused = self._snaps = 0

    def receive(self, data: bytes) -> bool:
        """Take bytes as they come, whole lines or not; False once the session has stopped."""
        return self._take(self._cutter.cut(data))

    def _take(self, lines: list[bytes]) -> bool:
        now = time.monotonic()
        for line in lines:
            if not line.strip():
                continue
            content = parse_line(line.rstrip(b"\r"), self.style.length)
            if isinstance(content, LivePose):
                content = self._last = unwrapped(content, self._last)
                self._poses += 1
            else:
                self._wrong += 1
            if not self.waiting.put(Arrival(self._poses + self._wrong, now, content)):
                return False
        return True

    def end(self) -> None:
        """No more bytes come; what waits is still followed."""
        self._take([self._cutter.rest()])
        self.waiting.end()

    def stop(self) -> None:
        """End without following what waits."""
        self.waiting.stop()

    def follow(self, write: Callable[[str], object]) -> None:
        """Work until the end: each record, a line without its end, is given to `write`, which may wait or raise."""
        dropped = unreported = 0  # so many have been told
        while (taken := self.waiting.take()) is not None:
            arrival, dropped_now, unreported_now = taken
            answer = self._answer(arrival, dropped_now - dropped)
            if isinstance(answer, LiveError):
                record = error_record(answer, arrival.n, unreported_now - unreported)
                unreported = unreported_now
            else:
                record, dropped = answer, dropped_now
                record["lag_ms"] = round(1e3 * (time.monotonic() - arrival.time_s), 3)
            write(line_of(record))

    def _answer(self, arrival: Arrival, dropped: int) -> dict[str, Any] | LiveError:
        pose = arrival.content
        if isinstance(pose, LiveError):
            return pose
        try:
            tracked = self.tracker.move(np.array(pose.ends))
            record = pose_record(pose, tracked, self.style, arrival.n, dropped)
        except BattenError as error:
            self._refused += 1
            return LiveError(" ".join(str(error).split()), pose.line, pose.echo)
        self._followed += 1
        self._snaps += tracked.snap is not None
        return record

    def counts(self) -> LiveCounts:
        """What happened so far; exact after the end."""
        return LiveCounts(self._poses, self._followed, self.waiting.dropped, self._wrong + self._refused, self._snaps)


class _Worker(threading.Thread):
    """A thread that does not keep the program from ending, and whose fault is told to the one who waits for it."""

    def __init__(self, work: Callable[[], None]) -> None:
        super().__init__(daemon=True)
        self.fault: BaseException | None = None
        self.finished = threading.Event()
        self._work = work

    def run(self) -> None:
        try:
            self._work()
        except BaseException as fault:  # raised again by follow_stream, in the thread that it runs in
            self.fault = fault
        finally:
            self.finished.set()


def follow_stream(session: LiveSession, read: Callable[[], bytes], write: Callable[[str], object]) -> None:
    """Follow a rod from one file to another, until there is nothing more to read.

    Parameters:
        session: a fresh one.
        read: waits for some bytes, at most some 100 kB, and gives them; b"" at the end.
        write: takes a record, a line without its end, and may wait.

    Raises:
        Whatever `read` or `write` raise, and KeyboardInterrupt or what else a signal's handler raises: the record that is
        being worked on is finished, if that takes no longer than a second, and nothing else is followed.
    """

    def feed() -> None:
        try:
            while (data := read()) and session.receive(data):
                pass
        finally:
            session.end()

    reader, follower = _Worker(feed), _Worker(lambda: session.follow(write))
    try:
        reader.start()
        follower.start()
        while not follower.finished.wait(0.2):  # with a time limit: without, Windows would not let Ctrl-C through
            pass
    finally:
        session.stop()
        follower.finished.wait(_PATIENCE_S)
    for worker in (follower, reader):
        if worker.fault is not None:
            raise worker.fault


class LiveServer:
    """Follows a rod of its own for each client of a websocket, in a thread of its own.

    A message is text or bytes and holds one line or several; each record comes back as one text message.

    Parameters:
        make_session: a fresh session; called for each client.
        any_origin: serve pages of any web site, too; otherwise only programs and pages of this machine.
        most_clients: more are refused, with HTTP status 503 and a reason.
    """

    def __init__(
        self, make_session: Callable[[], LiveSession], *, any_origin: bool = False, most_clients: int = MOST_CLIENTS
    ) -> None:
        self.make_session = make_session
        self.any_origin = any_origin
        self.most_clients = most_clients
        self.counts = LiveCounts()
        self.clients = 0
        self._sessions: set[LiveSession] = set()
        self._pool = ThreadPoolExecutor(2 * most_clients, thread_name_prefix="batten-live")
        self._log = logging.getLogger("batten.live")
        self._log.addFilter(_is_no_handshake)

    async def run(self, host: str, port: int, stop: asyncio.Event, listening: Callable[[str], object]) -> None:
        """Listen until `stop` is set; then all connections are closed.

        Parameters:
            host, port: where; port 0 takes a free one.
            stop: set in the running loop.
            listening: called with the address, such as ws://127.0.0.1:8765, as soon as clients may come.

        Raises:
            InvalidInputError: the address cannot be listened on.
        """
        try:
            server = await serve(
                self._serve, host, port, process_request=self._refusal, compression=None, close_timeout=1.0,
                max_size=_LARGEST_MESSAGE, logger=self._log,
            )  # fmt: skip
        except OSError as error:
            raise InvalidInputError(
                f"{host}:{port} cannot be listened on: {error.strerror or error}; try another port, or port 0 for a free one"
            ) from error
        async with server:
            for socket in server.sockets:
                name, number = socket.getsockname()[:2]
                listening(f"ws://[{name}]:{number}" if ":" in name else f"ws://{name}:{number}")
            await stop.wait()
        # All connections are closed now, so that every follower has ended or ends with its record.
        self._pool.shutdown()

    def _refusal(self, connection: ServerConnection, request: Request) -> Response | None:
        origins = request.headers.get_all("Origin")
        if not self.any_origin and not all(map(_is_of_this_machine, origins)):
            return connection.respond(
                403, f"Pages of {origins[0][:SHOWN]} are not served; open the page from this machine, or batten live "
                "with --allow-remote.\n",
            )  # fmt: skip
        if len(self._sessions) >= self.most_clients:
            return connection.respond(503, self._full() + "\n")
        return None

    def _full(self) -> str:
        return f"{self.most_clients} clients are served already, no more are; close one and try again."

    async def _serve(self, client: ServerConnection) -> None:
        if len(self._sessions) >= self.most_clients:  # several have shaken hands at once
            await client.close(1013, self._full())
            return
        session, loop = self.make_session(), asyncio.get_running_loop()
        self._sessions.add(session)
        self.clients += 1

        def write(line: str) -> None:
            asyncio.run_coroutine_threadsafe(client.send(line), loop).result()

        async def feed() -> None:
            async for message in client:
                data = (message.encode() if isinstance(message, str) else message) + b"\n"
                if session.waiting.keep_all:  # there may be no room: the client has to wait, not the loop
                    await loop.run_in_executor(self._pool, session.receive, data)
                else:
                    session.receive(data)

        feeder = asyncio.ensure_future(feed())
        follower = loop.run_in_executor(self._pool, session.follow, write)
        try:
            await asyncio.wait({feeder, follower}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            session.stop()
            feeder.cancel()
            ends = await asyncio.gather(feeder, follower, return_exceptions=True)
            self._sessions.discard(session)
            self.counts.add(session.counts())
        for end in ends:
            if isinstance(end, BaseException) and not isinstance(end, ConnectionClosed | asyncio.CancelledError):
                raise end  # a fault of batten's: websockets logs it and closes the connection with status 1011


def _is_of_this_machine(origin: str) -> bool:
    """Whether a page of this machine asks: one of a server here, or a file ("null")."""
    try:
        return origin == "null" or urlsplit(origin).hostname in _LOOPBACK
    except ValueError:
        return False


def _is_no_handshake(record: logging.LogRecord) -> bool:
    """Whoever knocks without speaking the protocol, as port scanners do, is not worth a traceback."""
    return record.msg != "opening handshake failed"
