"""A comparison with truth as the page takes it: error vectors, bias, scatter, misses, false points."""

from __future__ import annotations

from typing import Any

from workbench.compare import Comparison, Statistics, summarise
from workbench.window.engine import finite


def comparison_json(c: Comparison) -> dict[str, Any]:
    """One frame's comparison for the page."""
    return {
        "strings": [
            {
                "label": m.string.label,
                "u": m.string.image_px[0],
                "v": m.string.image_px[1],
                "axis": list(m.string.axis_mm),
                "surface": list(m.string.surface_mm),
                "visible": m.string.visible_fraction,
                "spot": m.point,
                "px": m.error_px,
                "mm": m.error_mm,
                "of": m.of,
                "mislabelled": m.mislabelled,
            }
            for m in c.matches
        ],
        "false": list(c.false_points),
        "statistics": statistics_json(summarise([c])),
    }


def statistics_json(s: Statistics) -> dict[str, Any]:
    """Statistics for the page; null where there is no number."""
    return {
        "visible": s.visible,
        "found": s.found,
        "missed": s.missed,
        "false": s.false,
        "mislabelled": s.mislabelled,
        "rms": finite(s.rms_mm),
        "bias": [finite(x) for x in s.bias_mm],
        "scatter": [finite(x) for x in s.scatter_mm],
    }
