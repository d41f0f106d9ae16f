"""The JSON format of paths: both forms, what is kept, what is refused."""

import json

import numpy as np
import pytest

from batten.errors import FormatError
from batten.io.bezier_paths import JsonPaths

POINTS = [[0, 0], [0, 1], [1, 1.1], [1, 0], [1, -1], [0.3, -1], [0, 0]]


def read(tmp_path, document):
    file = tmp_path / "in.json"
    file.write_text(document if isinstance(document, str) else json.dumps(document))
    return JsonPaths(file)


def test_both_forms_are_read_and_written_as_they_came(tmp_path):
    cubics = [POINTS[:4], POINTS[3:]]
    document = {
        "unit": "mm",
        "paths": [
            {"name": "a", "points": POINTS, "closed": True, "colour": [1, 2]},
            {"control_points": cubics},
            {"points": POINTS},
        ],
    }
    drawing = read(tmp_path, document)
    assert [(p.name, p.closed) for p in drawing.paths] == [("a", True), ("path 2", False), ("path 3", False)]
    for path in drawing.paths:
        assert path.control_points.tolist() == cubics
    new = np.array(cubics) + 1.0 / 3.0
    drawing.write([new, new, drawing.paths[2].control_points], tmp_path / "out.json")
    written = json.loads((tmp_path / "out.json").read_text())
    assert written["unit"] == "mm"
    assert written["paths"][0]["colour"] == [1, 2]
    assert written["paths"][2] == document["paths"][2]
    assert "points" not in written["paths"][1]
    again = JsonPaths(tmp_path / "out.json")
    for path in again.paths[:2]:
        assert (path.control_points == new).all()  # bit by bit


@pytest.mark.parametrize(
    ("document", "says"),
    [
        ("{", "in.json: line 1"),
        ([], 'has no list "paths"'),
        ({"paths": 3}, 'has no list "paths"'),
        ({"paths": [3]}, r"paths\[0\]: is no object"),
        ({"paths": [{"points": POINTS}, {}]}, r"paths\[1\]: needs exactly one of points and control_points"),
        ({"paths": [{"points": POINTS[:6]}]}, r"paths\[0\].points: has shape \(6, 2\)"),
        ({"paths": [{"points": [[0, 0], [1]]}]}, r"paths\[0\].points: is no list of pairs"),
        ({"paths": [{"points": [[0, 0], [1, "x"]]}]}, r"paths\[0\].points: is no list of pairs"),
        ('{"paths": [{"points": [[0,0],[1,1],[2,2],[NaN,0]]}]}', "not finite"),
        ({"paths": [{"control_points": POINTS}]}, r"needed is \(n, 4, 2\)"),
        ({"paths": [{"points": POINTS, "closed": "no"}]}, r"paths\[0\].closed: is 'no'"),
        ({"paths": [{"points": POINTS[:4], "closed": True}]}, "the last point is not the first"),
    ],
)
def test_bad_files_name_the_field(tmp_path, document, says):
    with pytest.raises(FormatError, match=says):
        read(tmp_path, document)
