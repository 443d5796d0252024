"""The paper's experiment again and again: Table 1 and Fig. 7 with spreads, and what each source of error explains.

Every run makes a cell as the paper describes it (Table 1's design and calibrated SCP, a jig of 0.1 mm tolerance at
three places, seven configurations each), draws its errors anew, and calibrates by the paper's method and the bundle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.synthetic.cell import Layout, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from geometry import NoAnswerError, Pose
from geometry.robot import Compliance

Array = NDArray[np.float64]

PLACES = Layout(places=(("A", "calibrate", 7), ("B", "calibrate", 7), ("C", "calibrate", 7)))
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


def paper_ensemble(
    rng: np.random.Generator,
    runs: int,
    sources: dict[str, Noise] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[EnsembleRow, ...]:
    """Rows of all runs, sources and methods; the same cells stand under every source."""
    sources = SOURCES if sources is None else sources
    rows: list[EnsembleRow] = []
    for run in range(runs):
        cell = random_cell(rng, PLACES)
        for name, noise in sources.items():
            rows += _run(cell, name, noise, rng)
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


def _run(cell: SyntheticCell, source: str, noise: Noise, rng: np.random.Generator) -> list[EnsembleRow]:
    made = made_cell(cell, rng, noise)
    observed = observe(cell, made, rng, noise)
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
