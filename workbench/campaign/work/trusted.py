"""Whose compiled code a campaign runs: numba's kept kernels hold pickles, which execute what their writer likes."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import geometry
from geometry import InputError


def check_cache() -> None:
    """InputError where others can write into a folder from which this process and its workers load compiled code."""
    if sys.platform == "win32":  # rights are told by lists there, and a user's folders are the user's
        return
    named = os.environ.get("NUMBA_CACHE_DIR")
    folders = [Path(named)] if named else [Path(geometry.__file__).parent / "__pycache__"]
    for folder in folders:
        if folder.exists() and (why := _writable_by(folder.stat())):
            raise InputError(
                f"{folder}: {why} can write there, and a campaign's workers run the compiled code that it holds: "
                "take the right away (chmod go-w), or set NUMBA_CACHE_DIR to a folder of yours"
            )


def _writable_by(status: os.stat_result) -> str:
    """Who beside this user and root can write into a folder of such a status, or nothing."""
    if status.st_uid not in (0, os.geteuid()) and os.geteuid() != 0:
        return "its owner, another user,"
    if status.st_mode & stat.S_IWOTH:
        return "everybody"
    if status.st_mode & stat.S_IWGRP and status.st_gid not in (0, os.getegid()):
        return "a group that is not yours"
    return ""
