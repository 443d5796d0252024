"""docs/accuracy.md and its pictures, made from a finished run of examples/accuracy.toml.

Run: perceptron-emu sweep examples/accuracy.toml --out accuracy
     python benchmarks/docs_accuracy.py accuracy [folder of the page, default docs]

The section on other targets comes from the store of benchmarks/calib_targets.py:
     python benchmarks/docs_accuracy.py --targets STORE [folder of the page]
"""

# ruff: noqa: E501 - the lines of the page are as long as those of the other pages

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import chi2

from workbench.campaign import (
    LEVEL,
    AskedAccuracy,
    Run,
    advice,
    consistency,
    proportion_band,
    quantile_band,
    reached,
    read_run,
    verdicts,
)

POSES, TILT, ARM, MODEL = "poses.per_location", "poses.tilt_max_deg", "robot.error_scale", "calib.model"
TOLERANCE, STRING = "jig.tolerance_mm", "jig.string_diameter_mm"
TARGETS = (AskedAccuracy(0.1, 0.03), AskedAccuracy(0.2, 0.05), AskedAccuracy(0.5, 0.1))
COLOURS = {(1.0, "scp"): "#c2571a", (1.0, "full"): "#2563a8", (0.2, "scp"): "#c9a227", (0.2, "full"): "#2d8a57"}
RESAMPLES = 2000

HEAD = """# How accurate is the calibrated sensor?

*Made by `benchmarks/docs_accuracy.py` from a run of [examples/accuracy.toml](../examples/accuracy.toml); every number below comes from that run, but for the sections on other targets and on one wrong number.*

    perceptron-emu sweep examples/accuracy.toml --out accuracy
    perceptron-emu report accuracy
    python benchmarks/docs_accuracy.py accuracy

## What was tested

{trials} complete calibrations of cells that exist only in the computer, each with its own arm, jig and mounting: the images are rendered with the
full camera (noise, speckle, room light), the string points are found in them, and the sensor's pose in the robot's hand (its SCP) is solved from the points and the
joint readings, through the same code as for a real cell. Afterwards the answer is held against the truth, which only an emulated cell has.

- **The sensor** is the nominal one (1280 × 1024 pixels, about 0.1 mm a pixel in width); its true mounting is off the drawing by 1 mm and 1.5° (1 σ a direction).
- **The arm** reaches 2.55 m. *As built*: every row of its table is off by {theta}°, {d} mm, {a} mm and {alpha}° (θ, d, a, α; 1 σ), what a standard arm has without an accuracy option.
  *Measured*: a fifth of that, what its maker's absolute calibration leaves. Joint readings scatter by {joint}° in both.
- **The jig** has five strings of {strings} mm on a pillar of 100 mm; each anchor lies where the drawing says within a full width of {tolerances} mm.
- **The views**: the jig stands at three places, {poses} poses at each, with the sensor tilted by up to {tilts}° about two axes.
- **The model**: `scp` solves the sensor's pose and takes the arm as its table says; `full` solves the arm's table as well, as far as the data can tell.

{answered} of {trials} trials gave an answer that the program says may be used ({verdicts}).

## What you can expect

Errors of the sensor's position (length) and of its orientation (angle). "95 %": 19 of 20 cells came out better than this; in brackets the 95 % confidence interval
of that figure. All jigs and strings of the plan are in every row; "no bound" stands where the trials are too few for one.

"""


def column(run: Run, name: str) -> np.ndarray:
    """A factor's values as an array."""
    return np.array(run.trials[name])


def quantiles(run: Run, error: str, mask: np.ndarray) -> tuple[float, float, tuple[float, float]]:
    """Median and 95 % error of the trials of ``mask`` that were answered, with the latter's band."""
    known = np.sort(run.real(error)[mask & run.answered])
    p95, band = quantile_band(known, LEVEL)
    return float(np.median(known)) if len(known) else float("nan"), p95, band


def arm_name(scale: float) -> str:
    """The arm's class in words."""
    return "as built" if scale == 1 else "measured"


def big_table(run: Run) -> str:
    """Errors by arm, model, poses and tilt."""
    rows = [
        "| arm | model | poses | tilts up to | trials | median mm | 95 % mm | median ° | 95 % ° |",
        "|---|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    places = run.plan.base.poses.locations
    for arm in (1.0, 0.2):
        for model in ("scp", "full"):
            for n in sorted(set(run.trials[POSES])):
                for tilt in sorted(set(run.trials[TILT])):
                    mask = (column(run, ARM) == arm) & (column(run, MODEL) == model)
                    mask &= (column(run, POSES) == n) & (column(run, TILT) == tilt)
                    mm, deg = (quantiles(run, error, mask) for error in ("error_mm", "error_deg"))
                    cells = [arm_name(arm), f"`{model}`", str(places * n), f"{tilt:.0f}°", str(int(mask.sum()))]
                    cells += [f"{mm[0]:.3f}", band_text(mm, 3), f"{deg[0]:.4f}", band_text(deg, 4)]
                    rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def band_text(values: tuple[float, float, tuple[float, float]], digits: int) -> str:
    """The 95 % error with its band; no upper end where the trials are too few for one."""
    _, p95, (low, high) = values
    end = f"{high:.{digits}f}" if np.isfinite(high) else "no bound"
    return f"{p95:.{digits}f} ({low:.{digits}f} … {end})"


def ratio(run: Run, error: str, one: np.ndarray, other: np.ndarray) -> tuple[float, float, float]:
    """Median error of ``one`` over that of ``other``, with its 95 % bootstrap interval."""
    rng = np.random.default_rng(0)
    x, y = (run.real(error)[m & run.answered] for m in (one, other))
    draws = [np.median(rng.choice(x, len(x))) / np.median(rng.choice(y, len(y))) for _ in range(RESAMPLES)]
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(np.median(x) / np.median(y)), float(low), float(high)


def effects(run: Run) -> str:
    """What each change does to the median error, the rest mixed as in the plan."""
    poses, tilts = sorted(set(run.trials[POSES])), sorted(set(run.trials[TILT]))
    places = run.plan.base.poses.locations
    built = column(run, ARM) == 1.0
    changes = [
        ("measured arm in place of one as built", ARM, 0.2, 1.0, np.ones(run.size, bool)),
        ("`full` in place of `scp`, arm as built", MODEL, "full", "scp", built),
        ("`full` in place of `scp`, measured arm", MODEL, "full", "scp", ~built),
        (
            f"{places * poses[-1]} poses in place of {places * poses[0]}",
            POSES,
            poses[-1],
            poses[0],
            np.ones(run.size, bool),
        ),
        (
            f"tilts up to {tilts[-1]:.0f}° in place of {tilts[0]:.0f}°",
            TILT,
            tilts[-1],
            tilts[0],
            np.ones(run.size, bool),
        ),
    ]
    for name, words in (
        (TOLERANCE, "jig made to {:g} mm in place of {:g} mm"),
        (STRING, "strings of {:g} mm in place of {:g} mm"),
    ):
        low, high = min(run.trials[name]), max(run.trials[name])
        changes.append((words.format(low, high), name, low, high, np.ones(run.size, bool)))
    rows = ["| change | position error × | orientation error × |", "|---|--:|--:|"]
    for words, name, new, old, among in changes:
        pair = (among & (column(run, name) == new), among & (column(run, name) == old))
        texts = ["{:.2f} ({:.2f} … {:.2f})".format(*ratio(run, e, *pair)) for e in ("error_mm", "error_deg")]
        rows.append(f"| {words} | {texts[0]} | {texts[1]} |")
    return "\n".join(rows)


def shares(run: Run) -> str:
    """How many cells reach a target, by arm and model; with the most poses and the largest tilts."""
    best = (column(run, POSES) == max(run.trials[POSES])) & (column(run, TILT) == max(run.trials[TILT]))
    rows = [
        "| arm | model | " + " | ".join(f"{t.mm:g} mm and {t.deg:g}°" for t in TARGETS) + " |",
        "|---|---|" + "--:|" * len(TARGETS),
    ]
    for arm in (1.0, 0.2):
        for model in ("scp", "full"):
            mask = best & (column(run, ARM) == arm) & (column(run, MODEL) == model)
            cells = []
            for target in TARGETS:
                hits, n = int(reached(run, target)[mask].sum()), int(mask.sum())
                low, high = proportion_band(hits, n)
                cells.append(f"{100 * hits / n:.0f} % ({100 * low:.0f} … {100 * high:.0f})")
            rows.append(f"| {arm_name(arm)} | `{model}` | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def picture(run: Run, path: Path) -> None:
    """95 % error of position and orientation against poses, a line for each arm and model, at the largest tilts."""
    figure, both = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    counts = sorted(set(run.trials[POSES]))
    wide = column(run, TILT) == max(run.trials[TILT])
    for axes, error, unit in zip(both, ("error_mm", "error_deg"), ("mm", "°"), strict=True):
        for shift, ((arm, model), colour) in enumerate(COLOURS.items()):
            mask = wide & (column(run, ARM) == arm) & (column(run, MODEL) == model)
            x = run.plan.base.poses.locations * np.array(counts) * 1.012 ** (shift - 1.5)
            values = [quantiles(run, error, mask & (column(run, POSES) == n)) for n in counts]
            p95, low, high = np.array([[v[1], *v[2]] for v in values]).T
            axes.plot(x, p95, "o-", color=colour, label=f"arm {arm_name(arm)}, {model}", markersize=4)
            axes.plot(x, [v[0] for v in values], "--", color=colour, linewidth=0.9)
            axes.vlines(x, low, np.where(np.isfinite(high), high, p95), color=colour, alpha=0.6)
        axes.set_xscale("log")
        axes.set_yscale("log")
        ticks = [run.plan.base.poses.locations * n for n in counts]
        axes.set_xticks(ticks, [str(t) for t in ticks])
        axes.minorticks_off()
        axes.set_xlabel("poses")
        axes.set_ylabel(f"SCP error [{unit}]: 95 % (line), median (dashed)")
        axes.yaxis.set_major_formatter(lambda v, _: f"{v:g}")
        axes.yaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*both[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def of_model(run: Run, model: str) -> Run:
    """The trials of one model."""
    mask = column(run, MODEL) == model
    return Run(run.folder, run.plan, {k: [v for v, m in zip(c, mask, strict=True) if m] for k, c in run.trials.items()})


def sigma_text(run: Run) -> str:
    """Whether the reported σ are true, by model."""
    lines = []
    for model in ("scp", "full"):
        found = consistency(of_model(run, model))
        if found is not None:
            low, high = found.nees_bounds
            lines.append(
                f"- `{model}`: mean NEES {found.nees:.2f} over {found.trials} trials (6 where σ is true, {low:.2f} … {high:.2f} by chance); "
                f"the 95 % ellipsoid covers the truth in {100 * found.coverage:.1f} % "
                f"({100 * found.coverage_bounds[0]:.1f} … {100 * found.coverage_bounds[1]:.1f} %)."
            )
    return "\n".join(lines)


def head(run: Run) -> str:
    """What was tested."""
    robot = run.plan.base.robot
    values = {n: " or ".join(f"{v:g}" for v in sorted(set(run.trials[n]))) for n in (TOLERANCE, STRING, TILT, POSES)}
    return HEAD.format(
        trials=run.size,
        theta=robot.theta_sigma_deg,
        d=robot.d_sigma_mm,
        a=robot.a_sigma_mm,
        alpha=robot.alpha_sigma_deg,
        joint=robot.joint_sigma_deg,
        strings=values[STRING],
        tolerances=values[TOLERANCE],
        tilts=values[TILT],
        poses=values[POSES],
        answered=int(run.answered.sum()),
        verdicts=", ".join(f"{code} {n}" for code, n in verdicts(run)),
    )


def page(run: Run) -> str:
    """The whole page."""
    sentences = "\n".join(f"- {advice(run, target)}" for target in TARGETS)
    most = run.plan.base.poses.locations * max(run.trials[POSES])
    return f"""{head(run)}{big_table(run)}

![95 % error against the number of poses](pictures/accuracy.png)

*At tilts up to {max(run.trials[TILT]):.0f}°; the strokes are the confidence intervals of the 95 % error.*

## What to do for a given accuracy

{sentences}

With {most} poses and tilts up to {max(run.trials[TILT]):.0f}°, this share of the cells is at least so accurate:

{shares(run)}

## What decides the accuracy

The median error after a change over that before it, everything else mixed as in the plan: below 1 is better, and an interval that holds 1 says that no effect was seen.

{effects(run)}

## Are the reported uncertainties true?

{sigma_text(run)}

## What this does not say

The arm's errors are those of its table and its joint readings: no temperature, no gear error, no bending under load, and the sensor's own calibration is exact. Tilts and places are random within their
limits, not the best ones (`perceptron-emu plan` finds better). A real cell with such effects is worse than this page; its `calibrate` report says by how much.
"""


JIG_ROW = "| string jig, from images |"
FAULTS_BEGIN = "## One wrong number in a file\n"
OTHERS_BEGIN, OTHERS_END = "## Other targets\n", "## What this does not say\n"
OTHERS = """## Other targets

What the same arms reach with other targets, emulated by `python benchmarks/calib_targets.py 500 --store STORE --arms built measured` and written here by `python benchmarks/docs_accuracy.py --targets STORE`: three places of nine views, profiles of
300 points of 0.03 mm whose neighbours share noise, model `auto`, beside the string jig's row above (21 poses, tilts up to 35°, `full`). 95 % of the cells are better than this; NEES is 6 where σ are true.

| target | arm | cells | 95 % mm | 95 % ° | NEES | inside the 95 % ellipsoid |
|---|---|--:|--:|--:|--:|--:|
{rows}

[Targets](targets.md) says which views these take. A ball of 40 mm tells rotations poorly, whatever the arm; NEES and coverage of the string jig are of all its rows.

"""
TARGET_NAMES = {"sphere": "ball of 40 mm", "plane": "plane at three places", "wedge": "wedge of 90°", "edge": "edge"}


def others(store: Path, jig: list[str]) -> str:
    """The section on other targets, from the store of benchmarks/calib_targets.py; jig: the string jig's rows."""
    rows: dict[tuple[str, str], list[list[float]]] = {}
    for line in store.read_text(encoding="utf-8").splitlines():
        key, (squared, mm, deg, _) = json.loads(line)
        kind, arm, model, _ = key.split()
        if kind in TARGET_NAMES and arm in ("built", "measured") and model == "auto" and np.isfinite(squared):
            rows.setdefault((kind, arm), []).append([squared, mm, deg])
    lines = [*jig]
    for kind, name in TARGET_NAMES.items():
        for arm in ("built", "measured"):
            if (kind, arm) in rows:
                table = np.array(rows[kind, arm])
                mm, deg = np.percentile(table[:, 1:], 95, axis=0)
                mean, spread = table[:, 0].mean(), table[:, 0].std() / np.sqrt(len(table))
                inside = np.mean(table[:, 0] < chi2.isf(0.05, 6))
                called = "as built" if arm == "built" else arm
                lines.append(
                    f"| {name} | {called} | {len(table)} | {mm:.3f} | {deg:.4f} | {mean:.2f} ± {spread:.2f} | {100 * inside:.1f} % |"
                )
    return OTHERS.format(rows="\n".join(lines))


def jig_rows(run: Run) -> str:
    """The string jig's rows of the table of other targets: 21 poses, tilts up to 35°, `full`."""
    known, rows = consistency(of_model(run, "full")), []
    for arm in (1.0, 0.2):
        mask = (column(run, ARM) == arm) & (column(run, MODEL) == "full")
        mask &= (column(run, POSES) == 7) & (column(run, TILT) == max(run.trials[TILT]))
        mm, deg = (quantiles(run, error, mask)[1] for error in ("error_mm", "error_deg"))
        sigma = "– | –" if known is None else f"{known.nees:.2f} | {100 * known.coverage:.1f} %"
        rows.append(f"{JIG_ROW} {arm_name(arm)} | {int(mask.sum())} | {mm:.3f} | {deg:.4f} | {sigma} |")
    return "\n".join(rows)


def own_rows(page: str) -> list[str]:
    """The string jig's rows as a page has them."""
    return [line for line in page.splitlines() if line.startswith(JIG_ROW)]


def with_others(text: str, section: str) -> str:
    """The page with this section on other targets in place of its own, or before its last one."""
    end = text.index(OTHERS_END)
    begin = text.index(OTHERS_BEGIN) if OTHERS_BEGIN in text else end
    return text[:begin] + section + text[end:]


def main() -> None:
    """Write the page and its picture."""
    if sys.argv[1] == "--targets":
        path = Path(sys.argv[3] if len(sys.argv) > 3 else "docs") / "accuracy.md"
        before = path.read_text(encoding="utf-8")
        path.write_text(with_others(before, others(Path(sys.argv[2]), own_rows(before))), encoding="utf-8")
        return
    run = read_run(Path(sys.argv[1]))
    docs = Path(sys.argv[2]) if len(sys.argv) > 2 else Path("docs")
    (docs / "pictures").mkdir(parents=True, exist_ok=True)
    picture(run, docs / "pictures" / "accuracy.png")
    path, text = docs / "accuracy.md", page(run)
    before = path.read_text(encoding="utf-8") if path.exists() else ""
    if OTHERS_BEGIN in before:  # of other runs than this one
        kept = before[before.index(OTHERS_BEGIN) : before.index(OTHERS_END)]
        text = with_others(text, kept.replace("\n".join(own_rows(kept)), jig_rows(run)))
    if FAULTS_BEGIN in before:
        text += "\n" + before[before.index(FAULTS_BEGIN) :]
    path.write_text(text, encoding="utf-8")
    print(docs / "accuracy.md")


if __name__ == "__main__":
    main()
