"""The map pixel → laser sheet as a look-up table: exact at the nodes, bicubic between, checked in every cell."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from extraction.sheet.rectify import image_to_sheet
from geometry import Sensor
from geometry.compiled import kernel

Array = NDArray[np.float64]

STEP_PX = 8.0  # between nodes: the cubic's error is ATOL_MM at most for lenses of usual bend; other cells are exact
ATOL_MM = 2e-5  # a cell whose checks are off by more answers by the exact inversion
_MARGIN = 2  # nodes beyond the image on each side, so that 4 × 4 nodes surround every pixel


@dataclass(frozen=True, eq=False)
class SheetTable:
    """Look-up table of `image_to_sheet` for one sensor.

    nodes_yz_mm: the map at the nodes (rows, columns, 2), node (i, j) at v = (i - 2)·step, u = (j - 2)·step.
    usable: cells that interpolate to ATOL_MM (rows - 1, columns - 1); the others are computed exactly.
    """

    sensor: Sensor
    nodes_yz_mm: Array
    usable: NDArray[np.bool_]

    @staticmethod
    def build(sensor: Sensor) -> SheetTable:
        """The table of ``sensor``: some 80,000 exact inversions for a megapixel."""
        camera = sensor.require_camera()
        u = STEP_PX * np.arange(-_MARGIN, np.ceil(camera.width_px / STEP_PX) + _MARGIN + 1)
        v = STEP_PX * np.arange(-_MARGIN, np.ceil(camera.height_px / STEP_PX) + _MARGIN + 1)
        nodes = _exact_grid(sensor, u, v)
        usable = np.zeros((len(v) - 1, len(u) - 1), dtype=bool)
        inner = (slice(1, -1), slice(1, -1))
        usable[inner] = True
        for du, dv in ((0.5, 0.5), (0.5, 0.0), (0.0, 0.5)):
            uc, vc = u[1:-2] + du * STEP_PX, v[1:-2] + dv * STEP_PX
            grid = np.stack(np.meshgrid(uc, vc), -1).reshape(-1, 2)
            read, _, known = _interpolate(nodes, np.ones_like(usable), grid, STEP_PX)
            error = np.abs(read - _exact_grid(sensor, uc, vc).reshape(-1, 2)).max(axis=1)
            usable[inner] &= (known & (error <= ATOL_MM)).reshape(len(vc), len(uc))
        return SheetTable(sensor, nodes, usable)

    def lookup(self, uv_px: Array) -> tuple[Array, Array]:
        """As `image_to_sheet`: (y, z) (N, 2) [mm] and d(yz)/d(uv) (N, 2, 2), to 1e-4 mm of it."""
        uv = np.ascontiguousarray(uv_px, dtype=float)
        yz, jacobian, known = _interpolate(self.nodes_yz_mm, self.usable, uv, STEP_PX)
        if not known.all():
            yz[~known], jacobian[~known] = image_to_sheet(self.sensor, uv[~known])
        return yz, jacobian


_TABLES: WeakKeyDictionary[Sensor, SheetTable] = WeakKeyDictionary()


def sheet_table(sensor: Sensor) -> SheetTable:
    """The look-up table of `image_to_sheet` for a sensor, built on first use and kept as long as that object lives.

    Parameters
    ----------
    sensor
        A sensor with a camera.

    Returns
    -------
    table
        Right to 2e-5 mm between its nodes, 8 px apart; cells that are not are answered by the exact inversion.
    """
    table = _TABLES.get(sensor)
    if table is None:
        table = _TABLES[sensor] = SheetTable.build(sensor)
    return table


def _exact_grid(sensor: Sensor, u: Array, v: Array) -> Array:
    grid = np.stack(np.meshgrid(u, v), -1)
    return image_to_sheet(sensor, grid.reshape(-1, 2))[0].reshape(grid.shape)


@kernel
def _weights(t: float) -> tuple[Array, Array]:
    """Lagrange's cubic through nodes -1, 0, 1, 2 at t: weights (4,) of the values and of the slope."""
    w, d = np.empty(4), np.empty(4)
    w[0] = -t * (t - 1) * (t - 2) / 6
    w[1] = (t + 1) * (t - 1) * (t - 2) / 2
    w[2] = -(t + 1) * t * (t - 2) / 2
    w[3] = (t + 1) * t * (t - 1) / 6
    d[0] = -(3 * t * t - 6 * t + 2) / 6
    d[1] = (3 * t * t - 4 * t - 1) / 2
    d[2] = -(3 * t * t - 2 * t - 2) / 2
    d[3] = (3 * t * t - 1) / 6
    return w, d


@kernel
def _interpolate(
    nodes: Array, usable: NDArray[np.bool_], uv: Array, step: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Bicubic values (N, 2), Jacobians (N, 2, 2) and whether the table knows each pixel (N,)."""
    n = len(uv)
    yz, jacobian, known = np.empty((n, 2)), np.empty((n, 2, 2)), np.zeros(n, dtype=np.bool_)
    rows, columns = usable.shape
    for i in range(n):
        x, y = uv[i, 0] / step + _MARGIN, uv[i, 1] / step + _MARGIN
        if not (1 <= x < columns - 1 and 1 <= y < rows - 1):  # also where NaN
            continue
        c, r = int(x), int(y)
        if not usable[r, c]:
            continue
        wx, dx = _weights(x - c)
        wy, dy = _weights(y - r)
        for k in range(2):
            value, by_u, by_v = 0.0, 0.0, 0.0
            for a in range(4):
                along, slope = 0.0, 0.0
                for b in range(4):
                    node = nodes[r - 1 + a, c - 1 + b, k]
                    along += wx[b] * node
                    slope += dx[b] * node
                value += wy[a] * along
                by_u += wy[a] * slope
                by_v += dy[a] * along
            yz[i, k], jacobian[i, k, 0], jacobian[i, k, 1] = value, by_u / step, by_v / step
        known[i] = not np.isnan(yz[i, 0])
    return yz, jacobian, known
