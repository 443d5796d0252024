"""What the same inputs gave when somebody last looked: a change of any figure of a result is seen, wanted or not.

``pinned(result)`` in a test compares all numbers and sentences of a result with those kept in tests/figures under the
test's own name; of a sentence the words exactly, its numbers as numbers. A change that is meant is looked at and kept
by ``PIN=1 python -m pytest tests/…``; what makes the figures right is for the other tests to say.
"""

from __future__ import annotations

import json
import os
import re
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

KEPT = Path(__file__).parent / "figures"
SMALL = 1e-6  # numbers below it count by their size, others by their digits
_NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_FOLDER = re.compile(
    r"[^\s\"']*/pytest-of-[^/]+/pytest-\d+/(?:popen-gw\d+/)?[^/\s\"']+"
)  # a test's own, of another name every time
_asked: Counter[str] = Counter()  # how often a test has asked
AGREE = 3e-4  # of a number's digits, in the mean of a part: three times what other processors' rounding makes of it


def pinned(result: object) -> None:
    """AssertionError with the parts of a result whose figures are not those that are kept."""
    path, test = os.environ["PYTEST_CURRENT_TEST"].rsplit(" ", 1)[0].split("::", 1)
    _asked[test] += 1
    test += f" {_asked[test]}" if _asked[test] > 1 else ""
    file = KEPT / f"{Path(path).parent.name}_{Path(path).stem.removeprefix('test_')}.json"
    kept = json.loads(file.read_text()) if file.exists() else {}
    found = {name: [*_summed(list(_numbers(part))), *_said(list(_words(part)))] for name, part in _parts(result)}
    if os.environ.get("PIN"):
        kept[test] = found
        file.parent.mkdir(exist_ok=True)
        lines = (f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(kept.items()))
        file.write_text("{\n" + ",\n".join(lines) + "\n}\n")
        return
    assert test in kept, f"no figures are kept of {test}: PIN=1 keeps them"
    assert found.keys() == kept[test].keys()
    other = {name: (kept[test][name], now) for name, now in found.items() if not _same(kept[test][name], now)}
    assert not other, f"figures (kept, now) that changed: {other}"


def _parts(result: object) -> Iterator[tuple[str, object]]:
    """The named parts of a result."""
    if isinstance(result, Mapping):
        yield from ((str(k), v) for k, v in result.items())
    elif is_dataclass(result):
        yield from ((f.name, getattr(result, f.name)) for f in fields(result) if not f.name.startswith("_"))
    else:
        yield "value", result


def _numbers(part: Any) -> Iterator[np.ndarray]:
    """All numbers of a part, in their order."""
    if isinstance(part, bool | int | float | np.generic | np.ndarray):
        values = np.asarray(part)
        if values.dtype.kind in "biuf":
            yield values.astype(float).ravel()
    elif isinstance(part, Mapping):
        for value in part.values():
            yield from _numbers(value)
    elif isinstance(part, Sequence) and not isinstance(part, str | bytes):
        for value in part:
            yield from _numbers(value)
    elif is_dataclass(part):
        for _, value in _parts(part):
            yield from _numbers(value)


def _words(part: Any) -> Iterator[str]:
    """All that a part says in words, in their order."""
    if isinstance(part, str):
        yield part
    elif isinstance(part, np.ndarray) and part.dtype.kind == "U":
        yield from part.ravel().tolist()
    elif isinstance(part, Mapping):
        for name, value in part.items():
            yield from _words(name)
            yield from _words(value)
    elif isinstance(part, Sequence) and not isinstance(part, bytes):
        for value in part:
            yield from _words(value)
    elif is_dataclass(part):
        for _, value in _parts(part):
            yield from _words(value)


def _said(words: list[str]) -> list[float]:
    """Of words without their numbers a checksum, and the sums of the numbers; nothing where nothing is said."""
    text = _FOLDER.sub("", "\n".join(words))
    if not text:
        return []
    numbers = [float(n.replace("−", "-")) for n in _NUMBER.findall(text)]
    return [zlib.crc32(_NUMBER.sub("#", text).encode()), *_summed([np.array(numbers)])[2:]]


def _summed(numbers: list[np.ndarray]) -> list[float]:
    """How many numbers, how many of them finite, and two sums over their digits."""
    values = np.concatenate([np.zeros(0), *numbers])
    finite = np.isfinite(values)
    digits = np.where(finite, np.sign(values) * np.log1p(np.abs(np.where(finite, values, 0.0)) / SMALL), 0.0)
    weights = np.random.default_rng(len(values)).uniform(0.5, 1.5, (2, len(values)))
    weights[1] *= np.random.default_rng(1 + len(values)).choice([-1.0, 1.0], len(values))
    return [len(values), int(finite.sum()), *(round(float(w @ digits), 6) for w in weights)]


def _same(kept: list[float], now: list[float]) -> bool:
    """Whether figures and, where they were kept with them, sentences are the same."""
    near = np.allclose(kept[2:4], now[2:4], rtol=0, atol=AGREE * max(1.0, kept[0]) ** 0.5)
    told = kept[4:5] in ([], now[4:5]) and np.allclose(kept[5:], now[5:][: len(kept[5:])], rtol=0, atol=AGREE)
    return kept[:2] == now[:2] and bool(near) and bool(told)
