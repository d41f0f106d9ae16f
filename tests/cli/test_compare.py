"""`batten compare` on the example's own cut, with a scan of one block made from its surface."""

import json
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from batten.cli.main import main
from batten.io.cut_json import read_cut_json
from batten.io.job_surface import read_job_surface

TURN = Rotation.from_euler("xyz", [25.0, -14.0, 130.0], degrees=True).as_matrix()
SHIFT = np.array([350.0, -90.0, 1200.0])


@pytest.fixture(scope="module")
def scanned(real_cut, tmp_path_factory):
    """Scans of block 7 as PLY in m and, with 4 mm too much foam over its right half, as XYZ in mm; the points as cut."""
    stored = read_cut_json(real_cut.out / "cut.json")
    surface = read_job_surface(stored.job.surface)
    block = stored.plan.block(7)
    rng = np.random.default_rng(5)
    plan = block.corner_mm[:2] + rng.uniform(0.0, 1.0, (12_000, 2)) * block.size_mm[:2]
    d = surface.derivatives(plan[:, 0] / 300.0, plan[:, 1] / 300.0, 1)
    normal = np.cross(d[1, 0], d[0, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) * np.sign(normal[:, 2:])
    good = d[0, 0] + rng.normal(0.0, 0.3, (12_000, 1)) * normal
    fault = good + np.where(plan[:, :1] > block.corner_mm[0] + 300.0, 4.0, 0.0) * normal
    folder = tmp_path_factory.mktemp("scans")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 12000\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    (folder / "good.ply").write_bytes(head.encode() + ((good - SHIFT) @ TURN / 1000.0).astype("<f8").tobytes())
    np.savetxt(folder / "fault.xyz", fault)
    return folder, good


def test_a_good_block_is_found_and_passes(real_cut, scanned, tmp_path, capsys):
    folder, good = scanned
    out = tmp_path / "compared"
    words = ["compare", str(real_cut.out), str(folder / "good.ply"), "--units", "m", "--block", "7", "-o", str(out)]
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["good"] is True
    pose = np.array(said["pose"])
    back = ((good - SHIFT) @ TURN) @ pose[:3, :3].T + pose[:3, 3]
    assert np.linalg.norm(back - good, axis=1).max() < 0.5
    assert [b["block"] for b in said["blocks"]] == [7]
    assert said["whole"]["percentiles_mm"]["50"] == pytest.approx(0.3 * 0.6745, rel=0.05)
    assert json.loads((out / "compare.json").read_text(encoding="utf-8")) == said
    assert (out / "distances.png").read_bytes().startswith(b"\x89PNG")
    page = (out / "report.html").read_text(encoding="utf-8")
    images = [e.get("src") for e in ET.fromstring(page.split("\n", 1)[1]).iter() if e.tag.endswith("img")]
    assert len(images) == 2
    assert all(i.startswith("data:image/png;base64,") for i in images)
    assert main(words) == 0  # an earlier comparison is replaced
    assert "every scanned block has 95% of the points within 2.5 mm" in capsys.readouterr().out
    assert main(["compare", *words[1:-1], str(real_cut.out)]) == 2  # a cut is not
    assert (real_cut.out / "cut.json").is_file()


def test_too_much_foam_fails_its_block(real_cut, scanned, capsys):
    words = ["compare", str(real_cut.out), str(scanned[0] / "fault.xyz"), "--register", "none", "--json"]
    assert main(words) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["failing_blocks"] == [7]
    assert said["whole"]["mean_mm"] == pytest.approx(2.0, abs=0.1)
    assert said["whole"]["within"] == pytest.approx(0.5, abs=0.03)
    assert main([*words, "--tolerance", "6"]) == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--block", "99"], "blocks 1 to 25"),
        (["--units", "m"], "another unit"),
        (["--tolerance", "-1"], "above 0"),
        (["--share", "2"], "in (0, 1]"),
    ],
)
def test_bad_input_is_named(real_cut, scanned, words, message, capsys):
    assert main(["compare", str(real_cut.out), str(scanned[0] / "fault.xyz"), *words]) == 2
    assert message in capsys.readouterr().err
