"""The sensor's own errors as unknowns of the bundle: independent parts of unit σ, by what its file says of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry import Sensor
from geometry.sensor import SensorDeviation, SensorUncertainty, SheetSeen, stated_uncertainty

Array = NDArray[np.float64]

UNSTATED = "drawing"  # how little is known of a sensor whose file is silent, where its errors are to be estimated


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Independent errors (K,), by name, and the parameters (P, K) of the deviation that a unit of each moves.

    sigma (K,): 1 for what the file states, 0 for what it takes for exact. complete: whether all that could be wrong is
    among them.
    """

    deviation: SensorDeviation
    labels: tuple[str, ...]
    basis: Array
    sigma: Array
    complete: bool = False
    _last: dict[str, tuple[bytes, Array, object]] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(sensor: Sensor | None, estimated: bool) -> SensorErrors | None:
        """What is not known of a sensor; None where its file takes itself for exact and nothing is to be estimated."""
        if sensor is None:
            return None
        known = stated_uncertainty(sensor)
        if sensor.uncertainty is None and estimated:
            camera = sensor.camera
            known = SensorUncertainty.by_source(UNSTATED, None if camera is None else (camera.fx_px, camera.fy_px))
        if known is None:
            return None
        labels, basis = known.independent()
        return SensorErrors(SensorDeviation(sensor, known.parameters), labels, basis, np.ones(len(labels)))

    @staticmethod
    def suspected(sensor: Sensor, stated: SensorErrors | None) -> SensorErrors:
        """The errors ``stated``, and those that the file takes for exact with σ 0; a unit of these is a drawing's σ."""
        camera = sensor.camera
        usual = SensorUncertainty.by_source(UNSTATED, None if camera is None else (camera.fx_px, camera.fy_px))
        if stated is None:
            labels, basis = usual.independent()
            return SensorErrors(
                SensorDeviation(sensor, usual.parameters), labels, basis, np.zeros(len(labels)), complete=True
            )
        known = stated.deviation.names
        rest = [i for i, name in enumerate(usual.parameters) if name not in known]
        names = (*known, *(usual.parameters[i] for i in rest))
        more = SensorUncertainty(names[len(known) :], usual.covariance[np.ix_(rest, rest)]).independent()
        basis = np.zeros((len(names), len(stated.labels) + len(more[0])))
        basis[: len(known), : len(stated.labels)] = stated.basis
        basis[len(known) :, len(stated.labels) :] = more[1]
        sigma = np.concatenate([stated.sigma, np.zeros(len(more[0]))])
        return SensorErrors(SensorDeviation(sensor, names), (*stated.labels, *more[0]), basis, sigma, complete=True)

    def parameters(self, values: Array) -> dict[str, float]:
        """Corrections of the sensor's parameters by name, of errors (K,)."""
        return dict(zip(self.deviation.names, (self.basis @ values).tolist(), strict=True))

    def seen(self, yz_mm: Array, values: Array) -> SheetSeen:
        """The corrected plane and points."""
        return self._of("seen", yz_mm, values)  # type: ignore[return-value] # a SheetSeen is kept under "seen"

    def derivatives(self, yz_mm: Array, values: Array) -> tuple[Array, Array]:
        """By the errors: twists (6, K) of the plane's frame, and motions (..., 2, K) of the points in it."""
        return self._of("derivatives", yz_mm, values)  # type: ignore[return-value] # and two arrays there

    def _of(self, what: str, yz_mm: Array, values: Array) -> object:
        # most steps leave the sensor where it is, and its rays are dear
        key = values.tobytes()
        known = self._last.get(what)
        if known is None or known[0] != key or known[1] is not yz_mm:
            changes = self.basis @ values
            if what == "seen":
                found: object = self.deviation.seen(yz_mm, changes)
            else:
                twists, motions = self.deviation.derivatives(yz_mm, changes)
                found = twists @ self.basis, motions @ self.basis
            known = key, yz_mm, found  # the points are held: another array may come to lie where they did
            self._last[what] = known
        return known[2]
