"""`perceptron-emu tune --auto N`: search, judge on held-out images, say what to use, save it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from pydantic import BaseModel
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from geometry import PerceptronEmuError, json_text
from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, standard_error, standard_output
from workbench.files import Recipe, Settings, settings_toml, write_text
from workbench.opened import ImageRequest, ImageSet, open_images
from workbench.tune import Judgement, Score, SearchResult, Task, judge, make_task, search

RESULT = "tuned.toml"
JOURNAL = "tune.journal"
PAGE_SEED = 0  # of a search from the page, so that it goes on where an earlier one ended


def run_auto(request: ImageRequest, trials: int, seed: int, *, as_json: bool = False) -> None:
    """Search ``trials`` settings and print what the held-out images say of them."""
    images = open_images(request)
    start, folder = images.settings.extraction, images.folder
    _learn_chain(images)
    task = make_task(images, seed)
    with _progress(trials) as progress:
        found = search(task, start, trials, seed, folder / JOURNAL, progress)
    judgement = judge(task, start, found.config, seed)
    defaults = type(start)()
    chosen = found.config if judgement.better else defaults
    write_text(folder / RESULT, settings_toml(chosen))
    if as_json:
        shown = _judged(task, found, judgement, defaults)
        shown["scores"]["defaults"] = _score(judgement.defaults)
        counts = {"trials": found.trials, "resumed": found.resumed, "interrupted": found.interrupted}
        say_on_stdout(json_text(counts | shown | {"saved": str(folder / RESULT)}))
    else:
        _print(task, found, judgement, defaults, folder / RESULT)
    if found.interrupted:
        standard_error().print("Interrupted; the same command goes on from here.")
        raise typer.Exit(exit_codes.INTERRUPTED)


def page_search(images: ImageSet) -> Callable[[Recipe, int, Callable[[int, int, float], None]], dict[str, Any]]:
    """The search as the process window runs it: the found recipe, both scores, and the words for them."""

    def run(recipe: Recipe, trials: int, progress: Callable[[int, int, float], None]) -> dict[str, Any]:
        start = Settings.of(recipe).extraction
        task = make_task(images, PAGE_SEED)
        found = search(task, start, trials, PAGE_SEED, images.folder / JOURNAL, progress)
        judgement = judge(task, start, found.config, PAGE_SEED)
        tables = {name: getattr(found.config, name) for name in type(found.config).model_fields}
        parameters = recipe.model_copy(update=tables).model_dump(mode="json")
        return {"parameters": parameters} | _judged(task, found, judgement, start)

    return run


def _judged(task: Task, found: SearchResult, judgement: Judgement, before: BaseModel) -> dict[str, Any]:
    """What the held-out images say, plainly; ``before``: the settings that the changes are told against."""
    low, high = judgement.gain_90
    return {
        "better": bool(judgement.better),
        "gain": finite(judgement.gain),
        "gain_90": [finite(low), finite(high)],
        "scores": {name: _score(s) for name, s in (("start", judgement.start), ("found", judgement.found))},
        "changes": changes(found.config, before),
        "train": len(task.train),
        "held_out": len(task.held_out),
        "skipped": list(task.skipped.values()),
    }


def finite(x: float) -> float | None:
    """The number, or None where JSON has no word for it."""
    return float(x) if math.isfinite(x) else None


def _score(s: Score) -> dict[str, Any]:
    numbers = {"loss_mm": finite(s.loss_mm), "rms_mm": finite(s.rms_mm)}
    return numbers | {"missed": int(s.missed), "false": int(s.false), "of": int(s.wanted)}


def _learn_chain(images: ImageSet) -> None:
    """Solve the robot chain for better labels; without it every image is labelled for itself."""
    try:
        images.learn_chain()
    except PerceptronEmuError as error:
        standard_error().print(f"labels come from each image alone: {error}", markup=False, soft_wrap=True)


@contextmanager
def _progress(trials: int) -> Iterator[Callable[[int, int, float], None]]:
    console = standard_error()
    best = TextColumn("{task.description}")
    columns = (TextColumn("searching"), BarColumn(), MofNCompleteColumn(), best, TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=trials)

        def update(done: int, of: int, best_mm: float) -> None:
            bar.update(task, completed=done, total=of, description=f"best {best_mm:.4f} mm")

        yield update


def _print(task: Task, found: SearchResult, judgement: Judgement, defaults: BaseModel, path: Path) -> None:
    console = standard_output()
    kind = "errors against truth.json" if task.has_truth else "distances from the strings of each frame's own pose"
    resumed = f" ({found.resumed} of them from earlier runs)" if found.resumed else ""
    console.print(f"{found.trials} trials{resumed} on {len(task.train)} images; {len(task.held_out)} held out; {kind}")
    for name in task.skipped.values():
        console.print(f"left out: {name}", markup=False, soft_wrap=True)
    console.print(_table(judgement))
    low, high = judgement.gain_90
    margin = f"gain {judgement.gain:+.1%} (90 % interval {low:+.1%} … {high:+.1%})"
    if judgement.better:
        console.print(f"The found settings beat the defaults on the held-out images by this margin: {margin}.")
        for line in changes(found.config, defaults):
            console.print(f"  {line}", markup=False)
    else:
        console.print(f"The defaults are already as good on the held-out images, keep them: {margin}.")
    console.print(f"saved: {path}", markup=False, soft_wrap=True)


def _table(judgement: Judgement) -> Table:
    table = Table("held-out images", "loss, mm", "rms, mm", "missed", "false", "of", box=None, pad_edge=False)
    rows = {"defaults": judgement.defaults, "start": judgement.start, "found": judgement.found}
    if judgement.start == judgement.defaults:
        del rows["start"]
    for name, score in rows.items():
        table.add_row(name, *_cells(score))
    return table


def _cells(s: Score) -> tuple[str, ...]:
    return f"{s.loss_mm:.4f}", f"{s.rms_mm:.4f}", str(s.missed), str(s.false), str(s.wanted)


def changes(found: BaseModel, defaults: BaseModel) -> list[str]:
    """``detect.threshold 7 → 5.2`` for every parameter that differs."""
    return [f"{key} {old} → {new}" for key, old, new in _differences(found.model_dump(), defaults.model_dump(), "")]


def _differences(new: dict[str, object], old: dict[str, object], prefix: str) -> Iterator[tuple[str, str, str]]:
    for key, value in new.items():
        before = old[key]
        if isinstance(value, dict) and isinstance(before, dict):
            yield from _differences(value, before, f"{prefix}{key}.")
        elif value != before:
            yield f"{prefix}{key}", _short(before), _short(value)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
