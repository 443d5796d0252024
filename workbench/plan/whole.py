"""Whether a sensor can see a jig whole, told before anyone moves a robot, and the size that it would see."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry import NoAnswerError, Sensor
from jig_cad import Jig
from workbench.plan.view_space import Tally, ViewLimits, ViewSpace

LOOKS, AT_A_TIME = 6000, 1500  # views drawn at most, and at a time
LEAST = 4  # of them that must show all strings: planning draws 40,000 and then has some 27 to choose from
SMALLEST = 0.05  # of the jig's size: below that none is looked for
COARSE = 0.85  # from one size that is tried to the next smaller one
HALVINGS = 4  # of the step between them: the size that fits is known to 1 %


@dataclass(frozen=True)
class Whole:
    """seen: how many of the views drawn show all strings, at the jig's own size. why: what stands against the others.

    side_mm, height_mm: the largest jig of the same shape that is seen whole often enough; None where there is none.
    """

    seen: int
    why: str
    side_mm: float | None
    height_mm: float | None

    @property
    def fits(self) -> bool:
        """Whether the jig itself is seen whole."""
        return self.seen >= LEAST

    def sentence(self, sensor: Sensor, jig: Jig) -> str:
        """What the user is told of a jig that does not fit."""
        named, size = (
            f' "{sensor.name}"' if sensor.name else "",
            f"side {jig.side_mm:g} mm, height {jig.height_mm:g} mm",
        )
        text = f"the sensor{named} can not see a jig of {size} whole ({self.why})"
        if self.side_mm is None or self.height_mm is None:
            return f"{text}, nor any smaller one: a ball or a plate needs less of the field of view"
        return f"{text}; one of side {self.side_mm:.0f} mm and height {self.height_mm:.0f} mm fits"


def seen_whole(sensor: Sensor, jig: Jig, limits: ViewLimits) -> Whole:
    """Look at the jig from within the limits, without an arm and without what might hide a string.

    The same jig gives the same answer: the views are drawn from a fixed state.
    """
    seen, why = _count(sensor, jig, limits)
    if seen >= LEAST:
        return Whole(seen, why, jig.side_mm, jig.height_mm)
    # neither is a very small one seen: its strings stand too near each other; the largest that fits is looked for
    high, low = 1.0, COARSE
    while not _fits(sensor, scaled(jig, low), limits):
        high, low = low, low * COARSE
        if low < SMALLEST:
            return Whole(seen, why, None, None)
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if _fits(sensor, scaled(jig, middle), limits) else (low, middle)
    return Whole(seen, why, low * jig.side_mm, low * jig.height_mm)


def scaled(jig: Jig, factor: float) -> Jig:
    """The jig at another size, its strings as thick, or as thin as that size allows."""
    pillar = jig.pillar and replace(
        jig.pillar, side_mm=factor * jig.pillar.side_mm, height_mm=factor * jig.pillar.height_mm
    )
    return replace(
        jig,
        anchors_mm=factor * jig.anchors_mm,
        drawn_mm=factor * jig.nominal_anchors_mm,
        string_diameter_mm=factor * jig.string_diameter_mm,
        tolerance_mm=factor * jig.tolerance_mm,
        pillar=pillar,
        symmetries=(),
    )


def _fits(sensor: Sensor, jig: Jig, limits: ViewLimits) -> bool:
    return _count(sensor, jig, limits)[0] >= LEAST


def _count(sensor: Sensor, jig: Jig, limits: ViewLimits) -> tuple[int, str]:
    """How many views show all strings, and why the others do not; no more are drawn than are needed."""
    tally, seen = Tally(), 0
    rng = np.random.default_rng(0)
    try:
        space = ViewSpace.of(sensor, jig, limits)
    except NoAnswerError as error:
        return 0, str(error)
    while tally.tried < LOOKS and seen < LEAST:
        tally.tried += AT_A_TIME
        seen += len(space.measurable(space.poses(space.draw(AT_A_TIME, rng)), tally))
    return seen, tally.text()
