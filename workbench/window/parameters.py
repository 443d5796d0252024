"""Parameters as the page sends them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from pydantic import BaseModel, ValidationError

from geometry import InputError

MAX_CONFIG_CHARS = 64 * 1024


@dataclass(frozen=True)
class HashedConfig:
    """One set of parameters and the hash that its answers carry."""

    model: BaseModel
    hash: str


class ParameterError(InputError):
    """Parameters that the model refuses: each problem by key."""

    def __init__(self, problems: dict[str, str]) -> None:
        super().__init__("; ".join(f"{key}: {text}" for key, text in problems.items()))
        self.problems = problems


def hash_of(text: str) -> str:
    """The first 16 hex digits of the SHA-256 of the parameters' text, as the page computes it too."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def parse(model: type[BaseModel], text: str) -> HashedConfig:
    """Parameters from the page's JSON text; ParameterError that names each wrong key."""
    if len(text) > MAX_CONFIG_CHARS:
        raise InputError("the parameters are too long to be parameters")
    try:
        return HashedConfig(model.model_validate_json(text), hash_of(text))
    except ValidationError as error:
        problems = {".".join(map(str, p["loc"])) or "parameters": p["msg"] for p in error.errors(include_url=False)}
        raise ParameterError(problems) from None
