"""What the data can not tell apart, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Solution
from calib.engine import Result, reduced, scaled_solve

Array = NDArray[np.float64]

_NULL = 1e-9  # share of a column that is left once others took what they can
_NULL_EIGENVALUE = 1e-8
_TAKES_PART = 0.04  # of the projector onto the null directions: 0.2 of a direction's unit vector in each of two


def weak_directions(solution: Solution) -> tuple[str, ...]:
    """Estimated robot parameters that the data do not determine, why, and what holds them (their priors)."""
    estimated = solution.applied
    if not np.any(estimated):
        return ()
    parameters = solution.bundle.hands.robot.parameters
    labels = [p.symbol for p, e in zip(parameters, estimated, strict=True) if e]
    full, no_jigs, no_scp = _informations(solution.result, estimated)
    by_jigs = np.diag(no_jigs) < _NULL * np.diag(full)
    by_scp = ~by_jigs & (np.diag(no_scp) < _NULL * np.diag(full))
    out = []
    if np.any(by_jigs):
        out.append(
            f"{_list(labels, by_jigs)}: never seen, the jig's unknown places take it (prior kept)",
        )
    if np.any(by_scp):
        out.append(f"{_list(labels, by_scp)}: the same as a change of the SCP (prior kept)")
    rest = ~by_jigs & ~by_scp
    out += _combinations([n for n, r in zip(labels, rest, strict=True) if r], no_scp[np.ix_(rest, rest)])
    return tuple(out)


def _informations(result: Result, estimated: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Information of the data alone on the estimated parameters: raw, without places and shape, without SCP too."""
    u = result.unknowns
    robot = u.indices("robot", estimated)
    blocks = [b for b in u.common if b.name not in {"scp", "robot"}]
    shape = np.concatenate([u.indices(b.name, b.free) for b in blocks])
    prior = np.diag(1 / u.sigma[robot] ** 2)
    schur, _ = reduced(result.normal)
    raw = result.normal.common[np.ix_(robot, robot)] - prior
    no_places = _without(schur, robot, shape) - prior
    no_scp = _without(schur, robot, np.concatenate([u.indices("scp"), shape])) - prior
    return raw, no_places, no_scp


def _without(matrix: Array, keep: NDArray[np.intp], drop: NDArray[np.intp]) -> Array:
    if not len(drop):
        return matrix[np.ix_(keep, keep)]
    cross = matrix[np.ix_(keep, drop)]
    return np.asarray(matrix[np.ix_(keep, keep)] - cross @ scaled_solve(matrix[np.ix_(drop, drop)], cross.T))


def _combinations(labels: list[str], information: Array) -> list[str]:
    """Null directions of the scaled information, each as the parameters that take part."""
    if not labels:
        return []
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, vectors = np.linalg.eigh(information * scale[:, None] * scale)
    null = vectors[:, values < _NULL_EIGENVALUE]
    onto = null @ null.T  # the same whatever basis of the null space LAPACK gave
    out = []
    for taking_part in _connected(np.abs(onto) > _TAKES_PART):
        names = _list(labels, taking_part)
        parallel = all(n.startswith("d") for n in names.split(", "))
        why = "their axes are parallel, only the sum shows" if parallel else "only a combination shows"
        out.append(f"{names}: {why} (priors share it)")
    return out


def _connected(links: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """The groups (N,) of what is linked (N, N), by their first members; what has no link is in none."""
    left, out = np.any(links, axis=1), []
    while np.any(left):
        group = np.zeros(len(links), dtype=bool)
        group[int(np.argmax(left))] = True
        while np.any(more := np.any(links[group], axis=0) & ~group):
            group |= more
        out.append(group)
        left &= ~group
    return out


def _list(labels: list[str], mask: NDArray[np.bool_]) -> str:
    return ", ".join(n for n, m in zip(labels, mask, strict=True) if m)
