"""What the page is told when it opens."""

from __future__ import annotations

from typing import Any

from workbench.cell import field_of_view_of
from workbench.opened import ProfileRecords, panel
from workbench.window import settings
from workbench.window.session import Session


def overview(session: Session) -> dict[str, Any]:
    """The folder, its images, the sensor, the parameters and what can be done with them."""
    opened = session.opened
    sensor, engine = opened.engine.sensor, opened.engine
    camera, outline = sensor.camera, field_of_view_of(sensor) if opened.plane_known else None
    return {
        "opened": session.id,
        "title": opened.title,
        "folder": str(opened.pictures.root),
        "images": session.images(),
        "watched": opened.look is not None,
        "has_images": not isinstance(opened.pictures, ProfileRecords),
        "plane": opened.plane_known,
        "board": getattr(engine, "boards", None) is not None,
        "skipped": list(opened.skipped),
        "sensor": {
            "name": sensor.name,
            "width": camera.width_px if camera else 0,
            "height": camera.height_px if camera else 0,
            "saturation": camera.saturation_dn if camera else 255,
            "field_of_view": [] if outline is None else outline.tolist(),
        },
        "strings": list(engine.strings),
        "panel": panel(engine.model),
        "defaults": engine.model().model_dump(mode="json"),
        "start": opened.start.model_dump(mode="json"),
        "has_truth": bool(opened.truth),
        "can_calibrate": opened.calibrator is not None,
        "no_calibration": opened.no_calibration,
        "can_search": opened.search is not None,
        "can_reopen": opened.reopen is not None,
        "settings_folder": str(opened.settings_folder),
        "settings": settings.names(opened.settings_folder),
    }
