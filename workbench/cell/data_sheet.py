"""A profile sensor from its maker's data sheet alone: what may be tried before it is bought."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry import InputError

NOISE_OF_PITCH = 0.25  # σ of a point over the lateral pitch: as real and path-traced profiles of matte parts scatter
FEWEST_POINTS, MOST_POINTS = 16, 100_000


@dataclass(frozen=True)
class DataSheet:
    """What makers publish of a line profiler [mm].

    clearance_mm: from the sensor's face to the nearest depth. range_mm: how deep it measures. near_mm, far_mm: width of
    the field there. points: of a profile. repeatability_mm: of z; makers average for it.
    """

    clearance_mm: float
    range_mm: float
    near_mm: float
    far_mm: float
    points: int
    repeatability_mm: float
    name: str = ""

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a sensor's."""
        for what in ("clearance_mm", "range_mm", "near_mm", "far_mm", "repeatability_mm"):
            value = getattr(self, what)
            if not 0 < value < 1e5:
                raise InputError(f"{what} = {value:g}: must be a positive number of millimetres")
        if self.far_mm < self.near_mm:
            raise InputError(
                f"far_mm = {self.far_mm:g} is less than near_mm = {self.near_mm:g}: the fan opens with depth"
            )
        if not FEWEST_POINTS <= self.points <= MOST_POINTS:
            raise InputError(f"points = {self.points}: must be {FEWEST_POINTS} … {MOST_POINTS}")


def data_sheet_text(sheet: DataSheet) -> str:
    """The sensor.toml of a profile sensor of which the data sheet alone is known."""
    near, far = sheet.near_mm / 2, sheet.far_mm / 2
    z0, z1 = sheet.clearance_mm, sheet.clearance_mm + sheet.range_mm
    pitch = sheet.far_mm / (sheet.points - 1)
    sigma = max(sheet.repeatability_mm, NOISE_OF_PITCH * pitch)
    # the fan's borders through both ends of the field meet where it opens, at the face or behind it
    slope = (far - near) / sheet.range_mm
    apex = min(0.0, z0 - near / slope) if slope > 0 else -10.0 * z1
    fan = 2 * float(np.rad2deg(np.arctan(far / (z1 - apex)))) + 1.0
    lines = [
        f"# {sheet.name or 'line profiler'}: from its maker's data sheet alone; what no maker publishes is assumed",
        "# {P}: laser plane x = 0, y lateral, z depth from the sensor's face, away from it",
        f'name = "{sheet.name or "line profiler by its data sheet"}"',
        "[profile]",
        'format = "auto"',
        f"field_of_view_mm = [[{-near:g}, {z0:g}], [{near:g}, {z0:g}], [{far:g}, {z1:g}], [{-far:g}, {z1:g}]]",
        f"pitch_mm = {pitch:.6g} # far width over {sheet.points} points",
        f"start_mm = {-far:g}",
        f"sigma_y_mm = {pitch / np.sqrt(12):.4g} # a point lies anywhere within its pitch",
        f"sigma_z_mm = {sigma:.4g} # of one profile: a quarter of the pitch, assumed, or the repeatability of "
        f"{sheet.repeatability_mm:g} mm, which makers average for",
        "[laser]",
        f"origin_mm = [0.0, 0.0, {apex:.4g}] # where the borders of the field meet, assumed",
        f"fan_deg = {fan:.4g}",
    ]
    return "\n".join(lines) + "\n"
