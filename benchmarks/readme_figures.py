"""README's figures, made anew: each line that holds measured numbers, as a fresh run gives it.

Every line is a template that stands in README word for word but for its numbers, with how far a fresh run may be from
them: half a last digit where the same seed gives the same bytes, the scatter of so many draws where it does not.
tests/docs/test_readme_figures.py reads the numbers out of README and holds them against these, the long ones as slow
tests.
Run: python benchmarks/readme_figures.py [--long] [folder with recordings, default $PERCEPTRON_EMU_DATA]
prints the lines to be put into README; --long adds 2,000 calibrations of synthetic points, some 20 CPU-minutes.
"""

from __future__ import annotations

import os
import re
import runpy
import string
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib import CalibrationResult
from workbench import calibrate_cell
from workbench.cell import observe, solve
from workbench.emulate import paper_experiment, record
from workbench.files import Settings, read_cell

README = Path(__file__).resolve().parents[1] / "README.md"
CELL = "{design:.1f} | {nominal:.2f} | {solved:.2f} | {rms_nominal:.3f} / {rms:.3f} |"
RUNS = 2000


@dataclass(frozen=True)
class Line:
    """A line of README: its words, the spread of each number, and what makes them anew.

    spread: by field, how far a fresh run's number may be from README's beyond the rounding of what stands there.
    """

    template: str
    fresh: Callable[[], dict[str, float]]
    spread: dict[str, float]
    long: bool = False
    needs: Path | None = None

    def told(self, readme: str) -> dict[str, float] | None:
        """The numbers as README has them; None where the line is not there."""
        parts = string.Formatter().parse(self.template)
        pattern = "".join(re.escape(text) + (rf"(?P<{name}>[\d.,]+)" if name else "") for text, name, *_ in parts)
        found = re.search(pattern.replace(r"\ ", r"\s+"), readme)
        return (
            None if found is None else {k: float(v.rstrip(".").replace(",", "")) for k, v in found.groupdict().items()}
        )

    def atol(self, name: str) -> float:
        """How far apart README's number and a fresh one may be: rounding and spread."""
        formats = {field: spec for _, field, spec, _ in string.Formatter().parse(self.template) if field}
        digits = int(re.sub(r"\D", "", formats[name]) or 0)
        return 0.5000001 * 10.0**-digits + self.spread.get(name, 0.0)

    def off(self, readme: str) -> list[str]:
        """What in README a fresh run contradicts, one sentence each."""
        told = self.told(readme)
        if told is None:
            return [f"README has no line like: {self.template}"]
        fresh = self.fresh()
        return [
            f"{self.template}: {name} is {told[name]}, a fresh run gives {value:.4f}"
            for name, value in fresh.items()
            if not abs(told[name] - value) <= self.atol(name)
        ]


def lines(data: Path | None) -> tuple[Line, ...]:
    """Every line of README with measured figures; the campaign's table is docs/accuracy.md's, and is made with it."""
    recorded = (data or Path("PERCEPTRON_EMU_DATA")) / "cell_a"
    return (
        Line("| `make demo`, verifying location | " + CELL, demo, {}),
        Line(
            "| path-traced recording that we did not render, verifying location | " + CELL,
            lambda: verifying(calibrate_cell(recorded).result),
            {},
            needs=recorded,
        ),
        Line(
            "{scp:.2f} and {full:.2f} over 2,000 calibrations of synthetic points",
            consistency,
            # the mean of so many of chi² with six degrees of freedom scatters by this (one σ); three of it
            dict.fromkeys(("scp", "full"), 3 * float(np.sqrt(12 / RUNS))),
            long=True,
        ),
    )


def demo() -> dict[str, float]:
    """The demo's experiment from its plan to its answer, without pictures and report."""
    experiment = paper_experiment(1)
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "demo"
        record(out, experiment.cell, experiment.true, experiment.configurations, 1, _quiet)
        cell = read_cell(out)
        settings = Settings()
        return verifying(solve(cell, observe(cell, settings.extraction, _quiet), settings.calib))


def verifying(result: CalibrationResult) -> dict[str, float]:
    """Fig. 7's figures at the place that had no part in the solution."""
    (place,) = (location for location in result.locations.values() if location.role == "verify")
    deviation, rms = place.max_deviation_mm, place.point_rms_mm
    asked = {
        "design": deviation.design,
        "nominal": deviation.nominal,
        "solved": deviation.solved,
        "rms_nominal": rms.nominal,
        "rms": rms.solved,
    }
    return {name: float("nan") if value is None else float(value) for name, value in asked.items()}


def consistency() -> dict[str, float]:
    """Mean NEES by model."""
    run = runpy.run_path(str(Path(__file__).with_name("calib_consistency.py")))["run"]
    found = run(RUNS, 1)
    return {name: float(np.mean(found[name][:, 0])) for name in ("scp", "full")}


def _quiet(_done: int, _total: int) -> None:
    return


def main() -> None:
    """Print the lines with fresh numbers, and what README says otherwise."""
    words = [a for a in sys.argv[1:] if a != "--long"]
    stated = words[0] if words else os.environ.get("PERCEPTRON_EMU_DATA")
    readme = README.read_text(encoding="utf-8")
    for line in lines(Path(stated) if stated else None):
        if line.needs is not None and not line.needs.is_dir():
            print(f"not made anew, {line.needs} is not here: {line.template}")
        elif not line.long or "--long" in sys.argv:
            fresh = line.fresh()
            print(line.template.format(**fresh))
            told = line.told(readme) or {}
            apart = [n for n, v in fresh.items() if not abs(told.get(n, np.nan) - v) <= line.atol(n)]
            if apart:
                print(f"  README says otherwise of {', '.join(apart)}: {told}")


if __name__ == "__main__":
    main()
