"""Settings that all tests share."""

from typing import Any

import pytest
from hypothesis import settings

# a law does not fail because the machine is busy
settings.register_profile("project", deadline=None, print_blob=True)
settings.load_profile("project")

# what their tests share, a cell and a browser, a finished run, is made once where one process runs them all
TOGETHER = ("tests/window/", "tests/campaign/")
FIRST = ("packaging", *TOGETHER)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest tests first, so that no worker waits for them alone at the end."""
    items.sort(key=lambda item: not any(name in item.nodeid for name in FIRST))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With ``--dist loadscope`` a worker takes a module's tests, and of some folders all as one."""
    if config.getvalue("dist") != "loadscope":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            folder = next((name for name in TOGETHER if nodeid.startswith(name)), None)
            return folder or str(super()._split_scope(nodeid))

    return Scheduling(config, log)
