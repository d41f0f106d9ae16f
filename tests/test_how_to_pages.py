"""The pages that show how to do something do what they say."""

import contextlib
import importlib.util
import io
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from batten.cli.main import main
from batten.io.approximate_files import read_curves

ROOT = Path(__file__).parents[1]
#: Name of a page, with how many pieces of code and how many commands it has.
PAGES = {
    "bend-a-rod": (3, 3),
    "design-a-surface": (2, 1),
    "draw-with-beziers": (2, 1),
    "approximate-curves": (2, 3),
    "elastic-splines": (5, 0),
    "rationalise": (0, 1),
    "which-spline": (0, 1),
}
PAGE = {name: (ROOT / f"docs/{name}.md").read_text("utf-8") for name in PAGES}


@pytest.mark.parametrize("name", PAGES)
def test_the_code_prints_what_is_shown(name):
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", PAGE[name], re.MULTILINE | re.DOTALL)
    names, shown = {}, [text for kind, text in blocks if kind == "text"]
    codes = [text for kind, text in blocks if kind == "python"]
    assert len(codes) == len(shown) == PAGES[name][0]
    for code, text in zip(codes, shown):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, f"{name}.md", "exec"), names)
        assert printed.getvalue() == text


@pytest.mark.parametrize("name", PAGES)
def test_the_commands_are_understood(name, capsys):
    lines = re.findall(r"^(?:echo .* \| )?\.venv/bin/batten (.*)$", PAGE[name], re.MULTILINE)
    assert len(lines) == PAGES[name][1]
    for line in lines:
        words = shlex.split(line)
        count = 2 if words[0] == "study" else 1
        assert main([*words[:count], "--help"]) == 0
        usage = capsys.readouterr().out
        for word in words[count:]:
            if re.match(r"-{1,2}[a-z]", word):
                assert re.search(rf"(^|\s){word}\b", usage), word
            assert not word.endswith(".toml") or (ROOT / word).is_file()


def test_approximations_print_what_is_shown(tmp_path, monkeypatch, capsys):
    blocks = re.findall(
        r"^```sh\n\.venv/bin/batten ([^\n]*)\n```\n\n```console\n(.*?)^```",
        PAGE["approximate-curves"],
        re.MULTILINE | re.DOTALL,
    )
    assert len(blocks) == PAGES["approximate-curves"][1]
    monkeypatch.chdir(tmp_path)
    for line, shown in blocks:
        words = [str(ROOT / word) if word.startswith("examples/") else word for word in shlex.split(line)]
        assert main(words) == 0
        assert capsys.readouterr().out == shown
        assert (tmp_path / words[-1]).is_file()


@pytest.mark.parametrize("name", PAGES)
def test_studies_that_a_page_names_exist(name, capsys):
    for study in set(re.findall(r"`batten study (\w+)", PAGE[name])):
        assert main(["study", study, "--help"]) == 0
        assert study in capsys.readouterr().out


def example(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f"examples/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def same_kind_of_picture(name, new_path):
    kept = ROOT / "docs/pictures" / name
    assert kept.stat().st_size < 200_000
    with Image.open(kept) as old, Image.open(new_path) as new:
        assert old.size == new.size
        assert len(set(new.convert("L").tobytes())) > 20


def test_pictures_of_bent_rods_can_be_drawn_again(tmp_path):
    pictures = example("bend_a_rod")
    pictures.every_shape(tmp_path / "bend.png")
    pictures.the_snap(tmp_path / "snap.png", turns=21)
    for name in ("bend.png", "snap.png"):
        same_kind_of_picture(name, tmp_path / name)


def test_the_projected_chair_can_be_drawn_again(tmp_path):
    example("draw_with_beziers").drawn_chair(tmp_path / "project.png")
    same_kind_of_picture("project.png", tmp_path / "project.png")


def test_the_approximated_letter_can_be_drawn_again(tmp_path):
    example("approximate_curves").every_way(tmp_path / "approximate.png")
    same_kind_of_picture("approximate.png", tmp_path / "approximate.png")


def test_the_drawings_of_curves_to_approximate_can_be_made_again(tmp_path):
    example("approximate_curves").drawings(tmp_path)
    kept = ROOT / "examples/approximate"
    for name in ("letter.svg", "section.dxf", "handrail.3dm"):
        (_, old), (_, new) = (read_curves(folder / name)[0][0] for folder in (kept, tmp_path))
        t = np.linspace(0.0, 1.0, 50)
        np.testing.assert_allclose(new.point(t), old.point(t), atol=1e-9)


def test_pictures_of_elastic_splines_can_be_drawn_again(tmp_path):
    pictures = example("elastic_splines")
    pictures.held_ways(tmp_path / "elastic-splines.png")
    pictures.jump(tmp_path / "elastic-spline-jump.png")
    for name in ("elastic-splines.png", "elastic-spline-jump.png"):
        same_kind_of_picture(name, tmp_path / name)
