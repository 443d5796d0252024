"""Text for consoles and files that know few characters, such as one of Windows' code pages."""

from __future__ import annotations

import codecs
import io
import sys

NAME = "perceptron-emu"  # of the error handler
SPELLED = {
    "→": "->", "←": "<-", "−": "-", "–": "-", "…": "...", "≤": "<=", "≥": ">=", "≈": "~", "±": "+-", "×": "x", "·": "*",
    "°": " deg", "′": "'", "²": "^2", "µ": "u", "σ": "sigma", "χ": "chi", "θ": "theta", "α": "alpha", "β": "beta",
    "τ": "tau", "λ": "lambda", "π": "pi", "ξ": "xi", "Δ": "Delta", "√": "sqrt", "✓": "ok",
}  # fmt: skip


def write_what_the_console_can() -> None:
    """From now on a character that standard output or error can not hold is spelled out, in place of an error."""
    codecs.register_error(NAME, _spelled)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "backslashreplace"):
            stream.reconfigure(errors=NAME)


def _spelled(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(SPELLED.get(c, "?") for c in missing), error.end
