"""batten: design, check and make things with the curves that a bent rod really takes.

The names below are imported when first used, so that `import batten` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_WHERE = {
    "BSplineCurve": "batten.curves.bspline",
    "Border": "batten.curves.cubic_proxy",
    "CubicBezier": "batten.curves.bezier",
    "CubicProxy": "batten.curves.cubic_proxy",
    "CubicSplineRod": "batten.solvers.cubic_spline_rod",
    "Curve": "batten.curves.base",
    "DesignLimits": "batten.splines.design_limits",
    "DesignSurface": "batten.surfaces.design_surface",
    "DiscreteRod": "batten.solvers.discrete_rod",
    "ElasticSplineDesign": "batten.splines.elastic_spline_design",
    "Elastica": "batten.curves.elastica",
    "Face": "batten.surfaces.face",
    "GeneratingCurve": "batten.splines.generating_curve",
    "KerfLaw": "batten.fabrication.kerf",
    "LogAestheticCurve": "batten.curves.log_aesthetic",
    "PiecewiseCurve": "batten.curves.piecewise",
    "Polyline": "batten.curves.polyline",
    "QuinticHermite": "batten.curves.quintic",
    "RodTracker": "batten.solvers.track",
    "Similarity": "batten.curves.similarity",
    "Spiral": "batten.curves.spiral",
    "analytic_description": "batten.splines.analytic_description",
    "analytic_descriptions": "batten.splines.analytic_description",
    "approximate": "batten.splines.approximate",
    "basic_length": "batten.measures.curvature_fit",
    "bending_energy": "batten.measures.bending_energy",
    "best_wire_direction": "batten.surfaces.hot_wire",
    "bezier_criteria": "batten.solvers.bezier_criteria",
    "compatible_beziers": "batten.curves.compatible_beziers",
    "constrained_spline": "batten.splines.constrained_spline",
    "curvature_residual": "batten.measures.curvature_residual",
    "elastic_foliation": "batten.surfaces.elastic_foliation",
    "elastic_spline": "batten.splines.elastic_spline",
    "elastica_distance_bound": "batten.measures.bound",
    "elastica_like": "batten.surfaces.design_surface",
    "euler_spiral": "batten.curves.spiral",
    "fit_elastica": "batten.solvers.elastica_fit",
    "fit_elastica_batch": "batten.solvers.elastica_fit",
    "good_region": "batten.solvers.good_region",
    "h1_distance": "batten.measures.distance",
    "hausdorff_distance": "batten.measures.distance",
    "initial_elastica": "batten.solvers.initial_guess",
    "interpolated_beziers": "batten.curves.compatible_beziers",
    "interpolating_spline": "batten.splines.interpolating_spline",
    "is_elastica_like": "batten.solvers.bezier_criteria",
    "isocurve_residuals": "batten.surfaces.isocurves",
    "l2_distance": "batten.measures.distance",
    "lambda_class": "batten.measures.lambda_class",
    "lambda_residual": "batten.measures.lambda_residual",
    "lambda_residual_gradient": "batten.measures.lambda_residual_gradient",
    "mesh_regions": "batten.surfaces.mesh_region",
    "minimum_closed_curve": "batten.splines.minimum_curve",
    "minimum_curve": "batten.splines.minimum_curve",
    "minimum_energy_curves": "batten.solvers.angle_constrained",
    "multipliers": "batten.measures.curvature_fit",
    "numerical_elastic_spline": "batten.splines.numerical_elastic_spline",
    "parallel_surface": "batten.surfaces.parallel",
    "project_bezier": "batten.solvers.bezier_projection",
    "project_path": "batten.solvers.path_projection",
    "projection_change": "batten.solvers.nearest_projection",
    "rectified": "batten.surfaces.design_surface",
    "scale_invariant_curves": "batten.solvers.angle_constrained",
    "scale_invariant_spline": "batten.splines.scale_invariant_spline",
    "snap_error": "batten.solvers.snap_error",
    "solve_boundary": "batten.solvers.boundary_value",
    "solve_boundary_batch": "batten.solvers.boundary_value",
    "stability": "batten.solvers.stability",
    "to_beziers": "batten.curves.to_beziers",
    "track_boundary": "batten.solvers.track",
    "wire_columns": "batten.surfaces.hot_wire",
}

if TYPE_CHECKING:
    from batten.curves.base import Curve as Curve
    from batten.curves.bezier import CubicBezier as CubicBezier
    from batten.curves.bspline import BSplineCurve as BSplineCurve
    from batten.curves.compatible_beziers import compatible_beziers as compatible_beziers
    from batten.curves.compatible_beziers import interpolated_beziers as interpolated_beziers
    from batten.curves.cubic_proxy import Border as Border
    from batten.curves.cubic_proxy import CubicProxy as CubicProxy
    from batten.curves.elastica import Elastica as Elastica
    from batten.curves.log_aesthetic import LogAestheticCurve as LogAestheticCurve
    from batten.curves.piecewise import PiecewiseCurve as PiecewiseCurve
    from batten.curves.polyline import Polyline as Polyline
    from batten.curves.quintic import QuinticHermite as QuinticHermite
    from batten.curves.similarity import Similarity as Similarity
    from batten.curves.spiral import Spiral as Spiral
    from batten.curves.spiral import euler_spiral as euler_spiral
    from batten.curves.to_beziers import to_beziers as to_beziers
    from batten.fabrication.kerf import KerfLaw as KerfLaw
    from batten.measures.bending_energy import bending_energy as bending_energy
    from batten.measures.bound import elastica_distance_bound as elastica_distance_bound
    from batten.measures.curvature_fit import basic_length as basic_length
    from batten.measures.curvature_fit import multipliers as multipliers
    from batten.measures.curvature_residual import curvature_residual as curvature_residual
    from batten.measures.distance import h1_distance as h1_distance
    from batten.measures.distance import hausdorff_distance as hausdorff_distance
    from batten.measures.distance import l2_distance as l2_distance
    from batten.measures.lambda_class import lambda_class as lambda_class
    from batten.measures.lambda_residual import lambda_residual as lambda_residual
    from batten.measures.lambda_residual_gradient import lambda_residual_gradient as lambda_residual_gradient
    from batten.solvers.angle_constrained import minimum_energy_curves as minimum_energy_curves
    from batten.solvers.angle_constrained import scale_invariant_curves as scale_invariant_curves
    from batten.solvers.bezier_criteria import bezier_criteria as bezier_criteria
    from batten.solvers.bezier_criteria import is_elastica_like as is_elastica_like
    from batten.solvers.bezier_projection import project_bezier as project_bezier
    from batten.solvers.boundary_value import solve_boundary as solve_boundary
    from batten.solvers.boundary_value import solve_boundary_batch as solve_boundary_batch
    from batten.solvers.cubic_spline_rod import CubicSplineRod as CubicSplineRod
    from batten.solvers.discrete_rod import DiscreteRod as DiscreteRod
    from batten.solvers.elastica_fit import fit_elastica as fit_elastica
    from batten.solvers.elastica_fit import fit_elastica_batch as fit_elastica_batch
    from batten.solvers.good_region import good_region as good_region
    from batten.solvers.initial_guess import initial_elastica as initial_elastica
    from batten.solvers.nearest_projection import projection_change as projection_change
    from batten.solvers.path_projection import project_path as project_path
    from batten.solvers.snap_error import snap_error as snap_error
    from batten.solvers.stability import stability as stability
    from batten.solvers.track import RodTracker as RodTracker
    from batten.solvers.track import track_boundary as track_boundary
    from batten.splines.analytic_description import analytic_description as analytic_description
    from batten.splines.analytic_description import analytic_descriptions as analytic_descriptions
    from batten.splines.approximate import approximate as approximate
    from batten.splines.constrained_spline import constrained_spline as constrained_spline
    from batten.splines.design_limits import DesignLimits as DesignLimits
    from batten.splines.elastic_spline import elastic_spline as elastic_spline
    from batten.splines.elastic_spline_design import ElasticSplineDesign as ElasticSplineDesign
    from batten.splines.generating_curve import GeneratingCurve as GeneratingCurve
    from batten.splines.interpolating_spline import interpolating_spline as interpolating_spline
    from batten.splines.minimum_curve import minimum_closed_curve as minimum_closed_curve
    from batten.splines.minimum_curve import minimum_curve as minimum_curve
    from batten.splines.numerical_elastic_spline import numerical_elastic_spline as numerical_elastic_spline
    from batten.splines.scale_invariant_spline import scale_invariant_spline as scale_invariant_spline
    from batten.surfaces.design_surface import DesignSurface as DesignSurface
    from batten.surfaces.design_surface import elastica_like as elastica_like
    from batten.surfaces.design_surface import rectified as rectified
    from batten.surfaces.elastic_foliation import elastic_foliation as elastic_foliation
    from batten.surfaces.face import Face as Face
    from batten.surfaces.hot_wire import best_wire_direction as best_wire_direction
    from batten.surfaces.hot_wire import wire_columns as wire_columns
    from batten.surfaces.isocurves import isocurve_residuals as isocurve_residuals
    from batten.surfaces.mesh_region import mesh_regions as mesh_regions
    from batten.surfaces.parallel import parallel_surface as parallel_surface

__all__ = [*_WHERE, "__version__"]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'batten' has no attribute {name!r}")
    value = getattr(import_module(_WHERE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
