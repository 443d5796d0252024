"""Profiles as makers' sensors deliver them: files recognised, read, written; points checked against the sensor."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names
from workbench.profiles.scan_line import SUFFIXES, ScanLine, Told

if TYPE_CHECKING:
    from workbench.profiles.checked import CheckedProfile, checked_profile
    from workbench.profiles.conversion import convert
    from workbench.profiles.files import READERS, WRITERS, read_scan_lines, write_scan_lines
    from workbench.profiles.formats.keyence_lj_x import fitting_unit
    from workbench.profiles.of_frames import FrameProfiles, frame_profiles
    from workbench.profiles.source import open_source

__all__ = [
    "READERS",
    "SUFFIXES",
    "WRITERS",
    "CheckedProfile",
    "FrameProfiles",
    "ScanLine",
    "Told",
    "checked_profile",
    "convert",
    "fitting_unit",
    "frame_profiles",
    "open_source",
    "read_scan_lines",
    "write_scan_lines",
]

# datasets of images need no format of profiles
__getattr__ = lazy_names(
    __name__,
    {
        "workbench.profiles.checked": (
            "CheckedProfile",
            "checked_profile",
        ),
        "workbench.profiles.conversion": ("convert",),
        "workbench.profiles.files": (
            "READERS",
            "WRITERS",
            "read_scan_lines",
            "write_scan_lines",
        ),
        "workbench.profiles.formats.keyence_lj_x": ("fitting_unit",),
        "workbench.profiles.of_frames": (
            "FrameProfiles",
            "frame_profiles",
        ),
        "workbench.profiles.source": ("open_source",),
    },
)
