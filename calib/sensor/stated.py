"""The uncertainty that is stated: of the parameters by name, and of the points that are measured with them.

Where the parameters that agree with the views lie on a curve, no one covariance tells both. What the numbers may be off
by are second moments, the curve's sag in them. Points hardly notice the sag, for along the curve one number makes up
for another: their σ, by derivatives at the answer, are those of straight ways that move the points as the curve does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.sensor.sheet_frame import SheetFrame, camera_rows, plane_deviations, sheet_deviations
from calib.sensor.tilts import PossibleTilts
from geometry import Camera, Sensor, Sheet
from geometry.sensor import CAMERA_PARAMETERS, SensorDeviation, SensorUncertainty

Array = NDArray[np.float64]

PLANE_NAMES = ("plane_tilt_y_rad", "plane_tilt_z_rad", "plane_shift_mm")
PIXELS = 60  # of all stripes, by which the ways of points are told: a lens is smooth
_EXACT = 0.02  # of a point's σ where the tilt is held, to which the straight way follows the curve


@dataclass(frozen=True, eq=False)
class Answer:
    """What uncertainty is stated of: camera (18,), pixels from the image's centre, plane, {P}, and the image's size."""

    camera: Array
    plane: Array
    frame: SheetFrame
    size_px: tuple[int, int]

    @property
    def sensor(self) -> Sensor:
        """As it measures."""
        fx, fy, cx, cy, *lens = self.camera.tolist()
        width, height = self.size_px
        middle = (width - 1) / 2, (height - 1) / 2
        pose = self.frame.T_sensor_camera
        camera = Camera(width, height, fx, fy, cx + middle[0], cy + middle[1], pose, tuple(lens))
        return Sensor(Sheet(np.zeros(3), 1.0), camera)


def tangent_uncertainty(answer: Answer, terms: tuple[str, ...], covariance: Array) -> SensorUncertainty:
    """By the covariance (21, 21) of camera and plane at the answer."""
    rows = camera_rows(terms)
    by = np.zeros((len(rows) + 3, len(covariance)))
    by[np.arange(len(rows)), list(rows)] = 1.0
    by[len(rows) :, -3:] = sheet_deviations(answer.frame, answer.plane)
    return SensorUncertainty(_names(rows), _symmetric(by @ covariance @ by.T), "calibrated")


def uncertainty_of_tilts(
    answer: Answer, terms: tuple[str, ...], tilts: PossibleTilts, yz_mm: Array
) -> SensorUncertainty:
    """By second moments about the answer over all tilts.

    Parameters
    ----------
    answer
        What is stated.
    terms
        Of the lens, those of the tilt among them.
    tilts
        With weights.
    yz_mm : ndarray (N, 2)
        Points of the laser plane as the answer measures them.
    """
    names = _names(camera_rows(terms))
    off, own = parts_by_name(answer, terms, tilts)
    covariance = _moments(tilts.weight, off, own)
    deviation = SensorDeviation(answer.sensor, names)
    straight = _straight(
        deviation,
        yz_mm[:: -(-len(yz_mm) // PIXELS)],
        off,
        _moments(tilts.weight, 0 * off, own),
        np.sqrt(np.diag(covariance)),
    )
    return SensorUncertainty(names, covariance, "calibrated", _moments(tilts.weight, straight, own))


def with_scale(uncertainty: SensorUncertainty, plane_mm: float, sigma_scale: float) -> SensorUncertainty:
    """The same where all lengths may be off by a share, as the board's are: the plane at ``plane_mm`` is, then."""
    more = np.zeros_like(uncertainty.covariance)
    i = uncertainty.parameters.index(PLANE_NAMES[-1])
    more[i, i] = (plane_mm * sigma_scale) ** 2
    tangent = uncertainty.tangent_covariance
    return replace(
        uncertainty,
        covariance=uncertainty.covariance + more,
        tangent_covariance=None if tangent is None else tangent + more,
    )


def parts_by_name(answer: Answer, terms: tuple[str, ...], tilts: PossibleTilts) -> tuple[Array, Array]:
    """What every tilt (K,) makes of the parameters: changes (K, P) from the answer, and covariance (K, P, P) there."""
    rows = camera_rows(terms)
    count = len(rows) + len(PLANE_NAMES)
    off, own = np.zeros((len(tilts.weight), count)), np.zeros((len(tilts.weight), count, count))
    for k, (camera, plane) in enumerate(zip(tilts.camera, tilts.plane, strict=True)):
        by = np.zeros((count, len(camera) + 3))
        by[np.arange(len(rows)), list(rows)] = 1.0
        off[k, : len(rows)] = (camera - answer.camera)[list(rows)]
        off[k, len(rows) :], by[len(rows) :, -3:] = plane_deviations(answer.frame, plane)
        own[k] = by @ tilts.covariance[k] @ by.T
    return off, own


def _straight(deviation: SensorDeviation, yz_mm: Array, off: Array, held: Array, sigma: Array) -> Array:
    """Changes (K, P) by which points move, to first order, as they do by the changes ``off`` (K, P).

    The plane's stay, and the others are as near as can be in units of their sigma (P,); held (P, P) is the covariance
    with the tilt held.
    """
    motions = deviation.motions(yz_mm).reshape(-1, len(deviation.names))
    apart = np.stack([(deviation.seen(yz_mm, o).yz_mm - yz_mm).reshape(-1) - motions @ o for o in off], -1)
    unit = float(np.sqrt(np.mean(np.sum((motions @ held) * motions, axis=1)))) * _EXACT
    lens = [i for i, name in enumerate(deviation.names) if name not in PLANE_NAMES]
    by = motions[:, lens] * sigma[lens] / unit
    more = np.linalg.solve(by.T @ by + np.eye(len(lens)), by.T @ apart / unit)
    out = off.copy()
    out[:, lens] += (sigma[lens, None] * more).T
    return out


def _moments(weight: Array, off: Array, own: Array) -> Array:
    return _symmetric((off.T * weight) @ off + np.einsum("k,kij->ij", weight, own))


def _symmetric(covariance: Array) -> Array:
    return np.asarray((covariance + covariance.T) / 2)


def _names(rows: tuple[int, ...]) -> tuple[str, ...]:
    return (*(CAMERA_PARAMETERS[i] for i in rows), *PLANE_NAMES)
