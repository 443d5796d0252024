"""What the page is told when it opens."""

from __future__ import annotations

from typing import Any

from geometry import field_of_view
from workbench.opened import panel
from workbench.window import settings
from workbench.window.session import Session


def overview(session: Session) -> dict[str, Any]:
    """The folder, its images, the sensor, the parameters and what can be done with them."""
    opened = session.opened
    sensor, engine = opened.engine.sensor, opened.engine
    camera = sensor.require_camera()
    return {
        "title": opened.title,
        "folder": str(opened.pictures.root),
        "images": session.images,
        "watched": opened.look is not None,
        "sensor": {
            "name": sensor.name,
            "width": camera.width_px,
            "height": camera.height_px,
            "saturation": camera.saturation_dn,
            "field_of_view": field_of_view(sensor).tolist(),
        },
        "strings": list(engine.strings),
        "panel": panel(engine.model),
        "defaults": engine.model().model_dump(mode="json"),
        "start": opened.start.model_dump(mode="json"),
        "has_truth": bool(opened.truth),
        "can_calibrate": opened.calibrate is not None,
        "no_calibration": opened.no_calibration,
        "settings_folder": str(opened.settings_folder),
        "settings": settings.names(opened.settings_folder),
    }
