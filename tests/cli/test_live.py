"""`batten live` as a program of its own: streams, signals, websocket clients; a stand-in tracker, and once batten's own."""

import itertools
import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from batten.cli.live import address_of
from batten.cli.main import main
from batten.errors import InvalidInputError

ROD = Path(__file__).parents[2] / "examples/bend/rod.toml"
WAIT_S = 20.0  # at most, for what takes a second: to start, to answer, to end
STAND_IN = """\
import math, os, sys, time
from types import SimpleNamespace
from batten.curves.elastica import Elastica

class RodTracker:
    def __init__(self, length):
        self.length = length
    def move(self, pose):
        time.sleep(float(os.environ.get("PAUSE_S", "0")))
        curve = Elastica(pose[:2], pose[2], (pose[5] - pose[2]) / self.length, (0.0, 0.0), self.length)
        return SimpleNamespace(elastica=curve, energy=0.0, margin=math.inf, stable=True, snap=None)

import batten.solvers.track
batten.solvers.track.RodTracker = RodTracker
from batten.cli.main import main
sys.exit(main())
"""


@pytest.fixture
def live(tmp_path, monkeypatch):
    """A function that starts `batten live` with a stand-in tracker; what still runs is ended after the test."""
    monkeypatch.setenv("no_proxy", "*")
    script, started = tmp_path / "stand_in.py", []
    script.write_text(STAND_IN, encoding="utf-8")

    def start(*words, pause_s=0.0):
        process = subprocess.Popen(
            [sys.executable, str(script), "live", *map(str, words)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"PAUSE_S": str(pause_s)},
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def line(k, x=0.5):
    return b'{"start": [0, 0, 0], "end": [%a, 0, 0], "id": %d}\n' % (x, k)


def outcome(process, data=b""):
    """Status, records, and what is said on stderr, of a process that is given this and nothing more."""
    out, err = process.communicate(data, timeout=WAIT_S)
    return process.returncode, [json.loads(text) for text in out.splitlines()], err.decode()


def heard(process, pattern):
    """Wait until stderr says so; what was found. A thread reads, so that the wait has an end."""
    found = []
    reader = threading.Thread(target=lambda: found.append(process.stderr.readline().decode()), daemon=True)
    reader.start()
    reader.join(WAIT_S)
    assert found, "nothing was said"
    match = re.search(pattern, found[0])
    assert match, found[0]
    return match[1]


def test_lines_in_and_lines_out(live):
    data = line(1) + b"nonsense\n" + line(2, x=1.5) + line(3)[:-1]
    status, records, err = outcome(live("--length", "1", "--points", "3", "--keep-all"), data)
    assert status == 0
    assert [(r["n"], r.get("id"), "error" in r) for r in records] == [
        (1, 1, False), (2, None, True), (3, None, True), (4, 3, False),
    ]  # fmt: skip
    assert records[0]["points"] == [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    assert "force_n" not in records[0]
    assert err == "batten live: 2 poses, 2 followed, 0 dropped, 2 errors, 0 snaps\n"


def test_a_rod_gives_length_and_newtons(live):
    status, records, _ = outcome(live("--rod", ROD), line(1, x=600.0))
    assert status == 0
    assert records[0]["elastica"][6] == 1000.0
    assert records[0]["strain_ok"] is True
    assert len(records[0]["points"]) == 33
    assert records[0].keys() > {"force_n", "moments_nmm", "energy_j", "strain"}


def test_a_pose_is_answered_before_the_next_one_comes(live):
    process = live("--length", "1")
    for k in range(3):
        process.stdin.write(line(k))
        process.stdin.flush()
        assert json.loads(process.stdout.readline())["id"] == k
    assert outcome(process)[0] == 0


def test_under_load_the_newest_is_answered_and_the_others_are_counted(live):
    process = live("--length", "1", pause_s=0.1)
    for k in range(80):
        process.stdin.write(line(k))
        process.stdin.flush()
        time.sleep(0.01)
    status, records, err = outcome(process)
    assert status == 0
    assert records[-1]["id"] == 79
    assert len(records) < 60
    assert sum(r["dropped"] for r in records) == 80 - len(records)
    assert f"80 poses, {len(records)} followed, {80 - len(records)} dropped" in err


def test_all_poses_of_a_file_are_answered_in_order(live):
    status, records, _ = outcome(live("--length", "1", "--keep-all"), b"".join(map(line, range(500))))
    assert status == 0
    assert [r["id"] for r in records] == list(range(500))


def test_who_reads_may_go(live):
    process = live("--length", "1", "--keep-all")
    process.stdin.write(b"".join(map(line, range(50))))
    process.stdin.flush()
    process.stdout.readline()
    process.stdout.close()
    process.stdin.write(b"".join(map(line, range(50))))
    process.stdin.flush()
    assert process.wait(WAIT_S) == 0
    assert b"(ended early)\n" in process.stderr.read()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals")
@pytest.mark.parametrize(("name", "blocked"), [("SIGINT", False), ("SIGTERM", True)])
def test_a_signal_ends_it_cleanly(live, name, blocked):
    process = live("--length", "1", "--keep-all")
    process.stdin.write(line(1) * (400 if blocked else 1))
    process.stdin.flush()
    assert json.loads(process.stdout.readline())["id"] == 1
    time.sleep(0.3 if blocked else 0.0)  # its output is full by then: nobody reads on
    process.send_signal(getattr(signal, name))
    assert process.wait(WAIT_S) == 0
    assert re.fullmatch(rb"batten live: .* \(ended early\)\n", process.stderr.read())


def test_clients_come_and_go(live):
    process = live("--length", "1", "--listen", "127.0.0.1:0")
    url = heard(process, r"listening on (ws://127\.0\.0\.1:\d+)")
    with connect(url) as first:
        with connect(url) as second:
            for client, k in ((first, 1), (second, 2), (first, 3)):
                client.send(line(k).decode())
                assert json.loads(client.recv(timeout=WAIT_S))["id"] == k
        first.send("nonsense")
        assert "not JSON" in json.loads(first.recv(timeout=WAIT_S))["error"]
        if sys.platform == "win32":
            return
        process.send_signal(signal.SIGTERM)
        with pytest.raises(ConnectionClosed):
            first.recv(timeout=WAIT_S)
    assert process.wait(WAIT_S) == 0
    assert process.stderr.read() == b"batten live: 3 poses, 3 followed, 0 dropped, 1 errors, 0 snaps, 2 clients\n"


def test_the_real_tracker_follows_both_ends():
    """Points run from one end to the other with the length of the rod; half a turn of both ends and back is followed."""
    poses = [(0.0, 0.0, 0.4 + a, 0.8 * math.cos(a), 0.8 * math.sin(a), -0.4 + a) for a in (0.0, 1.0, 2.0, 3.0, 4.0)]
    sent = [{"start": pose[:3], "end": [*pose[3:5], math.remainder(pose[5], math.tau)]} for pose in poses]
    words = [sys.executable, "-m", "batten.cli.main", "live", "--length", "1", "--keep-all", "--points", "401"]
    data = "".join(json.dumps(s) + "\n" for s in sent).encode()
    done = subprocess.run(words, input=data, capture_output=True, timeout=300.0)
    assert done.returncode == 0, done.stderr.decode()
    records = [json.loads(text) for text in done.stdout.splitlines()]
    assert len(records) == len(poses)
    for pose, record in zip(poses, records):
        points = record["points"]
        assert points[0] == pytest.approx(pose[:2], abs=1e-9)
        assert points[-1] == pytest.approx(pose[3:5], abs=1e-9)
        assert sum(math.dist(p, q) for p, q in itertools.pairwise(points)) == pytest.approx(1.0, abs=1e-4)
        assert record["energy"] == pytest.approx(records[0]["energy"], rel=1e-9), "it is the same shape, turned"
        assert (record["stable"], record["snap"]) == (True, None)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "--length is missing"),
        (("--length", "-1"), "--length -1: allowed are numbers above 0"),
        (("--length", "1", "--points", "1"), "points = 1; allowed are 2 to 10000"),
        (("--length", "1", "--listen", "8765"), "allowed is HOST:PORT"),
        (("--length", "1", "--listen", "127.0.0.1:99999"), "a port from 0 (a free one) to 65535"),
        (("--length", "1", "--listen", "0.0.0.0:0"), "whoever reaches 0.0.0.0 may use it: try 127.0.0.1"),
        (("--length", "1", "--listen", "rig.example.com:8765"), "or add --allow-remote"),
        (("--length", "1", "--allow-remote"), "--allow-remote is for --listen alone"),
        (("--rod", "nowhere.toml"), "nowhere.toml"),
    ],
)
def test_bad_input_is_one_line(words, says, capsys):
    assert main(["live", *words]) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_addresses():
    assert address_of("127.0.0.1:0", False) == ("127.0.0.1", 0)
    assert address_of("localhost:65535", False) == ("localhost", 65535)
    assert address_of("[::1]:80", False) == ("::1", 80)
    assert address_of("127.8.0.1:80", False) == ("127.8.0.1", 80)
    assert address_of("0.0.0.0:80", True) == ("0.0.0.0", 80)
    assert address_of("rig.example.com:80", True) == ("rig.example.com", 80)
    for text in (
        "[::]:80",
        "10.0.0.1:80",
        "localhost.example.com:80",
        "127.0.0.1.example.com:80",
        "::1:80",
        "127.0.0.1:",
    ):
        with pytest.raises(InvalidInputError, match="--listen"):
            address_of(text, False)
