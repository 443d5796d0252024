"""The laser's stripe on matte plates, as a sensor's extraction finds it, against the plates themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction import StripeConfig, extract_profile
from geometry import Pose, Sensor, field_of_view
from geometry.sensor import project
from perceptron_emu import EmulatorConfig, Material, Scene, panel, render

Array = NDArray[np.float64]

PLATES = 12
TILT_DEG = 20.0  # along and across the sheet, at most
REFLECTANCE = 0.6  # with which a twin's power goes
HALF_LENGTH_MM = 25.0  # to either side of the sheet
OUTLIER_SIGMAS = 6.0  # a point farther off, by σ or by the median's scatter, is no point of the plate
STRIPE = (
    "stripe_points", "stripe_found_rate", "stripe_wrong_rate", "stripe_bias_mm", "stripe_scatter_mm",
    "stripe_sigma_ratio",
)  # fmt: skip


def stripe_figures(
    sensor: Sensor, config: EmulatorConfig, settings: StripeConfig, seed: int
) -> dict[str, float | None]:
    """Points of the stripe on tilted matte plates against the plates.

    stripe_found_rate: image columns (or rows) across the stripe that have a point, of those that the plate fills.
    stripe_wrong_rate: points that are not the plate's. bias and scatter: of the others, along the plate's normal in
    the laser plane, the scatter about each plate's own mean. sigma_ratio: claimed over empirical, 1 is honest.
    """
    rng = np.random.default_rng([seed, 2**28])
    fields = field_of_view(sensor)
    middle, (low, high) = fields.mean(axis=0), np.quantile(fields[:, 1], [0.25, 0.75])
    width = 2 * float(np.ptp(fields[:, 0]))
    errors: list[Array] = []
    pulls: list[Array] = []
    points, sections, wrong = 0, 0, 0
    for k in range(PLATES):
        along, across = np.deg2rad(rng.uniform(-TILT_DEG, TILT_DEG, 2))
        at = np.array([middle[0], rng.uniform(low, high)])
        pose = Pose.from_fixed_xyz_deg([np.rad2deg(along), np.rad2deg(across), 90.0], [0.0, *at])
        plate = panel(width, 2 * HALF_LENGTH_MM, pose, Material(REFLECTANCE))
        image = render(Scene(sensor, solids=(plate,)), config, np.random.default_rng([seed, 2**28, k])).image
        profile = extract_profile(image, sensor, settings)
        profile = profile[profile.peaks.flag == 0]
        normal = pose.R[1:, 2] / np.linalg.norm(pose.R[1:, 2])
        error = (profile.yz_mm - at) @ normal
        sigma = np.sqrt(np.einsum("i,nij,j->n", normal, profile.cov_yz_mm2, normal))
        typical = 1.4826 * float(np.median(np.abs(error))) if len(error) else 0.0
        good = np.abs(error) < OUTLIER_SIGMAS * np.maximum(sigma, typical)
        errors.append(error[good])
        pulls.append(error[good] / sigma[good])
        points, wrong = points + len(profile), wrong + int(np.sum(~good))
        sections += _sections(sensor, at, normal, width)
    if sum(len(e) for e in errors) < PLATES:
        return dict.fromkeys(STRIPE) | {"stripe_points": float(points)}
    means = [e.mean() for e in errors if len(e)]
    about = np.concatenate([e - e.mean() for e in errors if len(e)])
    return {
        "stripe_points": points,
        "stripe_found_rate": min(1.0, len(about) / max(sections, 1)),
        "stripe_wrong_rate": wrong / max(points, 1),
        "stripe_bias_mm": float(np.mean(means)),
        "stripe_scatter_mm": float(about.std()),
        "stripe_sigma_ratio": float(1 / np.sqrt(np.mean(np.concatenate(pulls) ** 2))),
    }


def _sections(sensor: Sensor, at: Array, normal: Array, width_mm: float) -> int:
    """Columns or rows of the image that the lit line through a point of the laser plane crosses."""
    camera, sheet = sensor.require_camera(), sensor.sheet
    yz = at + np.linspace(-width_mm / 2, width_mm / 2, 4001)[:, None] * np.array([-normal[1], normal[0]])
    from_laser = yz - sheet.origin_mm[1:]
    yz = yz[np.abs(np.arctan2(from_laser[:, 0], from_laser[:, 1])) <= sheet.fan_rad / 2]
    uv = project(camera, np.column_stack([np.zeros(len(yz)), yz]))
    uv = uv[np.all((uv > -0.5) & (uv < np.array([camera.width_px, camera.height_px]) - 0.5), axis=1)]
    return int(np.ptp(uv, axis=0).max()) + 1 if len(uv) else 0
