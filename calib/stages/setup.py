"""What a calibration is given and what it has come to, passed from stage to stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from calib.bundle import Evidence, Solution
from calib.config import CalibConfig
from calib.result import Estimate, Verdict
from geometry import Frame, Pose, Robot, Sensor, Target, target_at

CONTRADICTED = ("not_converged", "outliers", "rotation_too_small", "too_few_poses")  # what wrong files can end in


@dataclass(frozen=True, eq=False)
class Setup:
    """What calibrate was given beside the frames."""

    target: Target | Mapping[str, Target]
    robot: Robot | None
    sensor: Sensor
    design: Pose | None
    places: Mapping[str, Pose]
    config: CalibConfig
    evidence: tuple[Evidence, ...] = ()

    def with_config(self, **changes: object) -> Setup:
        """The same with some settings changed."""
        return replace(self, config=self.config.model_copy(update=changes))


@dataclass(frozen=True, eq=False)
class Solved:
    """The bundle's verdict with its answer; ``used``: the frames of the solution.

    contradicted: whether its data contradict one another, also where the verdict is on what the views leave open.
    """

    verdict: Verdict
    estimate: Estimate | None = None
    solution: Solution | None = None
    used: tuple[Frame, ...] = field(default=())
    contradicted: bool = False


@dataclass(frozen=True, eq=False)
class Prepared:
    """Labelled frames with axis points and the bundle's first answer; ``given``: the frames before labels."""

    setup: Setup
    given: tuple[Frame, ...]
    labelled: tuple[Frame, ...]
    solved: Solved


def by_target(
    target: Target | Mapping[str, Target],
    stage: Callable[..., tuple[Frame, ...]],
    *frames: tuple[Frame, ...],
) -> tuple[Frame, ...]:
    """What a stage (target, frames …) makes of the frames of every target, in their order."""
    if not isinstance(target, Mapping):
        return stage(target, *frames)
    done: dict[int, Frame] = {}
    for one in {id(t): t for t in target.values()}.values():
        own = [tuple(f for f in group if target_at(target, f.location) is one) for group in frames]
        if own[0]:
            done |= {f.number: f for f in stage(one, *own)}
    return tuple(done[f.number] for f in frames[0])


def one_or_more(target: Target | Mapping[str, Target], frames: Sequence[Frame]) -> Target | Mapping[str, Target]:
    """The one target that all locations of the frames have, else the targets by location."""
    kinds = {id(t): t for t in (target_at(target, f.location) for f in frames)}
    return next(iter(kinds.values())) if len(kinds) == 1 else target
