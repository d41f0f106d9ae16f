"""Write a folder of files whole or not at all.

The files are built in a hidden sibling of the folder and moved into place by renaming, so that nobody ever sees a part
of them: not after an error, not after Ctrl-C, not after a full disk. An earlier folder is replaced only if batten made
it and nobody put anything else into it.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from batten.errors import InvalidInputError

_NEW, _OLD = ".batten-new-", ".batten-old"


@contextmanager
def written_whole(folder: str | Path, made_by_us: Callable[[Path], frozenset[str] | None]) -> Iterator[Path]:
    """A folder to write into, which becomes `folder` when the block ends without an error.

    Parameters:
        folder: where the files shall lie. Its parents are made where they are missing.
        made_by_us: given an existing folder, the relative paths (with "/") of the files in it that batten wrote; None
            if batten did not make it.

    Yields:
        An empty folder beside `folder`, on the same drive. After the block its files are flushed to the drive and it is
        renamed; an earlier folder is moved aside before, and back again if the renaming fails.

    Raises:
        InvalidInputError: before anything is written, if `folder` is a file, was not made by batten, or holds something
            that batten did not write.
        OSError: the drive is full, not writable or gone; then nothing is left behind.
    """
    target = Path(folder).resolve()
    old = target.with_name(f".{target.name}{_OLD}")
    ground = next(p for p in target.parents if p.exists())
    if not ground.is_dir():
        raise InvalidInputError(f"{target}: {ground} is a file and can hold no folder; give another place")
    made_parents = [p for p in target.parents if not p.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        _finish_earlier_swap(target, old)
        _refuse_foreign(target, made_by_us)
        new = Path(tempfile.mkdtemp(prefix=f".{target.name}{_NEW}", dir=target.parent))
        try:
            yield new
            new.chmod(0o777 & ~_umask())
            _flush(new)
            _swap(new, target, old)
        finally:
            shutil.rmtree(new, ignore_errors=True)
    except BaseException:
        for parent in made_parents:  # innermost first; one that is not empty is somebody else's by now
            try:
                parent.rmdir()
            except OSError:
                break
        raise


def _finish_earlier_swap(target: Path, old: Path) -> None:
    """What a power cut between the two renamings left: put the earlier folder back, or away if the new one is there."""
    if old.is_dir():
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            old.rename(target)


def _refuse_foreign(target: Path, made_by_us: Callable[[Path], frozenset[str] | None]) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InvalidInputError(f"{target}: exists and is no folder; give a folder that does not exist yet")
    present = {p.relative_to(target).as_posix() for p in target.rglob("*") if not p.is_dir() or p.is_symlink()}
    if not present:
        return
    ours = made_by_us(target)
    if ours is None:
        raise InvalidInputError(f"{target}: exists and was not made by batten; give a folder that does not exist yet")
    foreign = sorted(present - ours)
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise InvalidInputError(
            f"{target}: holds {foreign[0]}{more}, which batten did not write and would delete; move that away or give "
            "another folder"
        )


def _swap(new: Path, target: Path, old: Path) -> None:
    """`new` takes the place of `target`; on any failure in between, `target` is what it was."""
    try:
        if target.exists():
            target.rename(old)
        new.rename(target)
        _flush_folder(target.parent)
    except BaseException:
        if old.exists() and not target.exists():
            old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _flush(folder: Path) -> None:
    """Every file of the folder onto the drive, and the folders themselves where the system can."""
    for path in folder.rglob("*"):
        if path.is_dir():
            _flush_folder(path)
        else:
            with path.open("rb+") as file:
                os.fsync(file.fileno())
    _flush_folder(folder)


def _flush_folder(folder: Path) -> None:
    if os.name == "nt":  # folders cannot be opened there
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    """The process's mask for new files: mkdtemp makes private folders, results are for everyone whom it allows."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
