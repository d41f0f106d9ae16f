"""The page on a simulated cut, and the section of the cut's report that shows its main figures."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from batten.errors import FormatError
from batten.io.report_tables import amount, halves, table
from batten.io.software import software_name

if TYPE_CHECKING:  # a cut's report shows that there is no simulation, and loads none
    from batten.fabrication.swept_surface import Distances, Simulation

_SECTION = '<section id="simulation">'
_FILES = '<section id="files">'


def verdict(simulation: Simulation) -> str:
    """Whether the face keeps the limit, in one sentence."""
    limit = f"{simulation.limit_mm:g} mm"
    worst = max((b.worst_mm for b in simulation.blocks), default=float("nan"))
    if simulation.without_program:
        return f"{_blocks_named(simulation.without_program)} no robot program: nothing is cut there"
    if simulation.failing:
        far = [b.block.number for b in simulation.blocks if not b.worst_mm <= simulation.limit_mm]
        which = _blocks_named(far or simulation.failing)
        return (
            f"{which} points farther than {limit} from the design, the farthest {amount(worst)} mm"
            if far
            else f"{which} points at which the kerf is not known"
        )
    return f"every point of the simulated face lies within {limit} of the design, the farthest {amount(worst)} mm"


def remarks(simulation: Simulation) -> list[str]:
    """What a reader must know before trusting the numbers."""
    texts = []
    sweeps = [b.sweep for b in simulation.blocks]
    leaves_plane = max((float(s.out_of_plane_mm.max()) for s in sweeps), default=0.0)
    if leaves_plane > 0.1 * simulation.tolerance_mm:
        angle = float(np.degrees(max(s.out_of_plane_rad.max() for s in sweeps)))
        far = [b for b in simulation.blocks if b.sweep.out_of_plane_mm.max() > 0.1 * simulation.tolerance_mm]
        where = ", ".join(str(b.block.number) for b in far)
        texts.append(
            f"Between leaves the ends of the rod point up to {amount(angle)}° out of one plane (block {where}), because "
            f"the tools turn about the rod on their way. The rod is taken as planar; it would leave the plane by about "
            f"{amount(leaves_plane)} mm between its ends, in the direction of the sweep."
        )
    twist = float(np.degrees(max((np.ptp(s.twist_rad) for s in sweeps), default=0.0)))
    if twist > 1.0:
        texts.append(
            f"The two grippers turn against each other about the rod by up to {amount(twist)}°: the rod must be free to "
            "turn in one of them, or it is twisted."
        )
    several = [b.block.number for b in simulation.blocks if b.sweep.choices > 1]
    if several:
        texts.append(
            f"The rod has more than one stable shape where it is fixed (block{'s' if len(several) > 1 else ''} "
            f"{', '.join(map(str, several))}): it must be put in the one that is nearest to the design."
        )
    unknown = sum(b.unknown for b in simulation.blocks)
    if unknown:
        texts.append(
            f"At {unknown} points the blade is slower or faster than the kerf is known for; they have no distance."
        )
    return texts


def simulation_page(simulation: Simulation, pictures: tuple[bytes, bytes], *, cut: str) -> str:
    """The page's text: well-formed XML after its first line; the pictures, map and histogram as PNG, are in it."""
    style = resources.files("batten.io").joinpath("report.css").read_text(encoding="utf-8")
    title = html.escape(cut)
    body = [
        f'<header><div><p class="kind">Simulated cut</p><h1>{title}</h1></div>'
        f'<p class="meta">{html.escape(software_name())}<br />from the robot modules</p></header>',
        _verdict(simulation),
        *(f"<p>{html.escape(text)}</p>" for text in remarks(simulation)),
        _figures(simulation),
        _picture(
            "Where",
            "Signed distance of the face from the design in plan, x to the right and y up; magenta beyond the limit. "
            "Numbers are those of the blocks.",
            pictures[0],
        ),
        _picture("How much", "Signed distances of the face, by the share of its area.", pictures[1]),
        f"<section><h2>At leaves and between them</h2><p>{_ABOUT}</p>{_main_table(simulation)}</section>",
        _blocks(simulation),
        f"<section><h2>How it was found</h2><p>{html.escape(_how(simulation))}</p></section>",
    ]
    return (
        f'<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml">\n<head>\n<meta charset="utf-8" />\n'
        f'<meta name="viewport" content="width=device-width" />\n<title>{title} – simulated cut</title>\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def report_section(simulation: Simulation | None, picture: bytes = b"") -> str:
    """The section of the cut's report: the simulation's main figures and its map (PNG), or how to get them.

    Parameters:
        simulation: None if the cut was not simulated.
        picture: the map.
    """
    if simulation is None:
        text = (
            "Not simulated yet: <code>batten simulate</code> on this folder drives the blade along the robot program, "
            "between the leaves too, and compares the face that is left with the design."
        )
        return f"{_SECTION}<h2>Simulated cut</h2><p>{text}</p></section>"
    sentence = html.escape(verdict(simulation))
    mark = '<span class="mark">✓ pass</span>' if simulation.is_good else '<span class="mark bad">✗ fail</span>'
    return (
        f"{_SECTION}<h2>Simulated cut</h2><p>{mark} From the robot modules alone, {sentence}. "
        f"More in <code>simulation/simulation.html</code>, the face as a mesh in <code>simulation/swept.ply</code>.</p>"
        f"<p>{_ABOUT}</p>{_main_table(simulation)}{_image('Simulated deviation over the wall', picture)}</section>"
    )


def files_section(files: Mapping[str, str]) -> str:
    """The section of the cut's report that lists its files and their sums (SHA-256)."""
    rows = [[f"<code>{html.escape(name)}</code>", f"<code>{sha[:12]}</code>"] for name, sha in sorted(files.items())]
    about = (
        "<p><code>batten check</code> on this folder compares every file with its sum and recomputes every check.</p>"
    )
    return f"{_FILES}<h2>Files</h2>{about}{halves(('file', 'SHA-256 begins'), rows, numbers=(1,))}</section>"


def with_simulation(page: str, simulation: Simulation, picture: bytes, files: Mapping[str, str]) -> str:
    """The cut's report with the simulation in its place.

    Parameters:
        page: the report's text, with or without an earlier simulation.
        simulation: the simulation.
        picture: its map, PNG.
        files: sums of the files to list, by name.

    Raises:
        FormatError: a page without the two sections.
    """
    for head, section in ((_SECTION, report_section(simulation, picture)), (_FILES, files_section(files))):
        parts = re.split(re.escape(head) + r".*?</section>", page, flags=re.DOTALL)
        if len(parts) != 2:
            raise FormatError(f"report.html: has {len(parts) - 1} of {head}, one was expected; cut the job again")
        page = section.join(parts)
    return page


_ABOUT = (
    "Distances in mm, without sign: of the face from the design, all of it, at the leaves and between them, by area; and "
    "of the design from the face."
)


def _columns() -> list[str]:
    from batten.fabrication.swept_surface import PERCENTILES

    return ["mean", *(f"{p:g} %" for p in PERCENTILES), "greatest"]


def _main_table(simulation: Simulation) -> str:
    rows = [
        ["face, all of it", *_cells(simulation.face)],
        ["face, at leaves", *_cells(simulation.at_leaves)],
        ["face, between leaves", *_cells(simulation.between_leaves)],
        ["design, from the face", *_cells(simulation.design)],
    ]
    head = ["", *_columns()]
    return table(head, rows, numbers=tuple(range(1, len(head))))


def _cells(d: Distances) -> list[str]:
    return [amount(v) for v in (d.mean, *d.percentiles, d.max)]


def _verdict(simulation: Simulation) -> str:
    good, sentence = simulation.is_good, html.escape(verdict(simulation))
    return (
        f'<section class="verdict {"good" if good else "bad"}">'
        f"<strong>{'✓ Within' if good else '✗ Beyond'} tolerance</strong>"
        f"<p>{sentence[0].upper() + sentence[1:]}.</p></section>"
    )


def _figures(simulation: Simulation) -> str:
    sweeps = [b.sweep for b in simulation.blocks]
    face = simulation.face
    entries = [
        ("greatest, face from design", amount(face.max), f"mm of {simulation.limit_mm:g}"),
        ("greatest, design from face", amount(simulation.design.max), "mm"),
        ("mean", amount(face.mean), "mm"),
        ("99 % of the area within", amount(face.percentiles[-1]), "mm"),
        ("blocks", str(len(simulation.blocks)), f"{len(simulation.failing)} beyond"),
        ("stations", str(sum(len(s.move) for s in sweeps)), "rods solved"),
        ("points compared", str(face.points + simulation.design.points), ""),
        ("least stability margin", amount(min(float(s.margin.min()) for s in sweeps)), "on the way"),
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value} <small>{unit}</small></dd></div>" for name, value, unit in entries
    )
    return f'<dl class="figures">{cells}</dl>'


def _blocks(simulation: Simulation) -> str:
    head = ["block", "", *_columns(), "at leaves", "design", "out of plane", "twist", "worst"]
    rows: list[Sequence[str]] = []
    for block in simulation.blocks:
        fails = block.block.number in simulation.failing
        mark = '<span class="mark bad">✗ fail</span>' if fails else '<span class="mark">✓ pass</span>'
        others = (block.at_leaves.max, block.design.max, float(block.sweep.out_of_plane_mm.max()))
        rows.append(
            [
                str(block.block.number),
                mark,
                *_cells(block.face),
                *(amount(v) for v in others),
                amount(float(np.degrees(np.ptp(block.sweep.twist_rad)))) + "°",
                html.escape(block.worst[2]),
            ]
        )
    rows += [
        [str(n), '<span class="mark bad">✗ none</span>', *["–"] * 9, "no program"] for n in simulation.without_program
    ]
    about = (
        "Distances of the face from the design, mm; then the greatest at leaves, the greatest of the design from the face, "
        "how far the rod would leave its plane, and the turn of the grippers against each other."
    )
    return f"<section><h2>Blocks</h2><p>{about}</p>{table(head, rows, numbers=tuple(range(2, 11)))}</section>"


def _how(simulation: Simulation) -> str:
    kerf = (
        "The face lies half the kerf from the blade, by the local speed. "
        if simulation.half_kerf
        else "The face is the surface that the blade's axis sweeps; the kerf is not counted. "
    )
    return (
        "The modules of both arms were read back. Between two targets the tools move as MoveL does: positions along "
        "straight lines, orientations about one axis, both arms in step. At every station the rod is the elastica of its "
        "length between the two ends, followed from the station before, so that a snap would be found. "
        + kerf
        + "Corners at the targets are "
        "not rounded (RAPID's zones), gravity and the heat of the blade are not counted."
    )


def _picture(heading: str, about: str, picture: bytes) -> str:
    return f'<section class="picture"><h2>{heading}</h2><p>{about}</p>{_image(heading, picture)}</section>'


def _image(words: str, picture: bytes) -> str:
    address = "data:image/png;base64," + base64.b64encode(picture).decode("ascii")
    return f'<figure class="wide"><img alt="{words}" src="{address}" /></figure>'


def _blocks_named(numbers: Sequence[int]) -> str:
    many = len(numbers) > 1
    return f"block{'s' if many else ''} {', '.join(map(str, numbers))} {'have' if many else 'has'}"
