"""The points of a frame's profile that lie on a ball, plate, edge or wedge, ready to be calibrated with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction import FEATURE_KINDS, Circle, FeatureConfig, Profile, TargetPoints, find_target_points
from geometry import AxisPoints, Frame, Sensor, Surface
from jig_cad import Balls, Sphere

Array = NDArray[np.float64]

_MOST_BULGING = 0.9  # share of the balls' frames that must bulge one way to say so
_FEWEST_FRAMES = 3
_STRETCH_SIGMAS = 5.0
_LEAST_STRETCH = 0.01  # share by which a pitch must be off to be worth a sentence: makers' calibrations are better
_BEND_SIGMAS = 5.0
_LEAST_BEND_MM = 0.05


@dataclass(frozen=True, eq=False)
class OnSurface:
    """A frame with its points on the target, and what was found in its profile. text: what is wrong or doubtful."""

    frame: Frame
    found: TargetPoints | None = None
    text: str = ""


def on_surface(
    frame: Frame, profile: Profile, target: Surface, sensor: Sensor, config: FeatureConfig | None = None
) -> OnSurface:
    """A frame's points on a surface.

    Parameters
    ----------
    frame
        As of frames.csv.
    profile
        What the sensor saw, in {P}.
    target
        A ball, balls, a plane, an edge or a wedge; of any other surface all points are taken.
    sensor
        Its field of view tells a plate's end from its own.
    config
        How the target is found; None: the defaults.

    Returns
    -------
    OnSurface
        With reason "no_profile" or "no_target" where nothing can be used.

    """
    if target.kind not in FEATURE_KINDS:
        n = len(profile)
        axis = AxisPoints(target.features[:1] * n, np.full(n, -1), profile.yz_mm, profile.cov_yz_mm2, ("",) * n)
        return OnSurface(replace(frame, axis=axis, n_points=n))
    found = find_target_points(
        profile,
        target.kind,
        _diameters(target),
        field_of_view_mm=field_of_view_of(sensor) if target.kind == "edge" else None,
        towards_sensor=sensor.profile is not None and sensor.profile.z_towards_sensor,
        config=config,
    )
    ready = replace(frame, n_points=found.n_points, reason=found.reason)
    if found.reason is not None:
        return OnSurface(ready, found, found.text)
    if target.kind == "edge" and found.rivals:
        known = field_of_view_of(sensor) is not None
        text = found.text if known else f"{found.text}: state [profile] field_of_view_mm in sensor.toml"
        return OnSurface(replace(ready, reason="no_target"), found, text)
    names = (
        target.features
    )  # of several balls told later which: sections have names, and they are the balls' in any order
    labels = tuple(names[min(int(k), len(names) - 1)] for k in found.feature)
    n = len(found)
    axis = AxisPoints(labels, np.full(n, -1), found.yz_mm, found.cov_yz_mm2, ("",) * n)
    return OnSurface(replace(ready, axis=axis), found, found.text)


def _diameters(target: Surface) -> tuple[float | None, ...]:
    if isinstance(target, Sphere):
        return (target.diameter_mm if target.known else None,)
    return tuple(target.diameters_mm.tolist()) if isinstance(target, Balls) else (None,)


def field_of_view_of(sensor: Sensor) -> Array | None:
    """Polygon (N, 2) of (y, z) in {P} [mm] that a sensor measures in; None where it is not known."""
    if sensor.profile is not None:
        return sensor.profile.field_of_view_mm
    from geometry import field_of_view

    return field_of_view(sensor)


def dataset_remarks(found: Iterable[TargetPoints], sensor: Sensor) -> tuple[str, ...]:
    """What all frames together say of the sensor's file and the target: z's sign, the pitch, a bent plate."""
    seen = [f for f in found if f.reason is None]
    return tuple(text for text in (_turned(seen, sensor), _stretched(seen), _bent(seen)) if text)


def _turned(seen: Sequence[TargetPoints], sensor: Sensor) -> str:
    ways = [f.bulges_towards_z for f in seen if f.bulges_towards_z]
    towards = sensor.profile is not None and sensor.profile.z_towards_sensor
    wrong = -1 if towards else 1
    if sensor.profile is None or len(ways) < _FEWEST_FRAMES or ways.count(wrong) < _MOST_BULGING * len(ways):
        return ""
    which = "smaller" if towards else "larger"
    return (
        f"the ball bulges towards {which} z in {ways.count(wrong)} of {len(ways)} frames: the maker counts z "
        f"{'away from' if towards else 'towards'} the sensor, which z_towards_sensor = {str(not towards).lower()} in "
        "sensor.toml says; no number changes by it, but scp_initial and the result are in the maker's frame"
    )


def stretch_of_arc(yz_mm: Array) -> tuple[float, float]:
    """By what factor y must be multiplied to make an arc a circle's, and σ of it: z² + k y² + a y + b z + c = 0."""
    p = yz_mm - yz_mm.mean(axis=0)
    p = p / float(np.sqrt(np.mean(np.sum(p**2, axis=1))))
    y, z = p.T
    rows = np.column_stack([y**2, y, z, np.ones_like(y)])
    solution, _, rank, _ = np.linalg.lstsq(rows, -(z**2), rcond=1e-10)
    if rank < 4 or solution[0] <= 0:
        return 1.0, float("inf")
    left = z**2 + rows @ solution
    variance = float(left @ left) / max(len(y) - 4, 1) * float(np.linalg.inv(rows.T @ rows)[0, 0])
    k = float(np.sqrt(solution[0]))
    return k, float(np.sqrt(variance)) / (2 * k)


def _stretched(seen: Sequence[TargetPoints]) -> str:
    """The pitch, where the balls' sections are ellipses: the median of the frames, their scatter as its σ."""
    arcs = [f.yz_mm for f in seen if len(f.curves) == 1 and isinstance(f.curves[0], Circle) and len(f) >= 20]
    if len(arcs) < _FEWEST_FRAMES:
        return ""
    each = np.array([stretch_of_arc(yz)[0] for yz in arcs])
    factor = float(np.median(each))
    sigma = 1.4826 * float(np.median(np.abs(each - factor))) * 1.2533 / np.sqrt(len(each))
    if abs(factor - 1) < max(_STRETCH_SIGMAS * sigma, _LEAST_STRETCH):
        return ""
    return (
        f"the ball's sections are ellipses: y must be {factor:.3f} ± {sigma:.3f} times what it is for circles: "
        "check pitch_mm in sensor.toml, or the maker's lateral scale"
    )


def _bent(seen: Sequence[TargetPoints]) -> str:
    bends = [(f.bend_mm, f.sigma_bend_mm) for f in seen if f.kind in ("plane", "edge") and np.isfinite(f.bend_mm)]
    worse = [b for b, s in bends if abs(b) > max(_BEND_SIGMAS * s, _LEAST_BEND_MM)]
    if len(worse) < max(_FEWEST_FRAMES, 0.2 * len(bends)):
        return ""
    worst = max(worse, key=abs)
    return (
        f"the plate is not flat: in {len(worse)} of {len(bends)} frames the middle of its profile stands off the line "
        f"through its ends, by up to {abs(worst):.2f} mm; such a plate turns the SCP"
    )
