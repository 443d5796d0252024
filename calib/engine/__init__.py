"""The one least-squares engine: terms and named unknowns in, a result with its covariance out."""

from calib.engine.covariance import Covariance, covariance, deviance, scaled_condition
from calib.engine.normal import Normal, considered_covariance, group_normals, reduced, scaled_solve, total_normal
from calib.engine.solve import Loss, Result, cauchy, solve

__all__ = [
    "Covariance",
    "Loss",
    "Normal",
    "Result",
    "cauchy",
    "considered_covariance",
    "covariance",
    "deviance",
    "group_normals",
    "reduced",
    "scaled_condition",
    "scaled_solve",
    "solve",
    "total_normal",
]
