"""A folder appears whole or not at all, whatever goes wrong in between."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from batten.errors import InvalidInputError
from batten.io import whole_or_nothing
from batten.io.whole_or_nothing import written_whole


def never_ours(folder: Path) -> None:
    return None


def ours(folder: Path) -> frozenset[str]:
    return frozenset({"a.txt", "sub/b.txt"})


def write(folder: Path, text: str) -> None:
    (folder / "a.txt").write_text(text)
    (folder / "sub").mkdir()
    (folder / "sub/b.txt").write_text(text)


def contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()}


WHOLE_1 = {"a.txt": "1", "sub/b.txt": "1"}
WHOLE_2 = {"a.txt": "2", "sub/b.txt": "2"}


def test_a_new_folder_with_new_parents(tmp_path):
    out = tmp_path / "x/y/out"
    with written_whole(out, never_ours) as new:
        assert not out.exists()
        write(new, "1")
    assert contents(tmp_path) == {f"x/y/out/{k}": v for k, v in WHOLE_1.items()}
    if os.name != "nt":
        mask = os.umask(0)
        os.umask(mask)
        assert out.stat().st_mode & 0o777 == 0o777 & ~mask


def test_an_earlier_folder_is_replaced_and_nothing_else_remains(tmp_path):
    out = tmp_path / "out"
    for text in "12":
        with written_whole(out, ours) as new:
            write(new, text)
            assert not out.exists() or contents(out) == WHOLE_1
    assert contents(tmp_path) == {f"out/{k}": v for k, v in WHOLE_2.items()}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    "error", [RuntimeError("x"), KeyboardInterrupt(), SystemExit(3), OSError(errno.ENOSPC, "full")]
)
@pytest.mark.parametrize("earlier", [False, True])
def test_an_error_while_writing_leaves_what_was(tmp_path, error, earlier):
    out = tmp_path / "new/out" if not earlier else tmp_path / "out"
    if earlier:
        out.mkdir()
        write(out, "1")
    before = sorted(tmp_path.rglob("*"))

    def fail_half_way() -> None:
        with written_whole(out, ours) as new:
            (new / "a.txt").write_text("2")
            raise error

    with pytest.raises(type(error)):
        fail_half_way()
    assert sorted(tmp_path.rglob("*")) == before
    assert contents(tmp_path) == ({f"out/{k}": v for k, v in WHOLE_1.items()} if earlier else {})


@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("error", [OSError(errno.EIO, "gone"), KeyboardInterrupt()])
def test_an_error_while_moving_into_place_leaves_what_was(tmp_path, monkeypatch, step, error):
    out = tmp_path / "out"
    out.mkdir()
    write(out, "1")
    true_rename, calls = Path.rename, []

    def rename(self, to):
        calls.append(self)
        if len(calls) == step:
            raise error
        return true_rename(self, to)

    monkeypatch.setattr(Path, "rename", rename)
    with pytest.raises(type(error)), written_whole(out, ours) as new:
        write(new, "2")
    assert len(calls) >= step
    assert contents(tmp_path) == {f"out/{k}": v for k, v in WHOLE_1.items()}


def test_an_error_while_flushing_leaves_what_was(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(whole_or_nothing.os, "fsync", full)
    with pytest.raises(OSError, match="No space left"), written_whole(tmp_path / "out", never_ours) as new:
        write(new, "1")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("new_one_arrived", [False, True])
def test_a_power_cut_between_the_two_renamings_is_mended_by_the_next_run(tmp_path, new_one_arrived):
    out, old = tmp_path / "out", tmp_path / ".out.batten-old"
    old.mkdir()
    write(old, "1")
    if new_one_arrived:
        out.mkdir()
        write(out, "2")

    def look_and_fail() -> None:
        with written_whole(out, ours):
            assert contents(out) == (WHOLE_2 if new_one_arrived else WHOLE_1)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        look_and_fail()
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_what_batten_did_not_make_is_never_touched(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "thesis.doc").write_text("three years")
    for made_by_us, says in (
        (never_ours, "not made by batten"),
        (ours, "holds thesis.doc, which batten did not write"),
    ):
        with pytest.raises(InvalidInputError, match=says), written_whole(out, made_by_us):
            raise AssertionError
    assert contents(tmp_path) == {"out/thesis.doc": "three years"}
    with pytest.raises(InvalidInputError, match="is no folder"), written_whole(out / "thesis.doc", ours):
        raise AssertionError


def test_an_empty_folder_may_be_filled(tmp_path):
    with written_whole(tmp_path / "out", never_ours) as new:
        write(new, "1")
    (tmp_path / "empty").mkdir()
    with written_whole(tmp_path / "empty", never_ours) as new:
        write(new, "2")
    assert contents(tmp_path / "empty") == WHOLE_2


@pytest.mark.skipif(sys.platform == "win32", reason="no file size limits there")
def test_a_drive_that_takes_no_more_leaves_nothing(tmp_path):
    script = f"""
import resource, signal
from pathlib import Path
from batten.io.whole_or_nothing import written_whole
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    with written_whole({str(tmp_path / "out")!r}, lambda folder: None) as new:
        (new / "a.txt").write_text("1")
        (new / "b.txt").write_text("2" * 10000)
except OSError as error:
    print("refused:", error.strerror)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("refused:"), done.stderr
    assert list(tmp_path.iterdir()) == []
