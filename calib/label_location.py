"""Labels of all frames of one location, which share the jig's pose through the robot chain."""

from __future__ import annotations

from collections.abc import Sequence

from calib.config import CalibConfig
from calib.labelling import LabelledFrame
from geometry import Pose, SensorModel, SurfacePoints
from jig_cad import Jig


def label_location(
    frames: Sequence[SurfacePoints],
    Ts_base_hand: Pose,
    T_hand_sensor: Pose,
    jig: Jig,
    sensor: SensorModel,
    config: CalibConfig,
    T_base_jig: Pose | None = None,
    refined: bool = False,
) -> tuple[LabelledFrame, ...]:
    """Label the frames of one location, in the order given; the first labelled frame decides the half turn.

    Ts_base_hand: (N) by the robot. T_hand_sensor: by design, or solved: then set ``refined``, which narrows the gates.
    T_base_jig: where known (cell.toml, or solved before); it then decides the half turn.
    """
    raise NotImplementedError
