"""The answer of a sensor's calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.sensor.choice import Tried
from calib.sensor.shape import FoundShape
from calib.sensor.sheet_frame import SheetFrame
from calib.sensor.tilts import PossibleTilts
from geometry import Pose
from geometry.sensor import SensorUncertainty

Array = NDArray[np.float64]

Code = Literal[
    "ok",
    "weak",
    "too_few_views",
    "boards_parallel",
    "plane_not_determined",
    "model_misfit",
    "outliers",
    "not_converged",
]
ANSWERED = ("ok", "weak", "model_misfit")


@dataclass(frozen=True)
class SensorVerdict:
    """Whether the answer can be trusted, and why not."""

    code: Code
    text: str

    @property
    def is_answer(self) -> bool:
        """Whether there is an answer with σ that hold."""
        return self.code in ANSWERED


@dataclass(frozen=True, eq=False)
class ViewResult:
    """What became of a view.

    Parameters
    ----------
    name : str
    used : bool
    reason : str or None
        Why it was left out.
    reprojection_rms_px, plane_rms_mm : float
        Of its corners, and of its stripe's points from the laser plane; NaN where there are none.
    left_out_px, left_out_mm : float
        The same, predicted by the other views.
    corners_px, errors_px : ndarray (N, 2)
        Where its corners were seen, and projected less seen.
    stripe_px : ndarray (M, 2)
        Where the stripe was seen.
    stripe_yz_mm, stripe_mm : ndarray (M, 2), (M,)
        Its points in {P}, and their distances from the plane.
    tilt_deg : float
        Between the board's normal and the optical axis.
    T_camera_board : Pose or None
        Of the bundle; the board's frame has z = 0 on it, its first corner as origin and x along its rows.
    """

    name: str
    used: bool
    reason: str | None
    reprojection_rms_px: float = float("nan")
    plane_rms_mm: float = float("nan")
    left_out_px: float = float("nan")
    left_out_mm: float = float("nan")
    corners_px: Array | None = None
    errors_px: Array | None = None
    stripe_px: Array | None = None
    stripe_yz_mm: Array | None = None
    stripe_mm: Array | None = None
    tilt_deg: float = float("nan")
    T_camera_board: Pose | None = None


@dataclass(frozen=True, eq=False)
class SensorSolution:
    """Camera and laser plane.

    Parameters
    ----------
    camera : ndarray (18,)
        CAMERA_PARAMETERS, pixels from the top-left pixel's centre.
    terms : tuple of str
        Which terms of the lens were estimated; the others are zero.
    plane_normal, plane_mm : ndarray (3,), float
        n · X = d in the camera's frame, d positive.
    frame : SheetFrame
        {P}.
    uncertainty : SensorUncertainty
        Of the camera's parameters and of the plane's turns and shift in {P}; also of a tilt that was not taken and is
        possible, which is zero in camera.
    boards : Pose
        T_camera_board of the views used.
    """

    camera: Array
    terms: tuple[str, ...]
    plane_normal: Array
    plane_mm: float
    frame: SheetFrame
    uncertainty: SensorUncertainty
    boards: Pose

    @property
    def distortion(self) -> tuple[float, ...]:
        """OpenCV's vector, as short as holds all terms."""
        k = self.camera[4:]
        last = int(np.max(np.flatnonzero(k), initial=-1)) + 1
        length = next(n for n in (0, 4, 5, 8, 12, 14) if n >= last)
        return tuple(float(v) for v in k[:length])


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """Everything that is known after a calibration; figures are NaN and the solution None where there is none."""

    verdict: SensorVerdict
    views: tuple[ViewResult, ...]
    solution: SensorSolution | None = None
    reprojection_rms_px: float = float("nan")
    plane_rms_mm: float = float("nan")
    left_out_px: float = float("nan")
    left_out_mm: float = float("nan")
    corner_scale: float = float("nan")
    stripe_scale: float = float("nan")
    offset_px: float = 0.0
    chi2_per_dof: float = float("nan")
    sigma_z_mm: tuple[float, float, float] | None = None
    depth_mm: tuple[float, float, float] | None = None
    tried: tuple[Tried, ...] = ()
    tilts: PossibleTilts | None = None
    shape: FoundShape | None = None
    notes: tuple[str, ...] = ()

    @property
    def untaken(self) -> PossibleTilts | None:
        """The tilts that an answer without one leaves possible; None where it holds one, or none is likely."""
        return None if self.tilts is None or self.tilts.taken else self.tilts

    @property
    def n_views(self) -> int:
        """Views that were used."""
        return sum(v.used for v in self.views)
