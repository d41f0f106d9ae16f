"""docs/bend-a-rod.md does what it says."""

import contextlib
import importlib.util
import io
import re
import shlex
from pathlib import Path

from PIL import Image

from batten.cli.main import main

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/bend-a-rod.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_code_prints_what_is_shown():
    names, shown = {}, [text for kind, text in BLOCKS if kind == "text"]
    codes = [text for kind, text in BLOCKS if kind == "python"]
    assert len(codes) == len(shown) == 3
    for code, text in zip(codes, shown):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, "bend-a-rod.md", "exec"), names)
        assert printed.getvalue() == text


def test_the_commands_are_understood(capsys):
    lines = re.findall(r"^(?:echo .* \| )?\.venv/bin/batten (.*)$", PAGE, re.MULTILINE)
    assert len(lines) == 3
    for line in lines:
        words = shlex.split(line)
        count = 2 if words[0] == "study" else 1
        assert main([*words[:count], "--help"]) == 0
        usage = capsys.readouterr().out
        for word in words[count:]:
            if re.match(r"-{1,2}[a-z]", word):
                assert re.search(rf"(^|\s){word}\b", usage), word
            assert not word.endswith(".toml") or (ROOT / word).is_file()


def test_the_pictures_can_be_drawn_again(tmp_path):
    spec = importlib.util.spec_from_file_location("bend_a_rod", ROOT / "examples/bend_a_rod.py")
    pictures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pictures)
    pictures.every_shape(tmp_path / "bend.png")
    pictures.the_snap(tmp_path / "snap.png", turns=21)
    for name in ("bend.png", "snap.png"):
        kept = ROOT / "docs/pictures" / name
        assert kept.stat().st_size < 200_000
        with Image.open(kept) as old, Image.open(tmp_path / name) as new:
            assert old.size == new.size
            assert len(set(new.convert("L").tobytes())) > 20
