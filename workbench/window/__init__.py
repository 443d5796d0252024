"""The process window: images, profiles and boards in the browser, measured by one recipe, calibrated and compared."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.window.calibrator import Search
    from workbench.window.opening import open_session
    from workbench.window.session import Opened

__all__ = ["Opened", "Search", "open_session"]

# the page is served before what measures is loaded
_LAZY = {
    "Opened": "workbench.window.session",
    "Search": "workbench.window.calibrator",
    "open_session": "workbench.window.opening",
}


def __getattr__(name: str) -> object:
    """What measures, imported when first used."""
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
