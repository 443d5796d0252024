"""Same seed, same bytes, whatever the processor: the library kernels are chosen as other machines would choose them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.workbench.same_bytes import ENVIRONMENTS, REFERENCE, WORKS, differing, digests

pytestmark = pytest.mark.processes


def test_a_recorded_cell_is_the_same_with_old_libraries(tmp_path: Path) -> None:
    """Planned, rendered and extracted with BLAS, numpy, glibc and OpenCV as on a processor without AVX2.

    The compiled kernels stay this processor's (compiling them anew takes minutes): see the slow test.
    """
    names = (REFERENCE, "old libraries")
    with ThreadPoolExecutor(2) as pool:
        one, other = pool.map(lambda name: digests(name, tmp_path / name, tmp_path / "numba", "short"), names)
    assert any(path.endswith(".png") for path in one)
    assert differing(one, other) == []


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """All works as this machine does them."""
    return digests(REFERENCE, tmp_path_factory.mktemp("reference"), Path(), *WORKS)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What numba compiled for another processor, once."""
    return tmp_path_factory.mktemp("numba")


@pytest.mark.slow
@pytest.mark.parametrize("environment", [name for name in ENVIRONMENTS if name != REFERENCE])
def test_demo_cell_and_campaign_are_the_same_everywhere(
    environment: str, reference: dict[str, str], cache: Path, tmp_path: Path
) -> None:
    """Every file but OpenGL's picture, and what is printed; the campaign with as many workers as threads."""
    assert differing(reference, digests(environment, tmp_path, cache, *WORKS)) == []
