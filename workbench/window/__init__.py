"""The process window: images, profiles and boards in the browser, measured by one recipe, calibrated and compared."""

from workbench.window.calibrator import Search
from workbench.window.opening import open_session

__all__ = ["Search", "open_session"]
