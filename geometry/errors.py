"""The project's errors: each message says what is wrong, where, and what would be right."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

LONGEST_WORD = 80  # that is compared with known ones: the comparison is quadratic in its length
ENDLESS = re.compile(r"[^\s/\\]{300,}")  # no name of a file is so long, no key, no number


class PerceptronEmuError(Exception):
    """Base of every error that the project raises on purpose."""

    def __str__(self) -> str:
        """Tell the message on one line, with what a file holds of endless words cut: a sentence is for people."""
        one_line = super().__str__().replace("\r", "\\r").replace("\n", "\\n")  # a name in a file may have any letter
        return ENDLESS.sub(lambda word: f"{word[0][:LONGEST_WORD]}…", one_line)


class InputError(PerceptronEmuError):
    """Input or arguments that can not be used; nothing was computed (exit code 2)."""


class NoAnswerError(PerceptronEmuError):
    """The input is well formed but no trustworthy answer follows from it (exit code 3)."""


class MissingDependencyError(PerceptronEmuError):
    """An optional library or system component is absent; the message says how to get it (exit code 2)."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A suggestion to stand after a wrong ``word``: ': did you mean "…"?', or nothing where no known word is near."""
    if len(word) > LONGEST_WORD:
        return ""
    close = get_close_matches(word.lower(), names := {k.lower(): k for k in known}, n=1, cutoff=0.6)
    return f': did you mean "{names[close[0]]}"?' if close else ""
