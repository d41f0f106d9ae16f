"""The README does what it says: its code runs and prints what it shows, its commands exist, its links lead somewhere."""

import contextlib
import importlib.util
import io
import re
import shlex
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from batten.cli.main import main
from batten.fabrication.cut import plan_cut
from batten.io.job import load_job
from batten.io.job_surface import read_job_surface

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]


def blocks(language):
    return [text for name, text in BLOCKS if name == language]


def test_the_code_prints_what_is_shown():
    (code,), (shown,) = blocks("python"), blocks("text")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue() == shown


def test_the_make_targets_exist():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    named = re.findall(r"^make (\w+)", "\n".join(blocks("sh")), re.MULTILINE)
    assert named == ["demo", "test"]  # exactly two commands on a fresh machine
    assert set(named) <= set(targets)
    contributing = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    assert set(re.findall(r"^\| `make (\w+)`", contributing, re.MULTILINE)) <= set(targets)


def test_the_commands_are_understood(capsys):
    lines = re.findall(r"^\.venv[/\\]\w+[/\\]batten (.*)$", "\n".join(t for _, t in BLOCKS), re.MULTILINE)
    assert len(lines) == 15
    for line in lines:
        words = shlex.split(line.replace("\\", "/"), comments=True)
        command = [words.pop(0) for _ in range(2 if words[0] == "study" else 1)]
        assert main([*command, "--help"]) == 0
        usage = capsys.readouterr().out
        assert all(re.search(rf"(^|\s){word}\b", usage) for word in words if word.startswith("-"))
        for word in words:
            assert not word.endswith(".toml") or (ROOT / word).is_file()


def test_windows_runs_what_make_runs():
    makefile, windows = (ROOT / "Makefile").read_text("utf-8"), "\n".join(blocks("bat"))
    ours = {
        " ".join(c.replace("$(OUT)", "out/freeform-wall").replace("--quiet ", "").split())
        for c in re.findall(r"^\t\$\(BIN\)/(.*)$", makefile, re.MULTILINE)
        if "refused" not in c and "benchmarks" not in c
    }
    theirs = {c.replace("\\", "/") for c in re.findall(r"^\.venv\\Scripts\\(.*)$", windows, re.MULTILINE)}
    assert theirs == ours
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["requires-python"]
    assert wanted == ">=3.11"
    assert "py -3.11 -m venv .venv" in windows


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


def test_the_picture_is_light_and_can_be_drawn_again(tmp_path):
    size = (ROOT / "docs/pictures/wall.png").stat().st_size
    assert size < 200_000
    spec = importlib.util.spec_from_file_location("pictures", ROOT / "examples/pictures.py")
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    job = load_job(ROOT / "examples/freeform-wall/wall.toml")
    job = replace(job, leaves=replace(job.leaves, spacing_mm=150.0, max_turn_between_deg=90.0))
    surface = read_job_surface(job.surface)
    pictures.draw(plan_cut(job, surface), surface, job, tmp_path / "wall.png", featured=16)
    with Image.open(ROOT / "docs/pictures/wall.png") as kept, Image.open(tmp_path / "wall.png") as drawn:
        assert drawn.size == kept.size
        red, green, blue = (len(set(channel.tobytes())) for channel in drawn.convert("RGB").split())
    assert min(red, green, blue) > 20  # a picture, not a white sheet
