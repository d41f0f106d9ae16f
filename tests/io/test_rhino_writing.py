"""Writing a cut as .3dm: read back with rhino3dm, every geometry is valid, in its place and names what it is."""

from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from batten.curves.elastica import Elastica
from batten.errors import FormatError
from batten.fabrication.plan import CutPlan
from batten.io.rhino import read_surface, write_cut_3dm
from batten.surfaces.bspline_surface import BSplineSurface

WALL = Path(__file__).parents[2] / "examples" / "freeform-wall" / "freeform-surface.3dm"


@pytest.fixture(params=["x", "y"])
def plan(request: pytest.FixtureRequest, make_plan: object) -> CutPlan:
    return make_plan(2, 2, 3, refused=(2,), blade_axis=request.param)[0]  # type: ignore[operator]


def objects(path: Path, layer: str) -> list[object]:
    model = rhino3dm.File3dm.Read(str(path))
    names = [entry.FullPath for entry in model.Layers]
    return [o for o in model.Objects if names[o.Attributes.LayerIndex] == layer]


def texts(item: object) -> dict[str, str]:
    return dict(item.Attributes.GetUserStrings())  # type: ignore[attr-defined]


def xyz(p: object) -> np.ndarray:
    return np.array([p.X, p.Y, p.Z])  # type: ignore[attr-defined]


def test_everything_is_valid_on_its_layer_and_in_mm(plan: CutPlan, tmp_path: Path) -> None:
    path = tmp_path / "cut.3dm"
    write_cut_3dm(plan, path, read_surface(WALL, 300.0))
    model = rhino3dm.File3dm.Read(str(path))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    assert [layer.FullPath for layer in model.Layers] == ["surface", "blocks", "leaves", "rods", "frames"]
    assert all(o.Geometry.IsValid for o in model.Objects)
    counts = [len(objects(path, layer.FullPath)) for layer in model.Layers]
    assert counts == [1, 4, 12, 12, 24]
    assert [p.name for p in tmp_path.iterdir()] == ["cut.3dm"]
    for layer in ("leaves", "rods"):
        found = [(int(texts(o)["block"]), int(texts(o)["leaf"])) for o in objects(path, layer)]
        assert found == [(rod.block, rod.leaf) for rod in plan.rods]


def test_blocks_are_boxes_with_their_numbers(plan: CutPlan, tmp_path: Path) -> None:
    write_cut_3dm(plan, tmp_path / "cut.3dm")
    for item, block in zip(objects(tmp_path / "cut.3dm", "blocks"), plan.blocks):
        box = item.Geometry.GetBoundingBox()  # type: ignore[attr-defined]
        assert xyz(box.Min) == pytest.approx(block.corner_mm)
        assert xyz(box.Max) == pytest.approx(block.corner_mm + block.size_mm)
        assert item.Geometry.IsSolid  # type: ignore[attr-defined]
        assert texts(item) == {"block": str(block.number), "row": str(block.row), "column": str(block.column)}


def greatest_distance(curve: object, elastica: Elastica) -> float:
    """How far points of a curve given in the plane's coordinates lie from the elastica: nearest sample, then the normal."""
    s = np.linspace(0, elastica.length, 8001)
    samples, angles = elastica.point_at(s), elastica.angle_at(s)
    nearest = np.array([np.argmin(((samples - p) ** 2).sum(axis=1)) for p in curve])  # type: ignore[attr-defined]
    away = curve - samples[nearest]
    return float(np.abs(away[:, 1] * np.cos(angles[nearest]) - away[:, 0] * np.sin(angles[nearest])).max())


def test_rods_and_leaves_are_smooth_cubics_on_their_elastica(plan: CutPlan, tmp_path: Path) -> None:
    write_cut_3dm(plan, tmp_path / "cut.3dm")
    for layer in ("rods", "leaves"):
        for item, rod in zip(objects(tmp_path / "cut.3dm", layer), plan.rods):
            elastica = rod.rod if layer == "rods" else rod.piece
            curve = item.Geometry  # type: ignore[attr-defined]
            assert (curve.Degree, curve.IsRational) == (3, False)
            t = np.linspace(curve.Domain.T0, curve.Domain.T1, 150)
            points = np.array([xyz(curve.PointAt(k)) for k in t])
            assert np.abs(rod.plane.signed_distance(points)).max() < 1e-9
            assert greatest_distance(rod.plane.to_plane(points), elastica) < 0.01
            ends = rod.plane.to_world(elastica.point_at([0.0, elastica.length]))
            assert points[[0, -1]] == pytest.approx(ends, abs=1e-9)
            # At a joint two cubics meet with one derivative, so that Rhino sees a smooth curve.
            for knot in set(curve.Knots.ToList()[3:-3]):
                before, after = (xyz(curve.DerivativeAt(k, 1)[1]) for k in (knot - 1e-7, knot + 1e-7))
                assert np.abs(before - after).max() < 1e-5


def test_a_strongly_bent_rod_is_joined_from_many_pieces(make_plan: object, tmp_path: Path) -> None:
    plan = make_plan(1, 1, 1)[0]  # type: ignore[operator]
    (rod,) = plan.rods
    bent = Elastica((0.0, 0.0), 1.0, 0.02, (3e-5, -1e-4), 1000.0)
    object.__setattr__(rod, "rod", bent)
    write_cut_3dm(plan, tmp_path / "cut.3dm")
    curve = objects(tmp_path / "cut.3dm", "rods")[0].Geometry  # type: ignore[attr-defined]
    assert len(curve.Knots.ToList()) > 20
    t = np.linspace(curve.Domain.T0, curve.Domain.T1, 400)
    points = rod.plane.to_plane(np.array([xyz(curve.PointAt(k)) for k in t]))
    assert greatest_distance(points, bent) < 0.01
    assert greatest_distance(bent.point_at(np.linspace(0, 1000, 400)), bent) < 1e-4  # what the measure itself is worth


def test_frames_stand_at_the_grippers(plan: CutPlan, tmp_path: Path) -> None:
    write_cut_3dm(plan, tmp_path / "cut.3dm")
    frames = objects(tmp_path / "cut.3dm", "frames")
    for i, rod in enumerate(plan.rods):
        for side, frame in enumerate(rod.grippers()):
            item = frames[2 * i + side]
            curve = item.Geometry  # type: ignore[attr-defined]
            corners = np.array([xyz(curve.Point(k)) for k in range(curve.PointCount)])
            assert corners[[1, 3]] == pytest.approx(np.stack([frame.position_mm] * 2))
            along, across, normal = (corners[[0, 2, 4]] - corners[1]) / np.array([[60.0], [40.0], [20.0]])
            assert along == pytest.approx(frame.tangent)
            assert normal == pytest.approx(frame.normal)
            assert np.cross(along, across) == pytest.approx(normal, abs=1e-12)
            side_name = ("left", "right")[side]
            assert texts(item) == {"block": str(rod.block), "leaf": str(rod.leaf), "gripper": side_name}
            assert item.Attributes.Name == f"block {rod.block} leaf {rod.leaf} {side_name}"  # type: ignore[attr-defined]


def test_rods_say_what_became_of_them(plan: CutPlan, tmp_path: Path) -> None:
    write_cut_3dm(plan, tmp_path / "cut.3dm")
    for item, rod in zip(objects(tmp_path / "cut.3dm", "rods"), plan.rods):
        found = texts(item)
        assert found["status"] == rod.status
        assert float(found["length_mm"]) == pytest.approx(rod.rod.length, abs=1e-5)
        assert found.get("reasons", "") == "; ".join(rod.reasons)
        assert found.get("repair", "") == "; ".join(rod.repair)
        orange = item.Attributes.ObjectColor[:3] == (230, 120, 0)  # type: ignore[attr-defined]
        assert orange == (rod.status == "refused")


@pytest.mark.parametrize("rational", [False, True])
def test_the_surface_makes_the_round_trip(make_plan: object, tmp_path: Path, rational: bool) -> None:
    wall = read_surface(WALL, 300.0)
    weights = np.random.default_rng(1).uniform(0.5, 2, (6, 6)) if rational else None
    surface = BSplineSurface(wall.knots_u, wall.knots_v, 3, 3, wall.control_points, weights)
    write_cut_3dm(make_plan(1, 1, 1)[0], tmp_path / "cut.3dm", surface)  # type: ignore[operator]
    back = read_surface(tmp_path / "cut.3dm", layer="surface")
    assert back.is_rational == rational
    assert np.array_equal(back.knots_u, surface.knots_u)
    assert back.control_points == pytest.approx(surface.control_points, abs=1e-10)
    if rational:
        assert np.array_equal(back.weights, surface.weights)


def test_nothing_is_left_of_a_file_that_cannot_be_written(make_plan: object, tmp_path: Path) -> None:
    plan = make_plan(1, 1, 1)[0]  # type: ignore[operator]
    with pytest.raises(OSError, match="cannot be written"):
        write_cut_3dm(plan, tmp_path / "missing" / "cut.3dm")
    (tmp_path / "cut.3dm").write_text("an earlier one")
    object.__setattr__(plan.blocks[0], "size_mm", np.array([600.0, np.nan, 600.0]))
    with pytest.raises(FormatError, match="block 1 is not valid"):
        write_cut_3dm(plan, tmp_path / "cut.3dm")
    assert [p.read_text() for p in tmp_path.iterdir()] == ["an earlier one"]
