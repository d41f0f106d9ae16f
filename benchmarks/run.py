"""Runs the benchmarks beside this file and prints one table of ratios.

    python benchmarks/run.py                            everything, printed
    python benchmarks/run.py --only elastica            one of them
    python benchmarks/run.py --write docs/benchmarks.md the table as a page too

A benchmark is a file bench_NAME.py with `run() -> list[dict]`; each row holds `what`, `ours_s` and `peer_s` (seconds for the
same work), `peer` (who), `ratio` and `note`; `peer_s` and `ratio` are None where nobody else does it. They compare with what
a user would take instead, in the same run on the same input; they are not tests.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ONE_CORE = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
COLUMNS = ("what", "ours", "peer", "peer's", "ratio", "note")


def machine() -> str:
    """The machine and the versions that the numbers belong to, in one line."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        named = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        model = named[0] if named else model
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return (
        f"{model}, {os.cpu_count()} cores (each benchmark uses one), {platform.system()}, "
        f"Python {platform.python_version()}, {packages}"
    )


def seconds(value: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e9:.3g} ns"


def cells(row: dict[str, Any]) -> tuple[str, ...]:
    if row["peer_s"] is None:  # nobody else does it
        return (row["what"], seconds(row["ours_s"]), row["peer"], "–", "–", row["note"])
    ratio = f"{row['ratio']:.1f} ×" if row["ratio"] < 20 else f"{row['ratio']:.0f} ×"
    return (row["what"], seconds(row["ours_s"]), row["peer"], seconds(row["peer_s"]), ratio, row["note"])


def load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def page(rows: list[dict[str, Any]]) -> str:
    lines = [
        "# Benchmarks",
        "",
        "What the same work costs with batten and with what one would take instead, in the same run, on the same input and",
        "on one core where nothing else is said. Written by `python benchmarks/run.py --write docs/benchmarks.md`;",
        "the scripts there say exactly what is compared.",
        "",
        f"Machine: {machine()}.",
        "",
        "| " + " | ".join(COLUMNS) + " |",
        "|" + "---|" * len(COLUMNS),
        *("| " + " | ".join(cells(row)) + " |" for row in rows),
        "",
    ]
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="NAME", help="run bench_NAME.py alone")
    parser.add_argument("--write", metavar="FILE", type=Path, help="write the table as a Markdown page too")
    options = parser.parse_args()
    for name in ONE_CORE:
        os.environ.setdefault(name, "1")
    paths = sorted(HERE.glob(f"bench_{options.only or '*'}.py"))
    if not paths:
        known = ", ".join(sorted(path.stem.removeprefix("bench_") for path in HERE.glob("bench_*.py")))
        print(f"no benchmark named {options.only!r}; there are: {known}", file=sys.stderr)
        return 2

    from rich.console import Console
    from rich.table import Table

    console: Console = Console() if sys.stdout.isatty() else Console(width=140)
    rows: list[dict[str, Any]] = []
    for path in paths:
        with console.status(f"{path.stem} …"):
            rows += load(path).run()
    table = Table(title="the same work, by batten and by others", caption=machine(), show_lines=True)
    for name in COLUMNS:
        table.add_column(name, justify="right" if name in ("ours", "peer's", "ratio") else "left")
    for row in rows:
        table.add_row(*cells(row))
    console.print(table)
    if options.write is not None:
        options.write.write_text(page(rows), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
