"""Rules of the house that no other tool holds: whole layers, short files, honest names, equal versions, nothing private."""

import ast
import doctest
import functools
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import batten

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "batten"
SOURCES = sorted(PACKAGE.rglob("*.py"))
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
BESIDE_THE_LAYERS = {"errors", "typing"}
MOST_LINES = 450


def tracked_texts():
    """Every text file that git keeps, or would keep, by its path; without git, everything that is no build product."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            check=True,
        ).stdout.decode()
        paths = [ROOT / name for name in listed.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        folders = [ROOT, *(ROOT / name for name in ("src", "tests", "docs", "examples", "benchmarks", ".ci"))]
        paths = [p for folder in folders for p in (folder.glob("*") if folder == ROOT else folder.rglob("*"))]
    for path in paths:
        if path.is_file():
            data = path.read_bytes()
            if b"\0" not in data[:8000]:
                yield path.relative_to(ROOT).as_posix(), data.decode("utf-8", errors="replace")


def test_the_layers_cover_every_package():
    contract = next(c for c in PYPROJECT["tool"]["importlinter"]["contracts"] if c["type"] == "layers")
    packages = {p.name for p in PACKAGE.iterdir() if (p / "__init__.py").is_file()}
    assert {name.removeprefix("batten.") for name in contract["layers"]} == packages
    alone = {p.stem for p in PACKAGE.glob("*.py")} - {"__init__"}
    assert alone == BESIDE_THE_LAYERS


def test_the_mathematics_is_kept_from_files_and_screens():
    contract = next(
        c for c in PYPROJECT["tool"]["importlinter"]["contracts"] if "batten.curves" in c.get("source_modules", ())
    )
    above = {"kernels", "io", "cli"}
    packages = {p.name for p in PACKAGE.iterdir() if (p / "__init__.py").is_file()} - above
    assert {name.removeprefix("batten.") for name in contract["source_modules"]} == packages
    assert {"rhino3dm", "pydantic", "typer", "rich", "matplotlib"} <= set(contract["forbidden_modules"])


def test_only_kernels_compile():
    found = {
        p.relative_to(PACKAGE).parts[0] for p in SOURCES if re.search(r"^\s*(from|import) numba", p.read_text(), re.M)
    }
    assert found <= {"kernels"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_files_are_short_and_named_for_what_they_hold(path):
    text = path.read_text("utf-8")
    assert text.count("\n") <= MOST_LINES
    assert not re.search(r"(^|_)(utils?|helpers?|common|misc|stuff)$", path.stem)
    if path.stem != "__init__" or text:
        assert ast.get_docstring(ast.parse(text)), "a module says in its first line what it is for"


def test_functions_are_short():
    """80 lines without the docstring; kernels may be longer, where each further function costs time to compile."""
    long = []
    for path in (p for p in SOURCES if p.parent.name != "kernels"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef):
                docstring = node.body[0] if ast.get_docstring(node) is not None else None
                lines = node.end_lineno - node.lineno + 1
                lines -= docstring.end_lineno - docstring.lineno + 1 if docstring else 0
                if lines > 80:
                    long.append(f"{path.relative_to(PACKAGE)}: {node.name} has {lines} lines")
    assert long == []


def test_errors_are_not_swallowed():
    """`except Exception` only where the command turns any fault into a report of it."""
    found = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ExceptHandler):
                broad = node.type is None or (isinstance(node.type, ast.Name) and node.type.id == "Exception")
                silent = len(node.body) == 1 and isinstance(node.body[0], ast.Pass)
                if (broad and path.name != "main.py") or silent:
                    found.append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert found == []


@functools.cache
def examples():
    """The code of every example that is run, in docstrings of the package and in the README, in one text."""
    parser = doctest.DocTestParser()
    code = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL)
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                code += [example.source for example in parser.get_examples(ast.get_docstring(node) or "")]
    return "".join(code)


@pytest.mark.parametrize("name", [n for n in batten.__all__ if n != "__version__"])
def test_public_names_are_documented_and_shown(name):
    thing = getattr(batten, name)
    assert inspect.getdoc(thing)
    assert re.search(rf"\b{name}\b", examples()), f"no example uses {name}"


def test_public_methods_are_documented():
    bare = []
    for name in batten.__all__:
        thing = getattr(batten, name)
        if inspect.isclass(thing):
            bare += [
                f"{name}.{member}"
                for member, value in vars(thing).items()
                if not member.startswith("_")
                and (callable(value) or isinstance(value, property | classmethod | staticmethod))
                and not inspect.getdoc(getattr(thing, member))
            ]
    assert bare == []


def test_the_lazy_names_are_those_of_the_type_checker():
    tree = ast.parse((PACKAGE / "__init__.py").read_text("utf-8"))
    imported = {
        alias.asname: node.module
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If)
        for node in branch.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert imported == batten._WHERE
    for name, module in batten._WHERE.items():
        assert getattr(importlib.import_module(module), name) is getattr(batten, name)


def test_import_is_quick():
    code = "import sys, batten; print(*({'numpy', 'numba', 'scipy', 'matplotlib', 'rhino3dm'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_versions_agree():
    assert PYPROJECT["project"]["version"] == batten.__version__
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(rf"^version: {re.escape(batten.__version__)}$", citation, re.M)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert "## Unreleased" in changelog


def test_the_citation_is_complete():
    """Cite as CFF 1.2.0 wants it, with the five papers that the keys in the code stand for."""
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    for key in ("cff-version: 1.2.0", "message: ", "title: batten", "authors:", "type: software", "license: MIT"):
        assert re.search(rf"^{key}", text, re.M), key
    references = text.split("references:\n")[1].split("  - type: ")[1:]
    assert len(references) == 5
    for reference in references:
        assert re.match(r"(article|thesis)\n", reference)
        assert "    title: " in reference
        assert "      - family-names: " in reference
    keys = set(re.findall(r"\b(?:Brander|Fisker|Levien|Moreton)\d{4}", "".join(p.read_text("utf-8") for p in SOURCES)))
    assert keys <= set(re.findall(r"notes: \"(\w+) in the code", text))


def test_nothing_private_or_tied_to_a_machine_is_kept():
    # Put together from parts, so that this file does not hold what it looks for.
    hosts = [
        "pypi" + ".org",
        "pythonhosted" + ".org",
        "registry.npmjs" + ".org",
        "index" + "-url",
        "conda.anaconda" + ".org",
    ]
    paths = [
        r"/ho" + r"me/\w",
        r"/Us" + r"ers/\w",
        r"C:\\Us" + "ers",
        r"/wo" + r"rk/\w",
        r"/ro" + r"ot/\w",
        r"/tm" + r"p/\w+",
    ]
    found = []
    for name, text in tracked_texts():
        for pattern in [*map(re.escape, hosts), *paths]:
            found += [f"{name}: {m.group()}" for m in re.finditer(rf"(?<![\w.$}}]){pattern}", text)]
    assert found == []


def test_the_reference_of_papers_is_used_by_its_keys():
    """Every paper key in the code is one of the five, written alike."""
    known = {"Brander2016", "Brander2018", "Fisker2018", "Levien2009", "Moreton1995"}
    for path in SOURCES:
        keys = re.findall(r"\b(?:Brander|Fisker|Levien|Moreton|Nørbjerg)\s?\(?\d{4}", path.read_text("utf-8"))
        assert set(keys) <= known, path
