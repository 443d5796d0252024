"""Where the sensor is: on the hand, or standing while the hand carries the target."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, overload

from geometry import Frame, Inverted, Robot

Mount = Literal["hand", "fixed"]

WORDS = (
    "the sensor stands and the hand carries the target: T_hand_sensor of this answer is T_base_sensor, T_base_jig is "
    "T_hand_jig, and axes called the hand's are the base's"
)


def seen_from(mount: Mount, frames: tuple[Frame, ...]) -> tuple[Frame, ...]:
    """The frames with given hand poses as T_hand_base, where the sensor is fixed."""
    if mount == "hand":
        return frames
    return tuple(
        replace(f, T_base_hand=None if f.T_base_hand is None else f.T_base_hand.inverse(), sensor_fixed=True)
        for f in frames
    )


@overload
def chain_of(mount: Mount, robot: Robot) -> Robot: ...
@overload
def chain_of(mount: Mount, robot: None) -> None: ...
@overload
def chain_of(mount: Mount, robot: Robot | None) -> Robot | None: ...
def chain_of(mount: Mount, robot: Robot | None) -> Robot | None:
    """The robot as the chain from the frame in which the target stands still to what carries the sensor."""
    return robot if mount == "hand" or robot is None else Inverted(robot)


def mount_words(mount: Mount) -> tuple[str, ...]:
    """What is said of an answer for a fixed sensor."""
    return (WORDS,) if mount == "fixed" else ()
