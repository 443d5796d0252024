"""The paper's experiment again and again: Table 1 and Fig. 7 with spreads, and what each source of error explains.

Every run makes a cell as the paper describes it (Table 1's design and calibrated SCP, a jig of 0.1 mm tolerance at
three places, seven configurations each that differ in the last three joints), draws its errors anew, and calibrates by
the paper's method and the bundle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.synthetic.cell import (
    DESIGN,
    TRUTH,
    Layout,
    Noise,
    SyntheticCell,
    calibrated,
    default_sensor,
    industrial_arm,
    made_cell,
    observe,
    random_cell,
)
from geometry import DhRobot, NoAnswerError, Pose, Role, Sensor, assumed_compliance, field_of_view
from geometry.robot import Compliance
from jig_cad import Jig

Array = NDArray[np.float64]

PLACES: tuple[tuple[str, Role, int], ...] = (("A", "calibrate", 7), ("B", "calibrate", 7), ("C", "calibrate", 7))
LAST_JOINTS = 3  # that the paper's robot moved between the configurations of a place
_DEPTH_SHARE = 0.07  # of the stand-off, to either side of the field's middle
METHODS = {
    "paper": CalibConfig(method="paper"),
    "bundle scp": CalibConfig(model="scp"),
    "bundle full": CalibConfig(model="full"),
}
NONE = Noise(point_mm=0.0, joint_rad=0.0, robot=False, anchors=False)
ALL = Noise(compliance=Compliance())
SOURCES = {
    "all sources": ALL,
    "sensor alone": replace(NONE, point_mm=ALL.point_mm),
    "jig tolerance alone": replace(NONE, anchors=True),
    "joint noise alone": replace(NONE, joint_rad=ALL.joint_rad),
    "DH errors alone": replace(NONE, robot=True),
    "compliance alone": replace(NONE, compliance=Compliance()),
}


@dataclass(frozen=True, eq=False)
class EnsembleRow:
    """One method in one run: Fig. 7's largest deviation over the places [mm], the SCP, its error, and the σ it claimed.

    T_hand_sensor, error (6,) [mm, rad] and sigma (6,) are None where the method gave no answer.
    """

    source: str
    method: str
    design_mm: float
    solved_mm: float | None
    T_hand_sensor: Pose | None
    error: Array | None
    sigma: Array | None
    verdict: str


@dataclass(frozen=True, eq=False)
class PaperSetting:
    """Whose experiment is repeated.

    moving: how many of the last joints move between the configurations of a place, None for all. robot, jig, sensor:
    None for the defaults. design, truth: T_hand_sensor by the drawing and as mounted.
    """

    moving: int | None = LAST_JOINTS
    robot: DhRobot | None = None
    jig: Jig | None = None
    sensor: Sensor | None = None
    design: Pose = DESIGN
    truth: Pose = TRUTH

    @staticmethod
    def mounted(design: Pose) -> Pose:
        """T_hand_sensor as mounted, off its ``design`` by what Table 1 is."""
        return design @ DESIGN.inverse() @ TRUTH

    @property
    def seen_by(self) -> Sensor:
        """The sensor."""
        return self.sensor or default_sensor()

    @property
    def layout(self) -> Layout:
        """Where the jig stands to the sensor: about the middle of its field of view."""
        field = field_of_view(self.seen_by)
        plain = Layout(places=PLACES, moving=self.moving, field_mm=field)
        if self.sensor is not None:
            middle = float(np.mean([field[:, 1].min(), field[:, 1].max()]))
            near, far = middle * (1 - _DEPTH_SHARE), middle * (1 + _DEPTH_SHARE)
            plain = replace(plain, standoff_mm=(near, far))
        if self.robot is None:
            return plain
        share = _links_mm(self.robot) / _links_mm(industrial_arm())
        low, high = ((a * share, b * share) for a, b in (plain.radius_mm, plain.height_mm))
        return replace(plain, radius_mm=low, height_mm=high)


def _links_mm(robot: DhRobot) -> float:
    """All links of an arm in a row."""
    return float(np.sum(np.hypot(robot.a, robot.d)))


def paper_ensemble(
    rng: np.random.Generator,
    runs: int,
    sources: dict[str, Noise] | None = None,
    progress: Callable[[int, int], None] | None = None,
    setting: PaperSetting | None = None,
) -> tuple[EnsembleRow, ...]:
    """Rows of all runs, sources and methods; the same cells stand under every source."""
    sources, setting = SOURCES if sources is None else sources, setting or PaperSetting()
    rows: list[EnsembleRow] = []
    for run in range(runs):
        drawn = random_cell(rng, setting.layout, setting.jig, setting.robot, setting.truth)
        cell = replace(drawn, design=setting.design)
        for name, noise in sources.items():
            bends = noise.compliance is not None and setting.robot is not None
            drawn_noise = replace(noise, compliance=assumed_compliance(cell.robot)) if bends else noise
            rows += _run(cell, name, drawn_noise, rng, setting.seen_by)
        if progress:
            progress(run + 1, runs)
    return tuple(rows)


def largest_deviations(rows: tuple[EnsembleRow, ...], source: str, method: str) -> Array:
    """Fig. 7's largest deviation [mm] of every run that gave an answer; method "design" is the uncalibrated case."""
    if method == "design":
        return np.array([r.design_mm for r in rows if r.source == source and r.method == "paper"])
    return np.array(
        [r.solved_mm for r in rows if r.source == source and r.method == method and r.solved_mm is not None]
    )


def poses(rows: tuple[EnsembleRow, ...], method: str) -> list[Pose]:
    """T_hand_sensor of every run that gave an answer, under the first of the sources: all errors."""
    first = next(iter(SOURCES))
    return [r.T_hand_sensor for r in rows if r.source == first and r.method == method and r.T_hand_sensor is not None]


def _run(cell: SyntheticCell, source: str, noise: Noise, rng: np.random.Generator, sensor: Sensor) -> list[EnsembleRow]:
    made = made_cell(cell, rng, noise)
    # one error alone is judged as a user would who does not know that the points have none
    observed = replace(observe(cell, made, rng, noise, ALL.point_mm), sensor=sensor)
    out = []
    for method, config in METHODS.items():
        result = calibrated(observed, cell.jig, cell.robot, config)
        design = [p.max_deviation_mm.design for p in result.locations.values()]
        solved = [p.max_deviation_mm.solved for p in result.locations.values()]
        if any(d is None for d in design):
            raise NoAnswerError("a place of the ensemble has fewer than two frames with all strings")
        T, covariance = result.T_hand_sensor, result.covariance
        out.append(
            EnsembleRow(
                source,
                method,
                max(d for d in design if d is not None),
                None if any(s is None for s in solved) else max(s for s in solved if s is not None),
                T,
                None if T is None else (T.inverse() @ made.T_hand_sensor).log(),
                None if covariance is None else np.sqrt(np.diag(covariance)),
                result.verdict.code,
            )
        )
    return out
