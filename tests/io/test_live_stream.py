"""A rod followed live, with a stand-in that follows it: what waits, what is dropped, who is served, what stays small."""

import asyncio
import contextlib
import itertools
import json
import math
import os
import sys
import threading
import time
from collections import deque
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError, NoSolutionError
from batten.io.live_records import LONGEST_LINE, RecordStyle
from batten.io.live_stream import MOST_WAITING, LineCutter, LiveServer, LiveSession, follow_stream

STYLE = RecordStyle(1.0, 2)
WAIT_S = 10.0  # at most, for what comes at once


class Bender:
    """Stands in for RodTracker: an arc whose end angle tells which pose it was given; refuses negative heights."""

    def __init__(self, pause_s=0.0, gate=None):
        self.pause_s, self.gate = pause_s, gate
        self.poses = deque(maxlen=10)
        self.begun = threading.Event()

    def move(self, pose):
        self.poses.append(tuple(float(v) for v in pose))
        self.begun.set()
        if self.gate is not None:
            assert self.gate.wait(WAIT_S)
        time.sleep(self.pause_s)
        if pose[4] < 0.0:
            raise NoSolutionError("no shape\nbelow the table; try above")
        if pose[4] > 0.8:
            raise ZeroDivisionError("a fault of the stand-in")
        curve = Elastica(pose[:2], pose[2], pose[5] - pose[2], (0.0, 0.0), 1.0)
        snap = None
        if pose[4] == 0.5:
            snap = SimpleNamespace(fraction=0.5, pose=pose, before=curve, after=curve, energy_released=1.0)
        return SimpleNamespace(elastica=curve, energy=0.0, margin=math.inf, stable=True, snap=snap)


def line(k, y=0.0, angle=0.0):
    return b'{"start": [0, 0, 0], "end": [0.5, %a, %a], "id": %d}\n' % (y, angle, k)


def followed(session, *chunks):
    """All records of a session that is fed first and followed then."""
    for chunk in chunks:
        session.receive(chunk)
    session.end()
    records = []
    session.follow(lambda text: records.append(json.loads(text)))
    return records


# --- lines ---


@given(st.binary(max_size=60).map(lambda b: b.replace(b"a", b"\n")), st.lists(st.integers(0, 60), max_size=6))
def test_lines_do_not_depend_on_how_they_come(data, cuts):
    cutter, found, places = LineCutter(), [], [0, *sorted(cuts), len(data)]
    for first, last in itertools.pairwise(places):
        found += cutter.cut(data[first:last])
    assert [*found, cutter.rest()] == data.split(b"\n")


@pytest.mark.parametrize("size", [1, 1000, 65536, 10**6])
def test_a_long_line_is_given_out_once_and_not_kept(size):
    cutter, found = LineCutter(), []
    data = b"a" * LONGEST_LINE + b"\n" + b"b" * 1_000_000 + b"\nc\n" if size > 1 else b"a" * 70_000 + b"\nc\n"
    for i in range(0, len(data), size):
        found += cutter.cut(data[i : i + size])
        assert len(cutter.rest()) <= LONGEST_LINE
    whole = [b"a" * LONGEST_LINE, b"b" * (LONGEST_LINE + 1)] if size > 1 else [b"a" * (LONGEST_LINE + 1)]
    assert found == [*whole, b"c"]


# --- one session ---


def test_only_the_newest_pose_is_followed():
    tracker = Bender()
    session = LiveSession(tracker, STYLE)
    (record,) = followed(session, *(line(k, y=0.01 * k) for k in range(10)))
    assert (record["id"], record["n"], record["dropped"]) == (9, 10, 9)
    assert len(tracker.poses) == 1
    assert record["lag_ms"] >= 0.0
    assert str(session.counts()) == "10 poses, 1 followed, 9 dropped, 0 errors, 0 snaps"


def test_all_are_followed_in_order_if_wanted():
    session = LiveSession(Bender(), STYLE, keep_all=True)
    records = followed(session, b"".join(line(k, y=0.5 if k == 3 else 0.0) for k in range(10)))
    assert [(r["id"], r["n"], r["dropped"]) for r in records] == [(k, k + 1, 0) for k in range(10)]
    assert [r["snap"] is not None for r in records] == [k == 3 for k in range(10)]
    assert str(session.counts()) == "10 poses, 10 followed, 0 dropped, 0 errors, 1 snaps"


def test_a_wrong_line_is_answered_and_the_stream_goes_on():
    session = LiveSession(Bender(), STYLE, keep_all=True)
    chunk = line(1) + b"\n  \r\nnonsense\n" + line(2, y=-0.1) + b"x" * 100_000 + b"\n" + line(3)[:-1]
    records = followed(session, chunk[:50], chunk[50:])
    assert [(r["n"], r.get("id"), "error" in r) for r in records] == [
        (1, 1, False), (2, None, True), (3, 2, True), (4, None, True), (5, 3, False),
    ]  # fmt: skip
    assert records[1]["line"] == "nonsense"
    assert records[2]["error"] == "no shape below the table; try above"
    assert records[2]["line"] == line(2, y=-0.1).decode().rstrip()
    assert records[3]["line"] == "x" * 200
    assert str(session.counts()) == "3 poses, 2 followed, 0 dropped, 3 errors, 0 snaps"


def test_errors_keep_their_place_and_beyond_the_most_the_oldest_go():
    session = LiveSession(Bender(), STYLE)
    records = followed(session, line(1), b"bad\n" * 5, line(2), b"bad\n" * (MOST_WAITING + 2), line(3))
    assert [r["n"] for r in records] == [*range(10, 10 + MOST_WAITING), MOST_WAITING + 10]
    assert records[0]["unreported"] == 7
    assert not any("unreported" in r for r in records[1:])
    assert (records[-1]["id"], records[-1]["dropped"]) == (3, 2)
    counts = session.counts()
    assert (counts.poses, counts.followed, counts.dropped, counts.errors) == (3, 1, 2, MOST_WAITING + 7)


def test_a_waiting_pose_is_not_pushed_out_by_errors():
    session = LiveSession(Bender(), STYLE)
    records = followed(session, line(1), b"bad\n" * 1000)
    assert records[0]["id"] == 1
    assert len(records) == 1 + MOST_WAITING
    assert records[1]["unreported"] == 1000 - MOST_WAITING


def test_angles_are_kept_continuous_over_poses_that_are_dropped():
    tracker = Bender()
    session = LiveSession(tracker, STYLE)
    turned = [math.remainder(0.5 * k, math.tau) for k in range(40)]
    followed(session, *(line(k, angle=a) for k, a in enumerate(turned)))
    assert tracker.poses[0][5] == pytest.approx(19.5, abs=1e-12)


def test_what_came_while_one_was_worked_on():
    gate = threading.Event()
    tracker, records = Bender(gate=gate), []
    session = LiveSession(tracker, STYLE)
    worker = threading.Thread(target=session.follow, args=(lambda text: records.append(json.loads(text)),), daemon=True)
    worker.start()
    session.receive(line(0))
    assert tracker.begun.wait(WAIT_S)
    for k in range(1, 6):
        session.receive(line(k))
    gate.set()
    session.end()
    worker.join(WAIT_S)
    assert [(r["id"], r["dropped"]) for r in records] == [(0, 0), (5, 4)]


def test_a_slow_tracker_answers_the_newest_and_counts_the_rest():
    session, records = LiveSession(Bender(pause_s=0.02), STYLE), []
    worker = threading.Thread(target=session.follow, args=(lambda text: records.append(json.loads(text)),), daemon=True)
    worker.start()
    for k in range(100):
        session.receive(line(k))
        time.sleep(0.002)
    session.end()
    worker.join(WAIT_S)
    numbers = [r["n"] for r in records]
    assert numbers[-1] == 100
    assert 3 < len(numbers) < 60
    assert [r["dropped"] for r in records] == [b - a - 1 for a, b in zip([0, *numbers], numbers)]
    assert all(r["lag_ms"] >= 20.0 for r in records)
    counts = session.counts()
    assert (counts.poses, counts.followed, counts.dropped) == (100, len(numbers), 100 - len(numbers))


def test_who_sends_waits_if_all_are_followed():
    gate = threading.Event()
    session, records, sent = LiveSession(Bender(gate=gate), STYLE, keep_all=True), [], []

    def feed():
        for k in range(200):
            session.receive(line(k))
            sent.append(k)
        session.end()

    workers = [threading.Thread(target=session.follow, args=(records.append,), daemon=True)]
    workers.append(threading.Thread(target=feed, daemon=True))
    for worker in workers:
        worker.start()
    time.sleep(0.1)
    assert len(sent) == MOST_WAITING + 1
    gate.set()
    for worker in workers:
        worker.join(WAIT_S)
    assert [json.loads(r)["id"] for r in records] == list(range(200))


def test_stopping_drops_what_waits():
    session = LiveSession(Bender(), STYLE, keep_all=True)
    session.receive(line(1) + line(2) + b"bad\n")
    session.stop()
    assert followed(session, line(3)) == []
    assert session.receive(line(4)) is False
    counts = session.counts()
    assert (counts.followed, counts.errors) == (0, 1)


def resident_bytes():
    """What the process holds in memory; 0 where the system does not tell in this way."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


@pytest.mark.parametrize(("keep_all", "rounds"), [(False, 1000), (True, 100)])
def test_memory_does_not_grow_with_the_poses(keep_all, rounds):
    """100 000 poses pass by a follower that gets what it can, and a tenth of them by one that is given each."""
    session, told = LiveSession(Bender(), STYLE, keep_all=keep_all), [0]

    def write(text):
        told[0] += 1

    worker = threading.Thread(target=session.follow, args=(write,), daemon=True)
    worker.start()
    chunk, blocks, resident = b"".join(line(k, y=0.001 * (k % 7)) for k in range(100)), [], []
    for i in range(rounds):
        session.receive(chunk)
        if i % (rounds // 10) == rounds // 20:
            blocks.append(sys.getallocatedblocks())
            resident.append(resident_bytes())
    session.end()
    worker.join(WAIT_S)
    assert not worker.is_alive()
    counts = session.counts()
    assert counts.poses == 100 * rounds == counts.followed + counts.dropped
    assert told[0] == counts.followed
    assert (counts.dropped == 0) == keep_all
    assert max(blocks) - blocks[0] < 5000, "less than one block for 20 poses"
    assert max(resident) - resident[0] < 4_000_000


# --- from file to file ---


def test_from_file_to_file():
    read_end, write_end = os.pipe()
    os.write(write_end, line(1) + line(2)[:20])
    threading.Timer(0.1, lambda: (os.write(write_end, line(2)[20:-1]), os.close(write_end))).start()
    records = []
    session = LiveSession(Bender(), STYLE, keep_all=True)
    follow_stream(session, lambda: os.read(read_end, 100), records.append)
    os.close(read_end)
    assert [json.loads(r)["id"] for r in records] == [1, 2]


def silent():
    """A source in which nothing comes."""
    time.sleep(WAIT_S)
    return b""


def test_a_fault_ends_the_stream_and_is_told():
    chunks = iter([line(1), line(2, y=0.85)])
    session = LiveSession(Bender(), STYLE, keep_all=True)
    with pytest.raises(ZeroDivisionError, match="of the stand-in"):
        follow_stream(session, lambda: next(chunks, None) or silent(), str)
    with pytest.raises(BrokenPipeError):
        follow_stream(LiveSession(Bender(), STYLE), iter([line(1), b""]).__next__, raise_broken_pipe)
    records = []
    with pytest.raises(OSError, match="torn"):
        follow_stream(LiveSession(Bender(), STYLE), raise_torn_after(line(1)), records.append)
    assert len(records) == 1, "what came before is followed all the same"


def raise_broken_pipe(text):
    raise BrokenPipeError


def raise_torn_after(first):
    chunks = [first]

    def read():
        if not chunks:
            raise OSError("the cable is torn")
        return chunks.pop()

    return read


# --- websocket clients ---


@contextlib.contextmanager
def served(make_tracker=Bender, keep_all=False, **options):
    """A server in a thread: its url, the server itself; ended at the end."""
    server = LiveServer(lambda: LiveSession(make_tracker(), STYLE, keep_all=keep_all), **options)
    state, ready = SimpleNamespace(server=server, fault=None), threading.Event()

    def listening(url):
        state.url = url
        ready.set()

    async def run():
        state.loop, state.stop = asyncio.get_running_loop(), asyncio.Event()
        await server.run("127.0.0.1", 0, state.stop, listening)

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()

    def end():
        if thread.is_alive():
            state.loop.call_soon_threadsafe(state.stop.set)
            thread.join(WAIT_S)
        assert not thread.is_alive()

    state.end = end
    try:
        assert ready.wait(WAIT_S)
        yield state
    finally:
        end()


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch):
    monkeypatch.setenv("no_proxy", "*")


def ask(client, text):
    client.send(text)
    return json.loads(client.recv(timeout=WAIT_S))


def test_a_client_is_answered():
    with served() as here, connect(here.url) as client:
        record = ask(client, line(1).decode())
        assert (record["id"], record["n"], record["dropped"]) == (1, 1, 0)
        assert ask(client, line(2))["id"] == 2, "bytes will do"
        assert ask(client, line(3, y=-1.5).decode())["error"].startswith("the ends are")
        assert ask(client, "?")["n"] == 4
        assert ask(client, "x" * 100_000)["error"].startswith("the line has more than 65536 bytes")
        assert ask(client, "[\n" + line(5).decode())["line"] == "["
        assert json.loads(client.recv(timeout=WAIT_S))["id"] == 5, "two lines in one message"
    assert str(here.server.counts) == "3 poses, 3 followed, 0 dropped, 4 errors, 0 snaps"
    assert here.server.clients == 1


def test_two_clients_have_a_rod_each_and_one_may_leave():
    trackers = []

    def make_tracker():
        trackers.append(Bender())
        return trackers[-1]

    with served(make_tracker) as here:
        with connect(here.url) as first:
            with connect(here.url) as second:
                assert ask(first, line(1, angle=3.0))["id"] == 1
                assert ask(second, line(2, angle=-3.0))["id"] == 2
                assert ask(first, line(3, angle=-3.0))["n"] == 2
                assert ask(second, line(4, angle=-3.0))["n"] == 2
                second.send(line(5))
                second.socket.close()  # without a word
            assert ask(first, line(6, angle=3.0))["n"] == 3
        with connect(here.url) as third:
            assert ask(third, line(7))["n"] == 1
    assert [pose[5] for pose in trackers[0].poses] == pytest.approx([3.0, math.tau - 3.0, 3.0])
    assert [pose[5] for pose in trackers[1].poses][:2] == [-3.0, -3.0]
    assert here.server.clients == 3


def test_a_client_that_sends_too_fast_gets_the_newest():
    with served(lambda: Bender(pause_s=0.05)) as here, connect(here.url) as client:
        for k in range(50):
            client.send(line(k).decode())
            time.sleep(0.005)
        records = []
        while not records or records[-1]["n"] < 50:
            records.append(json.loads(client.recv(timeout=WAIT_S)))
        assert 2 <= len(records) < 25
        assert sum(r["dropped"] for r in records) == 50 - len(records)


def test_a_client_that_wants_all_gets_all():
    with served(keep_all=True) as here, connect(here.url) as client:
        sender = threading.Thread(target=lambda: [client.send(line(k).decode()) for k in range(300)], daemon=True)
        sender.start()
        records = [json.loads(client.recv(timeout=WAIT_S)) for _ in range(300)]
        sender.join(WAIT_S)
    assert [r["id"] for r in records] == list(range(300))


def test_too_many_clients_are_refused_with_a_reason():
    with served(most_clients=2) as here:
        with connect(here.url) as first, connect(here.url) as second:
            assert ask(first, line(1))["id"] == ask(second, line(1))["id"]
            with pytest.raises(InvalidStatus) as refused:
                connect(here.url)
            assert refused.value.response.status_code == 503
            assert b"2 clients are served already" in refused.value.response.body
        deadline = time.monotonic() + WAIT_S
        while True:  # the server may need a moment to see that they left
            try:
                with connect(here.url) as third:
                    assert ask(third, line(1))["id"] == 1
                break
            except InvalidStatus:
                assert time.monotonic() < deadline
                time.sleep(0.02)


@pytest.mark.parametrize(
    ("origin", "served_here"),
    [
        ("http://localhost:5173", True),
        ("http://127.0.0.1", True),
        ("http://[::1]:80", True),
        ("null", True),
        ("https://example.com", False),
        ("http://localhost.example.com", False),
        ("http://[", False),
    ],
)
def test_pages_of_other_sites_are_refused(origin, served_here):
    with served() as here:
        if served_here:
            with connect(here.url, origin=origin) as client:
                assert ask(client, line(1))["id"] == 1
        else:
            with pytest.raises(InvalidStatus) as refused:
                connect(here.url, origin=origin)
            assert refused.value.response.status_code == 403
            assert b"--allow-remote" in refused.value.response.body
    if not served_here:
        with served(any_origin=True) as here, connect(here.url, origin=origin) as client:
            assert ask(client, line(1))["id"] == 1


def test_a_fault_ends_its_client_alone(caplog):
    with served() as here, connect(here.url) as other:
        with connect(here.url) as client:
            client.send(line(1, y=0.85))
            with pytest.raises(ConnectionClosed) as closed:
                client.recv(timeout=WAIT_S)
            assert closed.value.rcvd.code == 1011
        assert ask(other, line(2))["id"] == 2
    assert "a fault of the stand-in" in caplog.text


def test_a_message_beyond_all_bounds_ends_its_client_alone():
    with served() as here, connect(here.url) as other:
        with connect(here.url) as client:
            with contextlib.suppress(ConnectionClosed):
                client.send("x" * 3_000_000)
            with pytest.raises(ConnectionClosed):
                client.recv(timeout=WAIT_S)
        assert ask(other, line(2))["id"] == 2


def test_the_server_ends_while_clients_are_there():
    with served(lambda: Bender(pause_s=0.05), keep_all=True) as here, connect(here.url) as client:
        for k in range(50):
            client.send(line(k))
        client.recv(timeout=WAIT_S)
        begun = time.monotonic()
        here.end()
        assert time.monotonic() - begun < 4.0
        with pytest.raises(ConnectionClosed):
            all(client.recv(timeout=WAIT_S) for _ in range(60))


def test_an_address_that_is_taken():
    with served() as here:
        port = int(here.url.rsplit(":", 1)[1])
        server = LiveServer(lambda: LiveSession(Bender(), STYLE))
        with pytest.raises(InvalidInputError, match=r"cannot be listened on: .*; try another port"):
            asyncio.run(server.run("127.0.0.1", port, asyncio.Event(), str))
