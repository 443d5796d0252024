"""What the extras of the package bring, and what to say where one is missing."""

from __future__ import annotations

# extra: modules that it brings, what it is for
EXTRAS = {
    "window": (("starlette", "uvicorn"), "the process window, `perceptron-emu tune`"),
    "tune": (("optuna",), "automatic tuning, `perceptron-emu tune --auto`"),
    "campaign": (("joblib", "dask", "pyarrow"), "campaigns of many runs"),
}


def install_hint(module: str | None) -> str | None:
    """How to get a missing module that belongs to an extra; None for any other."""
    for extra, (modules, purpose) in EXTRAS.items():
        if module in modules:
            return f"{module} is missing, for {purpose}: pip install 'perceptron-emu[{extra}]'"
    return None
