"""opencv_yaml: ``scan_line: [x, 0, z, x, 0, z, …]`` as OpenCV's FileStorage writes a vector of points."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from geometry import InputError
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import MAX_POINTS, Source, cell_value

NAME = "opencv_yaml"
_KEY = re.compile(r"^[ \t]*(scan_line\w*)[ \t]*:[^\[\n]*(?:\n[ \t]+\w+:[^\[\n]*){0,4}?\s*\[", re.MULTILINE)


def recognises(source: Source) -> bool:
    """By the key."""
    return not source.is_binary and re.search(r"^[ \t]*scan_line\w*[ \t]*:", source.head, re.MULTILINE) is not None


def read(source: Source, told: Told) -> tuple[ScanLine, ...]:
    """One profile a key that begins with scan_line."""
    text = source.text
    out = []
    for found in _KEY.finditer(text):
        end = text.find("]", found.end())
        if end < 0:
            raise InputError(f"{source.path}: the list of {found[1][:40]} does not end: the file is cut short")
        line = text.count("\n", 0, found.start()) + 1
        words = [w for w in re.split(r"[\s,]+", text[found.end() : end]) if w]
        if len(words) > MAX_POINTS:
            raise InputError(f"{source.path}: holds more than {MAX_POINTS} values")
        values = np.array(
            [cell_value(w, f"{source.path}, {found[1][:40]}, value {k + 1}") for k, w in enumerate(words)]
        )
        if len(values) % 3 or len(values) == 0:
            raise InputError(f"{source.path}, line {line}: {found[1][:40]} has {len(values)} values, triples are right")
        out.append(values.reshape(-1, 3))
    if not out:
        raise InputError(f"{source.path}: holds no list scan_line: [x, 0, z, …]")
    several = len(out) > 1
    return tuple(ScanLine(p[:, 0], p[:, 2], number=k if several else None) for k, p in enumerate(out))


def write(lines: Sequence[ScanLine], told: Told) -> bytes:
    """Nine digits, as OpenCV writes; a missing point keeps its x."""
    out = ["%YAML:1.0", "---"]
    for k, scan in enumerate(lines):
        key = "scan_line" if len(lines) == 1 else f"scan_line_{k}"
        triples = [f"{_text(y)}, 0., {_text(z)}" for y, z in zip(scan.y_mm, scan.z_mm, strict=True)]
        out.append(f"{key}: [ " + ",\n    ".join(triples) + " ]")
    return ("\n".join(out) + "\n").encode()


def _text(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else ".Nan"
