"""The answer of calibrate on a screen, as `print(result)` shows it."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from calib.result import CalibrationResult

WIDTH = 110
MOST_LOCATIONS, MOST_NOTES = 8, 3  # that fit on a screen beside the rest
VERDICT_LINES, NOTE_LINES = 4, 3


def summary(result: CalibrationResult) -> str:
    """Verdict, SCP with σ, figures by location, frames left out by reason, the first notes: at most 30 lines."""
    return "\n".join(line if len(line) <= WIDTH else f"{line[: WIDTH - 1]}…" for line in _lines(result))


def _wrapped(sentence: str, most_lines: int, indent: str) -> list[str]:
    return textwrap.wrap(sentence, WIDTH, subsequent_indent=indent, max_lines=most_lines, placeholder=" …")


def _lines(result: CalibrationResult) -> Iterator[str]:
    chi2 = "" if result.chi2_per_dof is None else f", χ² {result.chi2_per_dof:.2f} per degree of freedom"
    yield f"Calibration ({result.method}, {result.model}): {result.verdict.code}{chi2}"
    yield from _wrapped(result.verdict.text, VERDICT_LINES, "")
    pose, angles, lengths = result.T_hand_sensor, result.sigma_rotation_deg, result.sigma_translation_mm
    if pose is None:
        yield "T_hand_sensor: none that can be trusted"
    else:
        yield "T_hand_sensor"
        yield f"  rotation X Y Z [°]      {_numbers(pose.fixed_xyz_deg, angles)}"
        yield f"  translation X Y Z [mm]  {_numbers(pose.t, lengths)}"
    if result.locations:
        yield "  location          role       deviation [mm]  point rms [mm]"
    for name, location in list(result.locations.items())[:MOST_LOCATIONS]:
        deviation, rms = location.max_deviation_mm.solved, location.point_rms_mm.solved
        yield f"  {name[:16]:16s}  {location.role:9s}  {_figure(deviation):>14s}  {_figure(rms):>14s}"
    if len(result.locations) > MOST_LOCATIONS:
        yield f"  … and {len(result.locations) - MOST_LOCATIONS} further locations"
    used = sum(f.used for f in result.frames)
    reasons = Counter(f.reason for f in result.frames if f.reason)
    left = ", ".join(f"{n} {reason}" for reason, n in reasons.most_common())
    yield f"{used} of {len(result.frames)} frames used" + (f"; left out: {left}" if left else "")
    notes = (*result.notes, *result.weak_directions)
    for note in notes[:MOST_NOTES]:
        yield from _wrapped(f"note: {note}", NOTE_LINES, "      ")
    if len(notes) > MOST_NOTES:
        yield f"… and {len(notes) - MOST_NOTES} further notes in result.notes"


def _numbers(values: np.ndarray, sigmas: np.ndarray | None) -> str:
    if sigmas is None:
        return "   ".join(f"{v:z.4f}" for v in values)
    return "   ".join(f"{v:z.4f} ± {s:.4f}" for v, s in zip(values, sigmas, strict=True))


def _figure(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.3f}"
