"""Two calibrations of one sensor: how far apart their SCPs are, against what their σ allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from calib import printed_sigmas
from geometry.special import chdtrc, ndtri
from workbench.files import SavedResult, SavedScp
from workbench.report.as_text import AXES

Array = NDArray[np.float64]
Code = Literal["same", "different", "other_sensor", "no_answer"]

LIMIT_SIGMA = 4.0  # of one number; of all six together the distance that is as rare


@dataclass(frozen=True, eq=False)
class Difference:
    """What the second SCP is against the first: first⁻¹ · second.

    code, text: the judgement. motion: its tangent (6,), sensor axes of the first [mm, rad]. covariance (6, 6): the sum
    of both. rotation_deg, translation_mm, with σ (3,): of the printed numbers. sigmas: the largest of these in its σ,
    or all six together as the σ of one number that are as rare. None where there is nothing to compare.
    """

    code: Code
    text: str
    motion: Array | None = None
    covariance: Array | None = None
    rotation_deg: Array | None = None
    translation_mm: Array | None = None
    sigma_rotation_deg: Array | None = None
    sigma_translation_mm: Array | None = None
    sigmas: float | None = None

    @property
    def distance_mm(self) -> float | None:
        """How far the sensor's origin moved."""
        return None if self.motion is None else float(np.linalg.norm(self.motion[:3]))

    @property
    def angle_deg(self) -> float | None:
        """By how much the sensor turned."""
        return None if self.motion is None else float(np.rad2deg(np.linalg.norm(self.motion[3:])))


def difference(
    first: SavedResult, second: SavedResult, max_mm: float | None = None, *, other_sensor: bool = False
) -> Difference:
    """Compare two results.

    Parameters
    ----------
    first, second
        As `read_result` gives them.
    max_mm
        A limit of one's own on the origin's motion, beside that of 4 σ.
    other_sensor
        Compare also where the two belong to different sensor.toml files, whose frames {P} may differ.

    Returns
    -------
    Difference

    """
    a, b, which = _comparable(first, second)
    if a.T_hand_sensor is None or b.T_hand_sensor is None:
        empty = first if a.T_hand_sensor is None else second
        return Difference("no_answer", f"{empty.path} holds no SCP (verdict {empty.verdict}): nothing can be compared")
    hashes = first.hashes.get("sensor"), second.hashes.get("sensor")
    if all(hashes) and hashes[0] != hashes[1] and not other_sensor:
        return Difference(
            "other_sensor",
            f"{first.path} and {second.path} belong to different sensor.toml files (SHA-256 {str(hashes[0])[:12]}… and "
            f"{str(hashes[1])[:12]}…): an SCP is that of its sensor.toml, and the two are not compared; calibrate one "
            "again with the other's file, or say --other-sensor",
        )
    known = "" if all(hashes) else "; which sensor.toml they belong to is not in both files"
    motion = (a.T_hand_sensor.inverse() @ b.T_hand_sensor).log()
    rotation = (b.T_hand_sensor.fixed_xyz_deg - a.T_hand_sensor.fixed_xyz_deg + 180.0) % 360.0 - 180.0
    translation = b.T_hand_sensor.t - a.T_hand_sensor.t
    covariance, sigmas, turn, shift = None, None, None, None
    if a.covariance is not None and b.covariance is not None:
        covariance = a.covariance + b.covariance
        turn, shift = printed_sigmas(a.T_hand_sensor, covariance)
        largest = max(np.max(np.abs(rotation) / turn), np.max(np.abs(translation) / shift))
        sigmas = max(float(largest), _in_sigmas(motion, covariance))
    length = float(np.linalg.norm(motion[:3]))
    code, words = _judged(sigmas, length, max_mm)
    text = f"{which}: {words}{known}"
    return Difference(code, text, motion, covariance, rotation, translation, turn, shift, sigmas)


def _comparable(first: SavedResult, second: SavedResult) -> tuple[SavedScp, SavedScp, str]:
    """The SCPs that go with one table: those with the nominal robot, where both have one and the models differ."""
    if first.model != second.model and first.nominal is not None and second.nominal is not None:
        return first.nominal, second.nominal, f"T_hand_sensor_nominal of models {first.model} and {second.model}"
    words = "" if first.model == second.model else f" of models {first.model} and {second.model}, whose tables differ"
    return first.solved, second.solved, f"T_hand_sensor{words}"


def _in_sigmas(motion: Array, covariance: Array) -> float:
    """How many σ of one number are as rare as this distance of six."""
    scale = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(scale, scale)
    z = motion / scale
    distance2 = float(z @ np.linalg.lstsq(correlation, z, rcond=1e-9)[0])
    return float(-ndtri(max(float(chdtrc(6, distance2)), 1e-300) / 2))


def _judged(sigmas: float | None, length_mm: float, max_mm: float | None) -> tuple[Code, str]:
    beyond = []
    if sigmas is not None and sigmas > LIMIT_SIGMA:
        beyond.append(f"{sigmas:.1f} σ exceed {LIMIT_SIGMA:g}")
    if max_mm is not None and length_mm > max_mm:
        beyond.append(f"{length_mm:.3f} mm exceed {max_mm:g}")
    if beyond:
        return "different", f"the two differ: {', '.join(beyond)}; something moved, or one of the σ is too small"
    if sigmas is None:
        return "same", f"the origins are {length_mm:.3f} mm apart; without a covariance in both no σ judges it"
    return "same", f"the two agree: {length_mm:.3f} mm, {sigmas:.1f} σ"


def difference_object(d: Difference) -> dict[str, Any]:
    """The object that ``compare --json`` prints."""
    return {
        "verdict": {"code": d.code, "text": d.text},
        "rotation_deg": d.rotation_deg,
        "translation_mm": d.translation_mm,
        "sigma_rotation_deg": d.sigma_rotation_deg,
        "sigma_translation_mm": d.sigma_translation_mm,
        "distance_mm": d.distance_mm,
        "angle_deg": d.angle_deg,
        "sigmas": d.sigmas,
        "covariance": d.covariance,
    }


def print_difference(console: Console, d: Difference) -> None:
    """The six numbers with σ, and the judgement."""
    if d.rotation_deg is not None and d.translation_mm is not None:
        table = Table("", "difference", "σ", title="second less first", title_justify="left")
        for what, unit, values, sigma in (
            ("rotation", "°", d.rotation_deg, d.sigma_rotation_deg),
            ("translation", "mm", d.translation_mm, d.sigma_translation_mm),
        ):
            for i, axis in enumerate(AXES):
                shown = "–" if sigma is None or not np.isfinite(sigma[i]) else f"{sigma[i]:.4f}"
                table.add_row(f"{what} {axis} \\[{unit}]", f"{np.round(values[i], 4) + 0.0:+.4f}", shown)
        console.print(table)
    console.print(f"verdict: {d.code}", markup=False)
    console.print(d.text, markup=False, soft_wrap=True)
