"""Does a method find the SCP again from exact points? The paper's iteration and the bundle on one random cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import chain_start, solve_robust
from calib.engine import scaled_condition as bundle_condition
from calib.paper import PaperProblem, differences, scaled_condition, solve_paper
from calib.pose import closed_forms
from calib.synthetic.cell import DESIGN
from calib.synthetic.problem import exact_pose_problem
from jig_cad import Jig

Array = NDArray[np.float64]

MAX_CONDITION = 1e3
EXACT_MM = 1e-6  # disagreement of the closed form's two heights below which a sign candidate explains the points


@dataclass(frozen=True, eq=False)
class Recovery:
    """Errors ξ (6,) [mm, rad] of the SCP by the paper's iteration and by the bundle; whether both converged.

    condition: the larger scaled condition number of the two problems at the solution.
    """

    paper: Array
    bundle: Array
    converged: bool
    condition: float

    @property
    def sound(self) -> bool:
        """Whether the cell is not degenerate."""
        return self.condition < MAX_CONDITION


def recover(rng: np.random.Generator, jig: Jig) -> Recovery:
    """Solve a random cell's exact points from the design SCP, jig poses by the closed form with all its candidates."""
    bundle, truth, Ts_sensor_jig = exact_pose_problem(rng, jig)
    forms = closed_forms(bundle.term.points.yz_mm, jig.side_mm, jig.height_mm)
    exact = forms.h1_disagreement_mm < EXACT_MM
    candidates = [forms.T_sensor_jig[i][np.flatnonzero(e)] for i, e in enumerate(exact)]
    start, own = chain_start(bundle, DESIGN, candidates)
    first = solve_paper(PaperProblem(own.t, bundle.hands, bundle.location), DESIGN)
    second = solve_robust(bundle, start).result
    at_truth, _ = differences(PaperProblem(Ts_sensor_jig.t, bundle.hands, bundle.location), truth, np.zeros(0))
    return Recovery(
        (first.T_hand_sensor.inverse() @ truth).log(),
        (second.state.pose("scp").inverse() @ truth).log(),
        first.converged and second.converged,
        max(scaled_condition(at_truth), bundle_condition(second, "scp")),
    )
