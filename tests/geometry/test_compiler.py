"""Which kernels are kept where, what their code may assume, and what makes a kept one stale; in this process."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from geometry import compiler
from geometry.compiler import KernelCacheLocator, dispatcher

Plain = Callable[[float], float]


def double(x: float) -> float:
    """A function of a file."""
    return 2 * x


def _typed() -> Plain:
    names: dict[str, Plain] = {}
    exec(compile("def double(x): return 2 * x", "<stdin>", "exec"), names)  # noqa: S102 - as at a prompt
    return names["double"]


def _made(function: Plain, *, fastmath: bool = False, inline: bool = False) -> object:
    return dispatcher(function, fastmath=fastmath, inline=inline, parallel=False)


def test_a_function_of_a_file_is_kept_and_one_typed_at_a_prompt_is_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(compiler._settings, "CACHE_DIR", str(tmp_path))
    kept, typed = _made(double), _made(_typed())
    assert isinstance(kept._cache, compiler._KernelCache)  # type: ignore[attr-defined]
    assert not isinstance(typed._cache, compiler._KernelCache)  # type: ignore[attr-defined]
    assert kept(3.0) == typed(3.0) == 6.0  # type: ignore[operator]
    (index,) = tmp_path.rglob("*.nbi")
    assert index.name.startswith("test_compiler.double-")


def test_where_nothing_can_be_kept_it_is_said_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(KernelCacheLocator, "from_function", classmethod(lambda *_: None))
    monkeypatch.setattr(compiler, "_said", False)
    with caplog.at_level(logging.WARNING):
        assert _made(double)(2.0) == _made(double)(2.0) == 4.0  # type: ignore[operator]
    (record,) = caplog.records
    assert f"can be kept neither in {Path(__file__).parent} nor" in record.getMessage()


def test_numbas_own_locators_are_back_afterwards() -> None:
    before = compiler._settings.CACHE_LOCATOR_CLASSES
    with compiler._own_cache(double) as can_keep:
        assert can_keep
        assert compiler._settings.CACHE_LOCATOR_CLASSES == "geometry.compiler.KernelCacheLocator"
    assert before == compiler._settings.CACHE_LOCATOR_CLASSES


def test_compiled_code_may_take_values_for_finite_and_nothing_else() -> None:
    """What reorders sums or takes reciprocals gives other last bits on another processor."""
    options = _made(double, fastmath=True).targetoptions  # type: ignore[attr-defined]
    assert options["fastmath"] == {"nnan", "ninf", "nsz"}
    plain = _made(double).targetoptions  # type: ignore[attr-defined]
    assert plain["fastmath"] is False
    assert plain["error_model"] == "numpy"
    assert plain["nogil"]
    assert (plain["inline"], _made(double, inline=True).targetoptions["inline"]) == ("never", "always")  # type: ignore[attr-defined]


class Colour(Enum):
    """Of two."""

    RED = 1
    BLUE = 2


class Pair(NamedTuple):
    """Of two numbers."""

    a: float
    b: float


def test_what_stale_code_is_told_by() -> None:
    """Plain data by value, arrays by all they hold, classes and modules by their source; functions of others not."""
    told = [
        1, 1.0, True, "1", (1, 2), (1, (2,)), np.zeros(2), np.zeros(3), np.zeros(2, np.float32), np.zeros((1, 2)),
        np.ones(2), Colour.RED, Colour, np.float32(1.5), np.dtype(np.int8),
    ]  # fmt: skip
    prints = [compiler._fingerprint(value) for value in told]
    assert len(set(prints)) == len(prints)
    assert prints == [compiler._fingerprint(value) for value in told]
    assert compiler._fingerprint(Pair) == compiler._module_stamp(__name__)
    assert compiler._fingerprint(np.sin) == compiler._fingerprint(sys) == ""


def test_stale_files_of_a_kernel_go_and_those_of_others_stay(tmp_path: Path) -> None:
    locator = KernelCacheLocator(double, __file__, str(tmp_path / "kept"))
    locator.ensure_cache_path()
    own = f"test_compiler.double-{locator.get_disambiguator()}.py311.nbi"
    old = ["test_compiler.double-0123456789abcdef.py311.nbi", "test_compiler.double-0123456789abcdef.py311.1.nbc"]
    for name in (own, *old, "test_compiler.doubled-0123456789abcdef.py311.nbi"):
        (tmp_path / "kept" / name).touch()
    locator.ensure_cache_path()
    assert {f.name for f in (tmp_path / "kept").iterdir()} == {own, "test_compiler.doubled-0123456789abcdef.py311.nbi"}
    assert len(locator.get_disambiguator()) == 16
    assert locator.get_source_stamp().startswith(locator.get_disambiguator())
    assert locator.get_cache_path() == str(tmp_path / "kept")
