"""Calibration from the page: measured once for a recipe, solved for each choice of model and of locations' roles."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from calib import CalibrationResult, location_object
from geometry import InputError, clean, json_text
from workbench.cell import Observed, Value, judged, solve, verify_cell
from workbench.files import Cell, Recipe, SavedResult, Settings, saved_result
from workbench.opened import ImageSet

LEFT_OUT = "left out"
ROLES = ("calibrate", "verify", LEFT_OUT)
MAX_TEXT = 32 * 2**20  # of a result that is compared with


@dataclass(frozen=True, eq=False)
class NewestAnswer:
    """The newest answer and what it was made of."""

    cell: Cell
    observed: Observed
    result: CalibrationResult
    settings: Settings


@dataclass(eq=False)
class Calibrator:
    """Calibrates an opened dataset; one calibration at a time."""

    images: ImageSet
    last: NewestAnswer | None = None
    _measured: tuple[str, Observed] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, recipe: Recipe, roles: Mapping[str, str]) -> dict[str, Any]:
        """Measure where the recipe changed, solve, and give the page the answer."""
        from workbench.report import (
            calibration_object,
            scene_object,
            scp_rows,
        )  # the first picture must not wait for them

        cell = self.images.cell
        if cell is None:
            raise InputError("only a cell dataset can be calibrated")
        with self._lock:
            settings = Settings.of(recipe)
            chosen, observed = with_roles(cell, self._observe(recipe), roles)
            result = solve(chosen, observed, settings.calib)
            self.last = NewestAnswer(chosen, observed, result, settings)
            self.images.learn(result)
        answer: dict[str, Any] = clean(calibration_object(result, observed.complaints, chosen))
        return answer | {
            "scene": scene_object(chosen, result),
            "table": clean(scp_rows(result)),
            "targets": self.images.target_words,
            "remarks": list(result.remarks),
            "values": [v.__dict__ for v in _values(result, recipe)],
        }

    def _observe(self, recipe: Recipe) -> Observed:
        """What calibration itself is told changes nothing that is measured."""
        measuring = recipe.model_dump_json(exclude={"calib", "tolerances", "what", "measure", "gapflush"})
        if self._measured is None or self._measured[0] != measuring:
            self._measured = (measuring, self.images.observe(Settings.of(recipe)))
        return self._measured[1]

    def answered(self) -> NewestAnswer:
        """The newest answer; InputError where there is none."""
        if self.last is None:
            raise InputError("nothing has been calibrated yet")
        return self.last

    def report(self) -> str:
        """The report of the newest answer, one HTML page."""
        from workbench.report import ReportInput, cell_image, report_page  # they load the emulator

        last = self.answered()
        picture, _ = cell_image(last.cell, last.result)
        return report_page(ReportInput(last.cell, last.observed, last.result, last.settings, picture))

    def result_text(self) -> str:
        """The newest answer as `calibrate --json` prints it."""
        from workbench.report import calibration_object

        last = self.answered()
        return json_text(calibration_object(last.result, last.observed.complaints, last.cell)) + "\n"

    def compare(self, text: str, name: str) -> dict[str, Any]:
        """The difference of an earlier result and the newest answer."""
        from workbench.report import calibration_object, difference, difference_object

        last = self.answered()
        now = calibration_object(last.result, last.observed.complaints, last.cell)
        found: dict[str, Any] = clean(difference_object(difference(_saved(text, name), saved_result(Path("now"), now))))
        return found

    def verify(self, text: str | None, name: str, recipe: Recipe) -> dict[str, Any]:
        """The figures of another result's SCP, or of the design's, on this dataset; nothing is solved."""
        cell = self.images.cell
        if cell is None:
            raise InputError("only a cell dataset can be verified")
        with self._lock:
            observed = self._observe(recipe)
        saved = None if text is None else _saved(text, name)
        found = verify_cell(cell, observed, saved, recipe.calib)
        places = {n: location_object(p) for n, p in found.locations.items()}
        rms = found.largest_rms_mm
        answer: dict[str, Any] = clean({"locations": places, "largest_point_rms_mm": rms, "notes": list(found.notes)})
        return answer


def _saved(text: str, name: str) -> SavedResult:
    if len(text) > MAX_TEXT:
        raise InputError(f"{name}: is too long for a result of calibrate")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError(f"{name}: is no JSON of `perceptron-emu calibrate --json`") from None
    return saved_result(Path(name), data)


def with_roles(cell: Cell, observed: Observed, roles: Mapping[str, str]) -> tuple[Cell, Observed]:
    """The cell and its frames with other roles of locations; frames of those left out are gone."""
    known = {f.location for f in cell.frames}
    for name, role in roles.items():
        if name not in known:
            raise InputError(f"there is no location {name}")
        if role not in ROLES:
            raise InputError(f'{name}: the role "{role}" is none of {", ".join(ROLES)}')

    def of(frames: Any) -> tuple[Any, ...]:
        kept = [f for f in frames if roles.get(f.location) != LEFT_OUT]
        return tuple(replace(f, role=roles.get(f.location, f.role)) for f in kept)

    if not roles:
        return cell, observed
    given: dict[str, Any] = {n: r for n, r in roles.items() if r != LEFT_OUT}
    changed = replace(cell, frames=of(cell.frames), roles={**cell.roles, **given})
    return changed, replace(observed, frames=of(observed.frames))


def _values(result: CalibrationResult, recipe: Recipe) -> list[Value]:
    found = result.left_out
    rms = None if found is None or found.point_rms_mm is None else float(found.point_rms_mm)
    return judged([Value("left_out_rms_mm", "calibrate", rms, unit="mm", digits=3)], recipe.tolerances)


Search = Callable[[Recipe, int, Callable[[int, int, float], None]], dict[str, Any]]
