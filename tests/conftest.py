"""Settings that all tests share."""

import pytest
from hypothesis import settings

# a law does not fail because the machine is busy
settings.register_profile("project", deadline=None, print_blob=True)
settings.load_profile("project")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest test first, so that no worker waits for it alone at the end."""
    items.sort(key=lambda item: "packaging" not in item.nodeid)
