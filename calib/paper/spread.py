"""A true covariance of the paper's answer: errors of points, joints, anchors and robot through its iteration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, OnTargetLinearised
from calib.paper.scp import PaperResult, pairs
from calib.pose import closed_forms
from geometry import Pose
from jig_cad import Jig

Array = NDArray[np.float64]

_STEP_MM = 1e-4  # of the numeric derivative of the closed form


@dataclass(frozen=True, eq=False)
class PaperSpread:
    """Covariances (6, 6) of ξ: ``noise`` of points, joints and anchors; ``robot`` of its table.

    chi2_per_dof: of the residuals by noise alone; explained: with the robot's errors; dof: their degrees of freedom.
    """

    noise: Array
    robot: Array
    chi2_per_dof: float
    explained: float
    dof: int


def paper_spread(bundle: Bundle, result: PaperResult, own: Pose, derivative: Array) -> PaperSpread:
    """How far the errors of the measurements carry the answer, through C⁺.

    own: Ts_sensor_jig (F) by the closed form. derivative (F, 3, 10): of their origins by the points.
    """
    nominal = bundle.hands.pose(np.zeros(len(bundle.hands.sigma)))
    places = (nominal @ result.T_hand_sensor @ own)[_firsts(bundle)]
    lin = bundle.term.linearise(bundle.start(result.T_hand_sensor, places))
    to_origin = nominal.R @ result.T_hand_sensor.R @ derivative  # (F, 3, 10): from the points to x
    noise, anchors, robot = _origin_errors(bundle, lin, to_origin)
    first, other = pairs(bundle.location)
    difference = np.eye(len(own))[first] - np.eye(len(own))[other]  # (D, F)
    independent = np.einsum("af,fij,bf->aibj", difference, noise, difference).reshape(len(result.residual), -1)
    shared, dh = (np.tensordot(difference, g, 1).reshape(len(result.residual), -1) for g in (anchors, robot))
    stochastic = independent + shared @ shared.T
    gain = np.linalg.pinv(result.jacobian)[:6]
    dof = len(result.residual) - result.jacobian.shape[1]
    chi2, explained = (
        float(result.residual @ np.linalg.lstsq(c, result.residual, rcond=None)[0]) / max(dof, 1)
        for c in (stochastic, stochastic + dh @ dh.T)
    )
    return PaperSpread(gain @ stochastic @ gain.T, gain @ dh @ dh.T @ gain.T, chi2, explained, dof)


def closed_form_derivative(yz_mm: Array, jig: Jig, choice: NDArray[np.intp]) -> Array:
    """Change of the closed form's jig origin with the points (F, 3, 10).

    Differences to both sides, or to one side where a/l > 1 leaves the other undefined.
    """
    step = np.zeros((11, 5, 2))
    step[1:].reshape(10, 10)[np.arange(10), np.arange(10)] = _STEP_MM
    rows, columns = np.arange(len(yz_mm))[:, None], choice[:, None]

    def origins(sign: float) -> Array:
        forms = closed_forms(yz_mm[:, None] + sign * step, jig.side_mm, jig.height_mm)
        return np.asarray(forms.T_sensor_jig.t[rows, np.arange(11), columns])  # (F, 11, 3), the first without a step

    above, below = origins(1.0), origins(-1.0)
    sides = np.isfinite(above[:, 1:, :1]).astype(float) + np.isfinite(below[:, 1:, :1])
    middle = above[:, :1]
    up = np.where(np.isfinite(above[:, 1:]), above[:, 1:] - middle, 0.0)
    down = np.where(np.isfinite(below[:, 1:]), middle - below[:, 1:], 0.0)
    return np.asarray(np.swapaxes((up + down) / (np.maximum(sides, 1.0) * _STEP_MM), -1, -2))


def _firsts(bundle: Bundle) -> list[int]:
    return [int(np.flatnonzero(bundle.location == k)[0]) for k in range(len(bundle.locations))]


def _origin_errors(bundle: Bundle, lin: OnTargetLinearised, to_origin: Array) -> tuple[Array, Array, Array]:
    """Errors of x: covariance of its own noise (F, 3, 3), columns by anchors (F, 3, S) and robot (F, 3, P).

    An error of the hand's pose moves the points that are seen as well as the chain; both act on x as if the points were
    exact and the jig had moved, so that one covariance of the points carries it.
    """
    anchors = to_origin @ lin.jacobian["shape"] * bundle.target.shape.sigma
    robot = to_origin @ lin.jacobian["robot"] * bundle.hands.sigma
    return to_origin @ lin.covariance @ np.swapaxes(to_origin, -1, -2), anchors, robot
