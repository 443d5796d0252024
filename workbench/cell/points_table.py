"""The rows of extract's CSV: every spot, labelled where the jig explains it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry import Frame, Sensor, SurfacePoints
from geometry.sensor import calibration_covariance, stated_uncertainty


def rows(tables: Sequence[Frame], sensor: Sensor | None = None) -> list[dict[str, object]]:
    """Rows by column name, frame by frame: labelled points in the jig's order, then unlabelled spots by score.

    sensor: whose own uncertainty is told beside the points' random part, where its file states it.
    """
    out: list[dict[str, object]] = []
    for frame in tables:
        taken = {int(i) for i in frame.axis.spot}
        rest = [i for i in range(len(frame.points)) if i not in taken]
        mine = [_labelled(frame, i) for i in range(len(frame.axis))] + [_unlabelled(frame, i) for i in rest]
        if sensor is not None and stated_uncertainty(sensor) is not None:
            at = np.concatenate([frame.axis.yz_mm.reshape(-1, 2), frame.points.yz_mm.reshape(-1, 2)[rest]])
            own = calibration_covariance(sensor, at)
            mine = [row | _sensor_sigmas(c) for row, c in zip(mine, own if own is not None else (), strict=True)]
        out += mine
    return out


def _labelled(frame: Frame, i: int) -> dict[str, object]:
    axis, spot = frame.axis, int(frame.axis.spot[i])
    row: dict[str, object] = {"frame": frame.number, "label": axis.label[i]}
    row |= {"y_mm": float(axis.yz_mm[i, 0]), "z_mm": float(axis.yz_mm[i, 1])} | _sigmas(axis.cov_yz_mm2[i])
    flag = axis.flag[i] if i < len(axis.flag) else ""
    if spot < 0:
        return row | {"flag": flag}
    return row | _seen(frame.points, spot) | {"flag": flag or frame.points.flag[spot]}


def _unlabelled(frame: Frame, i: int) -> dict[str, object]:
    row: dict[str, object] = {"frame": frame.number, "label": "", "flag": frame.points.flag[i]}
    return row | _seen(frame.points, i) | _sigmas(frame.points.cov_yz_mm2[i])


def _seen(points: SurfacePoints, i: int) -> dict[str, object]:
    return {
        "u_px": float(points.uv_px[i, 0]),
        "v_px": float(points.uv_px[i, 1]),
        "y_surface_mm": float(points.yz_mm[i, 0]),
        "z_surface_mm": float(points.yz_mm[i, 1]),
        "score": float(points.score[i]),
    }


def _sigmas(covariance: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> dict[str, object]:
    return {
        "sigma_y_mm": float(np.sqrt(covariance[0, 0])),
        "sigma_z_mm": float(np.sqrt(covariance[1, 1])),
        "cov_yz_mm2": float(covariance[0, 1]),
    }


def _sensor_sigmas(covariance: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> dict[str, object]:
    return {
        "sigma_sensor_y_mm": float(np.sqrt(covariance[0, 0])),
        "sigma_sensor_z_mm": float(np.sqrt(covariance[1, 1])),
        "cov_sensor_yz_mm2": float(covariance[0, 1]),
    }
