"""Profiles as makers' sensors deliver them: files recognised, read, written; points checked against the sensor."""

from workbench.profiles.checked import CheckedProfile, checked_profile
from workbench.profiles.conversion import convert
from workbench.profiles.files import READERS, SUFFIXES, WRITERS, read_scan_lines, write_scan_lines
from workbench.profiles.of_frames import FrameProfiles, frame_profiles
from workbench.profiles.scan_line import ScanLine, Told
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
    "frame_profiles",
    "open_source",
    "read_scan_lines",
    "write_scan_lines",
]
