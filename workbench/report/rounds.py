"""A round of a watch: the answer so far, its σ, and where to go next."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console

from geometry import Frame, clean, quaternion_wxyz
from workbench.plan import Round
from workbench.report.as_text import print_verdict


def round_object(found: Round) -> dict[str, Any]:
    """The round for JSON, small enough for a line."""
    result = found.result
    pose = result.T_hand_sensor
    ahead = found.next_pose
    out: dict[str, Any] = clean(
        {
            "frames": len(found.cell.frames),
            "used": sum(f.used for f in result.frames),
            "verdict": {"code": result.verdict.code, "text": result.verdict.text},
            "rotation_deg": None if pose is None else pose.fixed_xyz_deg,
            "translation_mm": None if pose is None else pose.t,
            "sigma_rotation_deg": result.sigma_rotation_deg,
            "sigma_translation_mm": result.sigma_translation_mm,
            "sigma_at_300_mm": found.size_mm,
            "reached": found.reached,
            "held_text": found.held_text,
            "next": None if ahead is None else _pose(ahead.frame) | {"sigma_at_300_mm": ahead.size_mm},
            "next_text": found.next_text,
        }
    )
    return out


def _pose(frame: Frame) -> dict[str, Any]:
    out: dict[str, Any] = {"location": frame.location}
    if frame.joints_rad is not None:
        return out | {"joints_deg": np.rad2deg(frame.joints_rad)}
    hand = frame.T_base_hand
    if hand is None:
        return out
    return out | {"T_base_hand": hand.matrix, "xyz_mm": hand.t, "quaternion_wxyz": quaternion_wxyz(hand.R)}


def print_round(console: Console, found: Round) -> None:
    """The round in a few lines."""
    result, pose = found.result, found.result.T_hand_sensor
    used = sum(f.used for f in result.frames)
    console.print(f"{used} of {len(found.cell.frames)} frames used", soft_wrap=True)
    deg, mm = result.sigma_rotation_deg, result.sigma_translation_mm
    if pose is not None and deg is not None and mm is not None and found.size_mm is not None:
        angles = ", ".join(f"{a:.4f} ± {s:.4f}" for a, s in zip(pose.fixed_xyz_deg, deg, strict=True))
        lengths = ", ".join(f"{t:.3f} ± {s:.3f}" for t, s in zip(pose.t, mm, strict=True))
        console.print(f"rotation {angles} °, translation {lengths} mm; longest σ {found.size_mm:.3f} mm at 300 mm")
    print_verdict(console, result)
    if found.held_text:
        console.print(found.held_text, markup=False, soft_wrap=True)
    ahead = found.next_pose
    if ahead is not None:
        console.print(
            f"next: location {ahead.frame.location}, {_words(ahead.frame)}; it would leave {ahead.size_mm:.3f} mm",
            markup=False,
            soft_wrap=True,
        )
    elif found.next_text:
        console.print(f"next: {found.next_text}", markup=False, soft_wrap=True)


def _words(frame: Frame) -> str:
    if frame.joints_rad is not None:
        return "joints " + ", ".join(f"{v:.2f}" for v in np.rad2deg(frame.joints_rad)) + " °"
    hand = frame.T_base_hand
    if hand is None:
        return "anywhere"
    place = ", ".join(f"{v:.1f}" for v in hand.t)
    turn = ", ".join(f"{v:.2f}" for v in hand.fixed_xyz_deg)
    return f"hand at {place} mm, turned by {turn} ° about fixed X, Y, Z"
