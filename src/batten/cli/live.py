"""The command `batten live`: a rod followed while sensors tell where its ends are."""

from __future__ import annotations

import ipaddress
import re
from typing import TYPE_CHECKING, Annotated

import typer

from batten.cli.bend import LengthOption, RodOption, length_of
from batten.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from batten.io.live_stream import LiveSession

# Whatever is needed for the work itself is imported in the functions: `batten --help` answers at once.


def live(
    length: LengthOption = None,
    rod: RodOption = None,
    listen: Annotated[
        str | None,
        typer.Option(metavar="127.0.0.1:PORT", help="Serve websocket clients instead of stdin; port 0: a free one."),
    ] = None,
    points: Annotated[
        int, typer.Option(metavar="N", help="Points of the shape in each record.", show_default=True)
    ] = 33,
    keep_all: Annotated[
        bool, typer.Option("--keep-all", help="Follow every pose, as of a recorded file; the sender waits.")
    ] = False,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Let other machines and web pages connect, unencrypted.")
    ] = False,
) -> None:
    """Follow a rod live: a line comes in with the pose of both ends, a line goes out with shape, forces and margin.

    Lines are JSON: {"start": [x, y, angle], "end": [x, y, angle]}, angles in radians; "id" and "t" come back. Poses that a
    newer one has overtaken are left out, and counted. A wrong line is answered by a record with "error".

    Exit status: 0 at the end of stdin, or when interrupted; 2 bad input.
    """
    import sys

    from batten.io.live_records import RecordStyle
    from batten.io.live_stream import LiveSession
    from batten.io.rod_file import load_rod
    from batten.solvers.track import RodTracker

    address = None if listen is None else address_of(listen, allow_remote)
    if allow_remote and address is None:
        raise InvalidInputError("--allow-remote is for --listen alone; add --listen 0.0.0.0:8765, or leave it out")
    given = None if length is None else length_of(length)
    bent = None if rod is None else load_rod(rod, given)
    long = given if bent is None else bent.length_mm
    if long is None:
        raise InvalidInputError("--length is missing; give the rod's length, or a --rod whose file has length_mm")
    style = RecordStyle(long, points, bent)

    def make_session() -> LiveSession:
        return LiveSession(RodTracker(long), style, keep_all=keep_all)

    sys.setswitchinterval(0.0005)  # under a flood of poses, who follows them gets three times as much done
    if address is None:
        _follow_stdin(make_session())
    else:
        _warm_up(make_session(), long)
        _serve(make_session, *address, allow_remote)


def address_of(text: str, allow_remote: bool) -> tuple[str, int]:
    """Host and port of "HOST:PORT"; one of this machine alone, unless others are allowed.

    Raises:
        InvalidInputError: another form, a port outside 0 to 65535, a host that others can reach.

    Example:
        >>> address_of("[::1]:8765", allow_remote=False)
        ('::1', 8765)
    """
    found = re.fullmatch(r"(?:\[([0-9a-fA-F:.]+)\]|([^\s:\[\]]+)):(\d{1,5})", text, re.ASCII)
    if found is None or int(found[3]) > 65535:
        raise InvalidInputError(
            f"--listen {text!r}: allowed is HOST:PORT with a port from 0 (a free one) to 65535; try 127.0.0.1:8765"
        )
    host, port = found[1] or found[2], int(found[3])
    if not allow_remote and not _is_loopback(host):
        raise InvalidInputError(
            f"--listen {text}: allowed are addresses of this machine alone, such as 127.0.0.1; there is no password and no "
            f"encryption, so whoever reaches {host} may use it: try 127.0.0.1, or add --allow-remote if all of them may"
        )
    return host, port


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:  # another name: where it leads is not known
        return False


def _follow_stdin(session: LiveSession) -> None:
    """From stdin to stdout; the system's own calls, so that nothing is held back and no lock outlives the program."""
    import os
    import sys

    from batten.io.live_stream import follow_stream

    source, target = sys.stdin.fileno(), sys.stdout.fileno()

    def write(line: str) -> None:
        data = memoryview(line.encode("ascii") + b"\n")
        while data:
            data = data[os.write(target, data) :]

    gone = False
    try:
        follow_stream(session, lambda: os.read(source, 65536), write)
    except (KeyboardInterrupt, SystemExit):
        gone = True  # Ctrl-C, or SIGTERM: the usual end of a rig
    except BrokenPipeError:
        gone = True  # whoever read the records went away, as `head` does
    typer.echo(f"batten live: {session.counts()}{' (ended early)' if gone else ''}", err=True)


def _warm_up(session: LiveSession, length: float) -> None:
    """Load and compile what the first client would wait for."""
    session.receive(f'{{"start": [0, 0, 0.4], "end": [{0.8 * length!r}, 0, -0.4]}}\n'.encode())
    session.end()
    session.follow(str)


def _serve(make_session: Callable[[], LiveSession], host: str, port: int, allow_remote: bool) -> None:
    """Serve websocket clients until SIGINT or SIGTERM; the second one ends the program the hard way."""
    import asyncio
    import signal

    from batten.io.live_stream import LiveServer

    async def run() -> None:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

        def ended(number: int, frame: object) -> None:
            signal.signal(number, before[signal.Signals(number)])
            loop.call_soon_threadsafe(stop.set)

        try:
            for number in before:
                signal.signal(number, ended)
            await server.run(host, port, stop, lambda url: typer.echo(f"batten live: listening on {url}", err=True))
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    server = LiveServer(make_session, any_origin=allow_remote)
    asyncio.run(run())
    typer.echo(f"batten live: {server.counts}, {server.clients} clients", err=True)
