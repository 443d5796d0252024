"""What a recording may hold beside images and truth.json: truth by the pixel, and the frames with the laser off."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from perceptron_emu import EmulatorConfig, RenderedFrame, RenderedTruth, Scene, render
from workbench.files import TruthPoint, write_png, write_text

Array = NDArray[np.float64]
Renderer = Literal["own", "pyrender"]

CURVE_COLUMNS = ("surface", "y1_mm", "z1_mm", "y2_mm", "z2_mm", "u1_px", "v1_px", "u2_px", "v2_px", "seen")
LASER_OFF = 1  # tells the partner frame's noise from that of its frame


@dataclass(frozen=True)
class Extras:
    """full_truth: pixel labels and the sheet's curve in truth/. ambient_frames: the room alone, in images_off/."""

    full_truth: bool = False
    ambient_frames: bool = False

    def files(self, folder: Path, number: int) -> tuple[Path, ...]:
        """The files of a frame that these extras write."""
        truth = folder / "truth" / f"{number:03d}"
        names = ("labels.png", "labels.csv", "curve.csv") if self.full_truth else ()
        off = (folder / "images_off" / f"{number:03d}.png",) if self.ambient_frames else ()
        return (*(truth.with_name(f"{truth.name}_{n}") for n in names), *off)

    def render(
        self, folder: Path, number: int, scene: Scene, config: EmulatorConfig, seed: int, renderer: Renderer
    ) -> RenderedFrame:
        """Render a frame, write its extras into ``folder`` and return it."""
        rng = np.random.default_rng([seed, number])
        frame = render(scene, config, rng, full_truth=self.full_truth, renderer=renderer)
        if self.full_truth:
            _write_full_truth(folder / "truth", f"{number:03d}", frame.truth, scene)
        if self.ambient_frames:
            exposure = config.exposure.model_copy(update={"laser_on": False})
            off = config.model_copy(update={"exposure": exposure})
            partner = render(scene, off, np.random.default_rng([seed, number, LASER_OFF]), renderer=renderer)
            write_png(folder / "images_off" / f"{number:03d}.png", partner.image)
        return frame


NONE = Extras()


def truth_points(frame: RenderedFrame) -> tuple[TruthPoint, ...]:
    """The strings of a rendered frame as truth.json has them."""
    return tuple(
        TruthPoint(
            label=s.label,
            axis_mm=_pair(s.axis_mm),
            surface_mm=_pair(s.surface_mm),
            image_px=_pair(s.image_px),
            visible_fraction=float(s.visible_fraction),
        )
        for s in frame.truth.strings
    )


def _write_full_truth(folder: Path, number: str, truth: RenderedTruth, scene: Scene) -> None:
    if truth.labels is None or truth.curve is None:
        return
    write_png(folder / f"{number}_labels.png", truth.labels)
    names = [(i, name or "none") for i, name in enumerate(truth.label_names)]
    write_text(folder / f"{number}_labels.csv", _table(("label", "surface"), names))
    first = 1 + len(truth.strings)
    curve = truth.curve
    rows = [
        (truth.label_names[first + k], *map(_number, (*yz.ravel(), *uv.ravel())), int(seen))
        for k, yz, uv, seen in zip(curve.solid, curve.yz_mm, curve.uv_px, curve.seen, strict=True)
    ]
    write_text(folder / f"{number}_curve.csv", _table(CURVE_COLUMNS, rows))


def _table(columns: tuple[str, ...], rows: list[tuple[object, ...]] | list[tuple[int, str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    return text.getvalue()


def _number(value: float) -> str:
    return f"{value:.6f}" if np.isfinite(value) else ""


def _pair(values: Array) -> tuple[float, float] | None:
    return (float(values[0]), float(values[1])) if np.all(np.isfinite(values)) else None
