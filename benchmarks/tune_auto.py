"""`tune --auto` on three emulated cells with other optics, noise and clutter than the defaults were made for.

For each cell: the defaults, what the search finds from them, and what it finds from badly wrong parameters (the
defaults are not offered to that search), all scored on held-out images against truth.

    python benchmarks/tune_auto.py [--trials 120] [--folder FOLDER]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from extraction import ExtractionConfig
from geometry import Sensor, draw_errors
from jig_cad import Jig, sample_tolerance
from perceptron_emu import EmulatorConfig
from workbench import defaults
from workbench.cell import (
    DESIGN_SCP,
    PLACES,
    find_robot,
    find_sensor,
    jig_bodies,
    place_of_jig,
    sees_all_strings,
    wall_behind,
)
from workbench.emulate import TrueCell, record, with_joint_noise
from workbench.files import Cell, stated_optics
from workbench.opened import ImageRequest, open_images
from workbench.plan import ViewProblem, plan_views
from workbench.tune import Score, judge, make_task, search

PER_LOCATION = 8
WRONG = {
    "detect": {
        "blur_sigma_px": 3.8,
        "threshold": 35.0,
        "min_height_dn": 45.0,
        "max_length_mm": 0.6,
        "min_length_px": 3.0,
    },
    "localise": {"window_sigma": 1.1, "min_score": 0.7},
}


@dataclass(frozen=True)
class Variant:
    """One cell: how its sensor differs from the demo's, and how far behind the jig a wall stands (None: no wall)."""

    name: str
    geometry: dict[str, object]
    emulation: dict[str, dict[str, object]]
    wall_mm: float | None
    seed: int


VARIANTS = (
    Variant(
        "soft lens, short exposure, noisy camera",
        {"fx_px": 1700.0, "fy_px": 1700.0, "width_px": 1024, "height_px": 768, "cx_px": 513.0, "cy_px": 381.0},
        {
            "optics": {"blur_px": 1.7, "f_number": 2.8},
            "noise": {"read_noise_e": 45.0, "dsnu_e": 8.0},
            "exposure": {"time_ms": 0.4},
        },
        None,
        11,
    ),
    Variant(
        "12 bits, sharp lens, bright room, wall behind",
        {"bit_depth": 12},
        {
            "optics": {"blur_px": 0.5, "f_number": 5.6},
            "noise": {"read_noise_e": 6.0},
            "ambient": {"irradiance_mw_m2_nm": 40.0},
            "exposure": {"time_ms": 1.0},
        },
        90.0,
        12,
    ),
    Variant(
        "glossy strings, full speckle, overexposed, wall behind",
        {},
        {
            "surface": {"specular": 0.5, "roughness": 0.15},
            "speckle": {"polarised": True},
            "exposure": {"time_ms": 2.5},
            "ambient": {"irradiance_mw_m2_nm": 10.0},
        },
        160.0,
        13,
    ),
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=120)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--only", type=int, choices=(1, 2, 3))
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp(prefix="tune_auto_"))
    chosen = VARIANTS if options.only is None else (VARIANTS[options.only - 1],)
    print(f"{options.trials} trials a search; held-out images; loss: rms error, 0.5 mm for a missed or false point")
    for variant in chosen:
        one_cell(variant, folder / f"cell_{variant.seed}", options.trials)


def one_cell(variant: Variant, folder: Path, trials: int) -> None:
    """Record one cell, search it from the defaults and from WRONG, print the held-out scores."""
    record_cell(variant, folder)
    images = open_images(ImageRequest((folder,)))
    images.learn_chain()
    task = make_task(images, variant.seed)
    wrong = ExtractionConfig.model_validate(WRONG)
    print(f"\n{variant.name}: {len(task.train)} images to train on, {len(task.held_out)} held out")
    reached = {}
    for name, start in (("from the defaults", images.settings.extraction), ("from badly wrong", wrong)):
        clock = time.perf_counter()
        found = search(task, start, trials, variant.seed, folder / "tune.journal", silent)
        judged = judge(task, start, found.config, variant.seed)
        if start == images.settings.extraction:
            line("defaults", judged.defaults)
        else:
            line("badly wrong", judged.start)
        low, high = judged.gain_90
        line(
            f"found {name}",
            judged.found,
            f"gain {judged.gain:+.1%} ({low:+.1%} … {high:+.1%}), {time.perf_counter() - clock:.0f} s",
        )
        reached[name] = judged.found.loss_mm
    ratio = reached["from badly wrong"] / reached["from the defaults"]
    print(f"  found from badly wrong / found from the defaults: {ratio:.3f}")


def line(name: str, s: Score, remark: str = "") -> None:
    """One row."""
    counts = f"missed {s.missed:3d}  false {s.false:3d}  of {s.wanted}"
    print(f"  {name:26} loss {s.loss_mm:.4f}  rms {s.rms_mm:.4f}  {counts}  {remark}", flush=True)


def silent(_done: int, _of: int, _best: float) -> None:
    """No progress shown."""


def record_cell(variant: Variant, folder: Path) -> Cell:
    """The paper's arm and jig under another sensor; kept in the folder where it is finished already."""
    rng = np.random.default_rng(variant.seed)
    sensor = other_sensor(find_sensor(defaults.SENSOR), variant)
    jig = Jig.nominal()
    true_jig = sample_tolerance(jig, rng)
    walls = () if variant.wall_mm is None else (wall_behind(true_jig, variant.wall_mm),)
    solids = (*jig_bodies(true_jig), *walls)
    robot = find_robot(defaults.ROBOT)
    places = {name: place_of_jig(*PLACES[name][1:]) for name in ("A", "B", "C")}
    true = TrueCell(
        robot.corrected(draw_errors(robot, rng)), true_jig, DESIGN_SCP, places, dict.fromkeys(places, solids)
    )
    sees_all = sees_all_strings(sensor, jig, solids)
    views = []
    for name, pose in places.items():
        planned = plan_views(ViewProblem(robot, sensor, jig, pose, DESIGN_SCP, sees_all=sees_all), PER_LOCATION, rng)
        views += [(name, "calibrate", joints) for joints in planned.joints_rad]
    cell = Cell(
        folder=folder,
        sensor=sensor,
        target=jig,
        robot=robot,
        frames=(),
        T_hand_sensor_design=DESIGN_SCP,
        name=variant.name,
        emulator=EmulatorConfig.model_validate(variant.emulation),
    )
    return record(folder, cell, true, with_joint_noise(views, true.robot, rng), variant.seed)


def other_sensor(base: Sensor, variant: Variant) -> Sensor:
    """The demo's sensor with the variant's geometry and stated optics."""
    optics = stated_optics(EmulatorConfig.model_validate(variant.emulation))
    return replace(base.with_camera(**variant.geometry), optics=optics)


if __name__ == "__main__":
    sys.exit(main())
