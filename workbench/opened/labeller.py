"""Names for the spots of one image of an opened folder, better ones once its robot chain is solved."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from calib import CalibConfig
from calib.label import LabelledFrame, label_frame
from geometry import InputError, Pose, Sensor, SurfacePoints
from jig_cad import Jig


@dataclass(eq=False)
class Labeller:
    """Names spots where ``jig`` is known; safe to use from several threads.

    guesses: T_sensor_jig by image index, from the solved robot chain; ``epoch`` counts their changes.
    """

    sensor: Sensor
    jig: Jig | None
    calib: CalibConfig = field(default_factory=CalibConfig)
    epoch: int = 0
    _guesses: dict[int, Pose] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def strings(self) -> tuple[str, ...]:
        """Names of the jig's strings; empty where no jig is known: nothing is labelled then."""
        return self.jig.strings if self.jig is not None else ()

    def label(self, index: int, points: SurfacePoints) -> LabelledFrame:
        """Names of the spots of image ``index`` by the jig's geometry, with the chain's guess where there is one."""
        if self.jig is None:
            raise InputError("labels need a jig: give --jig FILE")
        with self._lock:
            guess = self._guesses.get(index)
        return label_frame(points, self.jig, self.sensor, guess, self.calib)

    def learn(self, guesses: dict[int, Pose]) -> None:
        """Take the poses of a solved chain."""
        with self._lock:
            self._guesses = guesses
            self.epoch += 1
