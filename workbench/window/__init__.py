"""The process window: a local page in the browser for tuning detection on saved stripe images."""

from workbench.window.opening import open_session

__all__ = [
    "open_session",
]
