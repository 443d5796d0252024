"""The project's errors: each message says what is wrong, where, and what would be right."""

from __future__ import annotations


class PerceptronEmuError(Exception):
    """Base of every error that the project raises on purpose."""


class InputError(PerceptronEmuError):
    """Input or arguments that can not be used; nothing was computed (exit code 2)."""


class NoAnswerError(PerceptronEmuError):
    """The input is well formed but no trustworthy answer follows from it (exit code 3)."""


class MissingDependencyError(PerceptronEmuError):
    """An optional library or system component is absent; the message says how to get it (exit code 2)."""
