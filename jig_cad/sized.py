"""A string jig whose side, height and string diameter are uncertain, too, beside its anchors' places."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Prediction, Shape, SheetPoints, Symmetry
from jig_cad.crossing import predict_crossings
from jig_cad.jig import Jig

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SIZES = ("side_mm", "height_mm", "string_diameter_mm")


@dataclass(frozen=True, eq=False)
class SizedJig:
    """``jig`` with three more shape unknowns [mm]: what is to be added to its side (y and z), height (x) and strings.

    A string's diameter moves no anchor: it is a factor of how far the axis lies behind the lit surface that was seen.
    """

    jig: Jig

    @property
    def features(self) -> tuple[str, ...]:
        """The strings."""
        return self.jig.features

    @property
    def shape(self) -> Shape:
        """The jig's, and its sizes, which its file takes for exact."""
        shape = self.jig.shape
        return Shape((*shape.labels, *SIZES), np.concatenate([shape.sigma, np.zeros(len(SIZES))]))

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """The jig's."""
        return self.jig.symmetries

    @property
    def freedom(self) -> tuple[bool, ...]:
        """The jig's."""
        return self.jig.freedom

    @property
    def residuals_per_point(self) -> int:
        """The jig's."""
        return self.jig.residuals_per_point

    def predict(self, T_sensor_target: Pose, shape: Array, points: SheetPoints) -> Prediction:
        """See Target."""
        shifts, sizes = shape[: -len(SIZES)], shape[-len(SIZES) :]
        j = self.jig
        side, height = j.anchors_mm * [0, 1, 1] / j.side_mm, j.anchors_mm * [1, 0, 0] / j.height_mm
        anchors, motions = self._anchors(sizes[0], sizes[1]), np.stack([side, height])
        by_diameter = np.zeros_like(points.yz_mm) if points.offset_mm is None else points.offset_mm
        by_diameter = by_diameter / j.string_diameter_mm
        seen = replace(points, yz_mm=points.yz_mm - sizes[2] * by_diameter)
        found = predict_crossings(anchors, j.start_index, j.end_index, T_sensor_target, shifts, seen, motions)
        return replace(found, by_shape=np.concatenate([found.by_shape, by_diameter[..., None]], -1))

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """See Target."""
        return self.jig.offset(points_mm, feature)

    def _anchors(self, side_mm: float, height_mm: float) -> Array:
        across, along = 1 + side_mm / self.jig.side_mm, 1 + height_mm / self.jig.height_mm
        return np.asarray(self.jig.anchors_mm * np.array([along, across, across]))
