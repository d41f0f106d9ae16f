"""The report: its numbers against closed forms, its page against XML, its look against a real browser."""

import base64
import dataclasses
import html
import io
import json
import math
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.plan import CheckResult
from batten.io.cut_summary import cut_lines, cut_summary
from batten.io.report import report_html, verdict, write_report
from batten.io.report_maps import ABSENT, BROKEN, RAMP, check_map, ramp_colours
from batten.io.report_numbers import (
    critical_rod,
    leaf_ranges,
    rod_numbers,
    use_of_limit,
    wall_order,
    worst_rod,
)
from batten.io.report_tables import MOST_REPAIRED, amount, refused_rows, repaired_rows, repairs
from batten.measures.distance import distance_to_polyline

XHTML = "{http://www.w3.org/1999/xhtml}"


def page_of(text):
    assert text.startswith("<!DOCTYPE html>\n")
    return ET.fromstring(text.split("\n", 1)[1])


def words_of(element):
    return " ".join(" ".join(element.itertext()).split())


def with_checks(plan, *checks):
    return dataclasses.replace(plan, checks=checks)


# Numbers


def test_a_circle_has_its_strain_and_moment_and_no_force(make_plan):
    plan, job = make_plan(rows=1, columns=1, leaves=2)
    arc = Elastica((0.0, 0.0), 0.3, 1.0 / 800.0, (0.0, 0.0), 1000.0)
    plan = dataclasses.replace(plan, rods=tuple(dataclasses.replace(r, rod=arc) for r in plan.rods))
    numbers = rod_numbers(plan, job)
    stiffness = 200000.0 * math.pi * 3.0**4 / 64.0
    np.testing.assert_allclose(numbers.strain, 1.5 / 800.0, rtol=1e-12)
    np.testing.assert_allclose(numbers.moment_left_nmm, stiffness / 800.0, rtol=1e-12)
    np.testing.assert_allclose(numbers.moment_right_nmm, stiffness / 800.0, rtol=1e-12)
    np.testing.assert_array_equal(numbers.force_n, 0.0)


def test_forces_are_in_balance_along_the_rod(make_plan):
    """The moments at the ends differ by force × lever arm: statics of the free body, not the elastica's own formula."""
    plan, job = make_plan(rows=1, columns=2, leaves=2)
    numbers = rod_numbers(plan, job)
    stiffness = 200000.0 * math.pi * 3.0**4 / 64.0
    for i, rod in enumerate(plan.rods):
        arm = rod.rod.point_at(rod.rod.length) - rod.rod.start
        across = np.array([rod.rod.force[1], -rod.rod.force[0]]) / np.hypot(*rod.rod.force)
        lever = numbers.force_n[i] * (arm @ across)
        assert numbers.moment_right_nmm[i] - numbers.moment_left_nmm[i] == pytest.approx(lever, rel=1e-9)
        s = 0.31 * rod.rod.length
        bend = (rod.rod.angle_at(s + 0.5) - rod.rod.angle_at(s - 0.5)) / 1.0
        assert np.interp(s, numbers.arc_mm[i] + rod.before_mm, numbers.curvature[i]) == pytest.approx(bend, rel=2e-3)
        assert numbers.moment_left_nmm[i] == pytest.approx(stiffness * float(rod.rod.curvature_at(0.0)), rel=1e-12)


def test_distance_to_a_polyline():
    corner = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    points = np.array([[5.0, 2.0], [-3.0, 4.0], [13.0, 5.0], [9.0, 1.5], [10.0, 10.0]])
    np.testing.assert_allclose(distance_to_polyline(points, corner), [2.0, 5.0, 3.0, 1.0, 0.0], atol=1e-14)


@pytest.mark.parametrize(
    ("sense", "limit", "values", "use"),
    [
        ("max", 2.0, [0.0, 1.0, 2.0, 3.0, math.nan, math.inf, -1.0], [0.0, 0.5, 1.0, 1.5, math.nan, math.inf, 0.0]),
        ("min", 2.0, [4.0, 2.0, 1.0, math.inf, math.nan], [0.5, 1.0, 2.0, 0.0, math.nan]),
        ("min", 0.0, [4.0, 0.0, 2.0, -4.0], [0.0, 1.0, 0.5, 2.0]),
        ("min", 1.0, [1.0, 1.0, 0.8, math.nan], [0.0, 0.0, 1.25, math.nan]),  # the limit is the best there is
        ("min", 2.0, [2.0, math.inf], [1.0, 0.0]),
        ("max", 0.0, [-4.0, 0.0, 4.0], [0.0, 1.0, 2.0]),
    ],
)
def test_how_much_of_a_limit_is_used(sense, limit, values, use):
    check = CheckResult("x", "X", "", limit, sense, np.array(values))
    np.testing.assert_allclose(use_of_limit(check), use, rtol=1e-12)
    np.testing.assert_array_equal(use_of_limit(check) > 1.0, ~check.passed)


def test_the_featured_rod_is_the_one_with_the_least_margin(make_plan):
    plan, _ = make_plan(rows=1, columns=1, leaves=4)
    slack = CheckResult("a", "A", "", 10.0, "max", np.array([1.0, 2.0, 3.0, 4.0]))
    tight = CheckResult("b", "B", "", 10.0, "min", np.array([50.0, 11.0, 40.0, 30.0]))
    soft = CheckResult("c", "C", "", 1.0, "max", np.array([9.0, 0.0, 0.0, 0.0]), hard=False)
    assert critical_rod(with_checks(plan, slack, tight, soft)) == (1, tight)
    assert critical_rod(with_checks(plan, soft)) == (0, soft)
    assert critical_rod(with_checks(plan)) == (0, None)


def test_runs_of_leaves_are_drawn_together():
    assert leaf_ranges([9, 1, 4, 6, 5, 5]) == "1, 4–6, 9"
    assert leaf_ranges([2, 3]) == "2, 3"
    assert leaf_ranges([]) == ""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0000"), (0.012345, "0.0123"), (-0.5, "−0.500"), (1.0, "1.00"), (99.96, "100"), (12345.6, "12346"),
        (1.234e-7, "1.23·10⁻⁷"), (2.5e9, "2.50·10⁹"), (math.nan, "–"), (math.inf, "∞"), (-math.inf, "−∞"),
    ],
)  # fmt: skip
def test_how_numbers_are_written(value, text):
    assert amount(value) == text


# Maps


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_a_map_shows_each_rod_where_it_lies_in_plan(make_plan, blade_axis):
    plan, _ = make_plan(rows=2, columns=3, leaves=4, blade_axis=blade_axis)
    order = wall_order(plan)
    for index in (0, 5, 13, len(plan.rods) - 1):
        values = np.full(len(plan.rods), 0.5)
        values[index] = 2.0
        values[(index + 1) % len(values)] = np.nan
        address = check_map(plan, order, CheckResult("x", "X", "", 1.0, "max", values))
        data = base64.b64decode(address.removeprefix("data:image/png;base64,"))
        pixels = np.rint(255.0 * matplotlib.image.imread(io.BytesIO(data), format="png")).astype(int)
        red = np.argwhere((pixels == BROKEN).all(axis=-1)).mean(axis=0)
        assert (pixels == ABSENT).all(axis=-1).any()
        x, y = (red[1] + 0.5) / pixels.shape[1], 1.0 - (red[0] + 0.5) / pixels.shape[0]
        rod = plan.rods[index]
        block = plan.block(rod.block)
        low = min(b.corner_mm[:2].tolist() for b in plan.blocks)
        whole = np.array([3, 2] if blade_axis == "x" else [2, 3]) * 600.0
        place = rod.plane.to_world(rod.design[len(rod.design) // 2])[:2]
        along = 0 if blade_axis == "x" else 1
        place[along] = block.corner_mm[along] + 300.0
        np.testing.assert_allclose([x, y], (place - low) / whole, atol=0.02)


def test_the_ramp_of_colours():
    colours = ramp_colours(np.array([0.0, 1.0, 1.0001, np.inf, np.nan]))
    assert colours.tolist() == [list(c) for c in (RAMP[0], RAMP[-1], BROKEN, BROKEN, ABSENT)]
    grey = ramp_colours(np.linspace(0.0, 1.0, 50)) @ [0.299, 0.587, 0.114]
    assert (np.diff(grey) < 0.0).all(), "the ramp must grow darker throughout, for prints in grey"


# The page


@pytest.fixture
def refused(make_plan):
    plan, job = make_plan(rows=2, columns=2, leaves=5, refused=(2, 3), name="north <wall> & more")
    surface = dataclasses.replace(job.surface, file=Path("/nowhere/wall.3dm"))
    return plan, dataclasses.replace(job, surface=surface)


def test_the_page_is_well_formed_and_refers_to_nothing_outside(refused):
    text = report_html(*refused, pictures=True, files={"rods.csv": "ab" * 32})
    page = page_of(text)
    for element in page.iter():
        for name, value in element.attrib.items():
            if name in ("src", "href", "data", "action", "srcset"):
                assert value.startswith("data:image/"), f"{element.tag} {name} leads out of the page: {value[:60]}"
    assert page.find(f".//{XHTML}script") is None
    assert not re.search(r"@import|url\(", text)
    bare = re.sub(r"data:image/[\w+]+;base64,[\w+/=]+", "", text).replace('xmlns="http://www.w3.org/1999/xhtml"', "")
    assert "://" not in bare
    for drawing in re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", text):
        svg = base64.b64decode(drawing).decode()
        bare = re.sub(r'xmlns(:\w+)?="[^"]*"|"-//W3C.*?dtd"', "", svg, flags=re.DOTALL)
        assert "://" not in bare
        ET.fromstring(svg)
    assert len(text) < 3_000_000


def test_the_page_says_what_was_found(refused):
    plan, job = refused
    page = page_of(report_html(plan, job, pictures=False, files={"rods.csv": "ab" * 32}))
    words = words_of(page)
    assert "north <wall> & more" in words
    assert "✗ 2 of 10 leaves refused Not cut: leaves 2, 3." in words
    assert plan.direction_reason in words
    assert "2, 3 strain 0.0093 is above 0.008" in words
    assert "surface: wall.3dm" in words
    assert "/nowhere" not in words
    rows = {words_of(r[0]): [words_of(c) for c in r] for r in page.iter(f"{XHTML}tr") if len(r) == 8}
    strain = rows["Strain on the whole rod"]
    assert strain[1:5] == ["✗ fail", "≤ 0.008", "0.0093", "−0.0013"]
    assert strain[6:] == ["leaf 2, block 1", "4"]
    assert rows["Greatest deviation from the surface"][1] == "✓ pass"
    pictures = {image.get("alt") for image in page.iter(f"{XHTML}img")}
    assert pictures == {f"{check.title}, over the wall" for check in plan.checks}
    assert page.findall(f".//{XHTML}figure[@class='wide']") == []


def test_verdicts(make_plan):
    plan, _ = make_plan(rows=1, columns=1, leaves=3)
    ok = CheckResult("a", "A", "", 1.0, "max", np.array([0.1, 0.2, np.nan]))
    over = CheckResult("b", "B", "", 1.0, "max", np.array([0.1, 2.0, 0.3]))
    remark = dataclasses.replace(over, title="Soft one", hard=False)
    assert verdict(with_checks(plan, ok)) == (True, "Can be cut", "All 3 leaves (3 rods) keep every hard limit.")
    good, head, more = verdict(with_checks(plan, ok, remark))
    assert (good, head) == (True, "Can be cut")
    assert more.endswith("Worth a look: Soft one (1 rod).")
    assert verdict(with_checks(plan, over))[:2] == (False, "A limit is broken")
    assert verdict(dataclasses.replace(plan, rods=()))[:2] == (False, "There is nothing to cut")


def test_the_same_plan_gives_the_same_page(refused, tmp_path):
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, *refused)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_leaves_alike_share_a_line_and_what_is_common_is_said_once(make_plan):
    plan, _ = make_plan(rows=1, columns=1, leaves=4)

    def rod(leaf, repair=(), reasons=None):
        status = "ok" if reasons is None else "refused"
        return dataclasses.replace(plan.rods[0], leaf=leaf, repair=repair, reasons=reasons or (), status=status)

    rods = [rod(i, ("turned", f"moved by {i} µm")) for i in range(200, 200 + MOST_REPAIRED + 7)]
    rods += [rod(1, ("turned",)), rod(2, ("turned", "refitted")), rod(2, ("turned",)), rod(3, ("refitted", "turned"))]
    rods += [rod(4, reasons=("strain <1", "bow")), rod(4, ("refitted",), reasons=("strain <1", "bow"))]
    rods += [rod(5, reasons=("strain <1",)), rod(5, reasons=("bow",)), rod(9, reasons=())]
    plan = dataclasses.replace(plan, rods=tuple(rods))
    assert refused_rows(plan) == [["4, 5", "strain &lt;1<br />bow"], ["9", "no reason given"]]
    common, own = repairs(plan)
    assert common == ("turned",)
    assert own[2] == own[3] == ("refitted",)
    assert 1 not in own
    rows, hidden = repaired_rows(own)
    assert rows[:2] == [["2, 3", "refitted"], ["200", "moved by 200 µm"]]
    assert (len(rows), hidden) == (MOST_REPAIRED, 8)
    single = dataclasses.replace(plan, rods=(rod(1, ("turned",)),))
    assert repairs(single) == ((), {1: ("turned",)})


def test_a_check_without_a_limit_is_reported_and_its_map_is_relative(make_plan):
    plan, job = make_plan(rows=1, columns=1, leaves=4)
    force = CheckResult("f", "Force", "N", math.inf, "max", np.array([1.0, 4.0, 2.0, np.nan]), hard=False)
    page = page_of(report_html(with_checks(plan, force), job, pictures=False, files={}))
    row = next([words_of(c) for c in r] for r in page.iter(f"{XHTML}tr") if "Force" in words_of(r))
    assert row == ["Force", "reported", "none", "4.00 N", "–", "", "leaf 2, block 1", "0"]
    assert "Force (darkest: 4.00 N)" in words_of(page)
    data = base64.b64decode(check_map(plan, wall_order(plan), force).split(",")[1])
    pixels = np.rint(255.0 * matplotlib.image.imread(io.BytesIO(data), format="png")).astype(int)
    column = pixels[:: pixels.shape[0] // 4, 0][::-1].tolist()
    assert column == [list(ramp_colours(np.array(v))) for v in (0.25, 1.0, 0.5, np.nan)]
    assert critical_rod(with_checks(plan, force))[0] in range(4)


def test_infinite_margins_are_shown_and_mapped(make_plan):
    plan, job = make_plan(rows=1, columns=1, leaves=4)
    some = CheckResult("s", "Some", "mm", 2.0, "min", np.array([np.nan, np.inf, 4.0, np.inf]))
    every = CheckResult("e", "Every", "mm", 2.0, "min", np.array([np.nan, np.inf, np.inf, np.inf]))
    stuck = CheckResult("b", "Stuck", "", 3.0, "max", np.array([np.nan, np.inf, np.inf, np.nan]), hard=False)
    assert [worst_rod(c) for c in (some, every, stuck)] == [2, 1, 1]
    plan = with_checks(plan, some, every, stuck)
    page = page_of(report_html(plan, job, pictures=False, files={}))
    rows = {words_of(r[0]): [words_of(c) for c in r][1:] for r in page.iter(f"{XHTML}tr")}
    assert rows["Some"] == ["✓ pass", "≥ 2 mm", "4.00 mm", "2.00 mm", "", "leaf 3, block 1", "0"]
    assert rows["Every"] == ["✓ pass", "≥ 2 mm", "∞", "∞", "", "leaf 2, block 1", "0"]
    assert rows["Stuck"] == ["! remark", "≤ 3", "∞", "−∞", "", "leaf 2, block 1", "2"]
    data = base64.b64decode(check_map(plan, wall_order(plan), every).split(",")[1])
    pixels = np.rint(255.0 * matplotlib.image.imread(io.BytesIO(data), format="png")).astype(int)
    column = pixels[:: pixels.shape[0] // 4, 0][::-1].tolist()
    assert column == [list(ramp_colours(np.array(v))) for v in (np.nan, 0.0, 0.0, 0.0)]
    assert cut_lines(plan, Path("out"))[2].split() == [
        "pass",
        "Every",
        "worst",
        "∞",
        "≥",
        "2",
        "mm",
        "leaf",
        "2,",
        "block",
        "1",
    ]
    summary = cut_summary(plan, Path("out"))["checks"][1]
    assert (summary["leaf"], summary["worst"], summary["rods_beyond"]) == (2, None, 0)
    json.dumps(summary, allow_nan=False)


MEASURE = """<script>
const violations = []; document.addEventListener("securitypolicyviolation", e => violations.push(e.blockedURI));
addEventListener("load", () => { const out = document.createElement("pre"); out.id = "measured";
  out.textContent = JSON.stringify({ violations,
    images: [...document.images].map(i => [i.alt, i.naturalWidth, i.complete]),
    width: document.documentElement.scrollWidth, room: innerWidth,
    columns: [...document.querySelectorAll("table")].map(t => [t.getBoundingClientRect().right,
      t.parentElement.getBoundingClientRect().right]),
    ink: getComputedStyle(document.querySelector("h1")).fontSize });
  document.body.append(out); });
</script>"""
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def test_a_real_browser_shows_all_of_it(refused, tmp_path):
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("no chromium on this machine")
    text = report_html(*refused, pictures=True, files={"rods.csv": "ab" * 32})
    guarded = text.replace("<head>", f'<head><meta http-equiv="Content-Security-Policy" content="{POLICY}" />{MEASURE}')
    (tmp_path / "report.html").write_text(guarded, encoding="utf-8")
    flags = "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-sync"
    done = subprocess.run(
        [browser, *flags.split(), f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1200,900",
         "--virtual-time-budget=4000", "--dump-dom", (tmp_path / "report.html").as_uri()],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    measured = json.loads(html.unescape(re.search(r'<pre id="measured">(.*?)</pre>', done.stdout, re.DOTALL).group(1)))
    assert measured["violations"] == []
    assert len(measured["images"]) == 4 + 5
    assert all(width > 0 and complete for _, width, complete in measured["images"]), measured["images"]
    assert measured["width"] <= measured["room"], "the page scrolls sideways at 1200 px"
    assert all(right <= room + 0.5 for right, room in measured["columns"]), "a table is wider than its column"
    assert measured["ink"] == "30px", "the style did not arrive"
