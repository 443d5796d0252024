"""The twin's answer as JSON, as a sensor.toml, and as a page that shows recorded and emulated side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.files import sensor_text, write_text
from workbench.report import jpeg, new_figure, render_page, svg
from workbench.twin.fit import Twin
from workbench.twin.seen import ImageSeen, gaps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

SHOWN = 3  # images
BINS = 40
WORDS = {
    "width_px": "width of the stripe, σ [px]",
    "height_dn": "height of the stripe [DN]",
    "sigma_px": "stated σ of a point [px]",
    "chi2_per_dof": "χ² per degree of freedom of a section",
    "residual_px": "residual about the smooth line [px]",
}


@dataclass(frozen=True, eq=False)
class Compared:
    """One quantity of all points, recorded and emulated, and their two-sample distance: the largest difference of their
    cumulative distributions (Kolmogorov & Smirnov).
    """

    name: str
    recorded: Array
    emulated: Array
    distance: float


def compared(twin: Twin) -> list[Compared]:
    """What extraction sees, quantity by quantity."""
    out = []
    for name in WORDS:
        one, other = (_values(name, seen) for seen in (twin.recorded, twin.emulated))
        out.append(Compared(name, one, other, _distance(one, other)))
    return out


def _values(name: str, seen: tuple[ImageSeen, ...]) -> Array:
    column = {
        "width_px": "width_px",
        "height_dn": "amplitude_dn",
        "sigma_px": "sigma_px",
        "chi2_per_dof": "chi2_per_dof",
    }
    parts = [s.residual_px if name == "residual_px" else getattr(s.profile.peaks, column[name]) for s in seen]
    values = np.concatenate(parts)
    return np.asarray(values[np.isfinite(values)])


def _distance(one: Array, other: Array) -> float:
    if len(one) == 0 or len(other) == 0:
        return float("nan")
    at = np.sort(np.concatenate([one, other]))
    cumulative = (np.searchsorted(np.sort(a), at, side="right") / len(a) for a in (one, other))
    return float(np.max(np.abs(np.subtract(*cumulative))))


def twin_object(twin: Twin) -> dict[str, Any]:
    """The JSON of a twin."""
    spread = {
        which: {
            "points": int(sum(len(s.profile) for s in seen)),
            "gaps": int(sum(gaps(s) for s in seen)),
            "scatter_px": _robust(_values("residual_px", seen)),
            "sigma_px": float(np.median(_values("sigma_px", seen))) if sum(len(s.profile) for s in seen) else None,
        }
        for which, seen in (("recorded", twin.recorded), ("emulated", twin.emulated))
    }
    return {
        "n_images": len(twin.recorded),
        "converged": twin.converged,
        "clipped": twin.clipped,
        "chi2_per_dof": twin.chi2_per_dof,
        "keys": [
            {"table": k.table, "key": k.name, "value": k.value, "sigma": k.sigma, "told_by_images": k.told}
            for k in twin.keys
        ],
        "seen": spread,
        "distances": {c.name: c.distance for c in compared(twin)},
    }


def _robust(values: Array) -> float | None:
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if len(values) else None


def write_twin(twin: Twin, out: Path, report: Path | None) -> None:
    """Write the twin's sensor.toml, and the page where one is asked for."""
    write_text(out, sensor_text(twin.sensor, twin.config))
    if report is None:
        return
    pairs = [
        {"name": k, "recorded": _picture(a), "emulated": _picture(b)}
        for k, (a, b) in enumerate(zip(twin.recorded[:SHOWN], twin.emulated[:SHOWN], strict=True))
    ]
    content = {
        "twin": twin_object(twin),
        "pairs": pairs,
        "plots": [{"words": WORDS[c.name], "distance": c.distance, "image": svg(_plot(c))} for c in compared(twin)],
    }
    write_text(report, render_page("workbench.twin", "page.html.j2", content))


def _picture(seen: ImageSeen) -> str:
    """The image by the square root of its brightness."""
    image = seen.image.astype(float) / max(float(np.percentile(seen.image, 99.95)), 1.0)
    grey = (255 * np.sqrt(np.clip(image, 0, 1))).astype(np.uint8)
    return jpeg(np.repeat(grey[..., None], 3, 2))


def _plot(c: Compared) -> Figure:
    figure, axis = new_figure(4.2, 2.6)
    both = np.concatenate([c.recorded, c.emulated])
    if len(both):
        low, high = np.percentile(both, [0.5, 99.5])
        edges = np.linspace(low, max(high, low + 1e-9), BINS + 1)
        for values, colour, label in ((c.recorded, "#2a6f97", "recorded"), (c.emulated, "#c44e52", "emulated")):
            axis.hist(values, edges, density=True, histtype="step", color=colour, label=label)
        axis.legend(fontsize=8, frameon=False)
    axis.set_xlabel(WORDS[c.name])
    axis.set_yticks([])
    return figure
