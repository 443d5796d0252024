"""The one least-squares engine: terms and named unknowns in, a result with its covariance out."""

from calib.engine.covariances import Covariance, covariance, deviance, evidence, exact_covariance, scaled_condition
from calib.engine.members import MembersResult, solve_members
from calib.engine.normal import (
    GroupNormals,
    Normal,
    considered_covariance,
    departure,
    group_normals,
    normal_step,
    reduced,
    reduced_gradient,
    scaled_solve,
    total_normal,
    whitener,
)
from calib.engine.simplex import lowest
from calib.engine.solve import Loss, Result, cauchy, solve, total_cost

__all__ = [
    "Covariance",
    "GroupNormals",
    "Loss",
    "MembersResult",
    "Normal",
    "Result",
    "cauchy",
    "considered_covariance",
    "covariance",
    "departure",
    "deviance",
    "evidence",
    "exact_covariance",
    "group_normals",
    "lowest",
    "normal_step",
    "reduced",
    "reduced_gradient",
    "scaled_condition",
    "scaled_solve",
    "solve",
    "solve_members",
    "total_cost",
    "total_normal",
    "whitener",
]
