"""The process window: images, profiles and boards in the browser, measured by one recipe, calibrated and compared."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names

if TYPE_CHECKING:
    from workbench.window.calibrator import Search
    from workbench.window.opening import open_session
    from workbench.window.session import Opened

__all__ = ["Opened", "Search", "open_session"]

# the page is served before what measures is loaded
__getattr__ = lazy_names(
    __name__,
    {
        "workbench.window.calibrator": ("Search",),
        "workbench.window.opening": ("open_session",),
        "workbench.window.session": ("Opened",),
    },
)
