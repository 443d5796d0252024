"""Draw the definition of gap and flush, as docs/gapflush.md shows it, from the profile of rendered panels.

Run: python benchmarks/docs_gapflush_picture.py [file.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from assets import path as asset
from extraction import extract_profile, measure_gap_flush
from geometry import Pose
from perceptron_emu import EmulatorConfig, Scene, render
from perceptron_emu.solids import PanelPair
from workbench.files import read_sensor
from workbench.report import draw_gap_flush

PANELS = PanelPair(gap_mm=4.0, flush_mm=1.2, radii_mm=(1.5, 2.5))


def main() -> None:
    """Render, measure and draw."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs/pictures/gapflush.png"
    sensor = read_sensor(asset("sensors", "nominal"))
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": False}})
    place = Pose(np.eye(3), np.array([0, 0, 300.0]))
    image = render(Scene(sensor, None, solids=PANELS.solids(place)), config, np.random.default_rng(1)).image
    profile = extract_profile(image, sensor)
    draw_gap_flush(profile, measure_gap_flush(profile), target)


if __name__ == "__main__":
    main()
