"""Does a larger model predict better? Which SCP to enter with which of the robot's tables."""

from __future__ import annotations

from collections.abc import Mapping

from calib.config import Model

# benchmarks/calib_model_choice.py: how often each rule keeps the model that predicts better
_OVERFIT = 1.05  # a larger model must not predict worse than this times the smaller one
_WORTH = 0.95  # where the smaller one fits, it must predict better than this
UNCHECKED = (
    "fewer than two locations can be left out: how well points elsewhere are predicted could not be checked; measure "
    "the target at two or more further places"
)
ENTER = (
    "enter T_hand_sensor where the estimated table is used (robot_corrected), and T_hand_sensor_nominal where the "
    "controller keeps its nominal table"
)


def table_advice(scores: Mapping[Model, float | None], asked: Model, *, nominal_fits: bool = False) -> str:
    """Which SCP to enter with which of the robot's tables, and why.

    scores: rms [mm] at locations left out. nominal_fits: whether χ² finds no fault with the nominal robot.
    """
    small, large = scores.get("scp"), scores.get(asked)
    if small is None or large is None:
        return f"{UNCHECKED} ({ENTER})"
    words = (
        f"leaving one location out, its points are predicted to {small:.3f} mm with the robot's nominal table and "
        f"{large:.3f} mm with the estimated one"
    )
    if large > _OVERFIT * small or (nominal_fits and large > _WORTH * small):
        return f"{words}: the nominal table is as good; enter T_hand_sensor_nominal and leave the table as it is"
    return f"{words}: {ENTER}"
