"""A sensor's twin: emulation keys fitted to recorded images, and what still differs between recorded and emulated."""

from workbench.twin.fit import Twin, fit_twin
from workbench.twin.images import find_images
from workbench.twin.keys import Fitted
from workbench.twin.page import twin_object, write_twin

__all__ = ["Fitted", "Twin", "find_images", "fit_twin", "twin_object", "write_twin"]
