"""A target of another size than stated: measured by the data where they contradict the number in the file."""

from __future__ import annotations

from dataclasses import replace

from calib.stages.preparation import prepare
from calib.stages.setup import CONTRADICTED, Prepared
from calib.surface import contradicted_diameter, estimated_diameter, with_free_diameters


def of_true_size(stated: Prepared) -> tuple[Prepared, str]:
    """The same with the sizes estimated and a sentence on them, where the data contradict what was stated.

    Where they do not, or nothing better comes of it, what was given and no sentence.
    """
    solution, verdict = stated.solved.solution, stated.solved.verdict
    same = contradicted_diameter(solution, stated.setup.config) if solution is not None else None
    unknown = solution is None or not verdict.trustworthy
    free = with_free_diameters(stated.setup.target, {f.location for f in stated.given})
    if free is None or (same is None and not (unknown and verdict.code in CONTRADICTED)):
        return stated, ""
    freed = prepare(replace(stated.setup, target=free), stated.given)
    again = freed.solved
    if again.solution is None or not again.verdict.trustworthy:
        return stated, ""
    found = estimated_diameter(again.solution, stated.setup.target)
    return (stated, "") if found is None else (freed, found.text)
