"""Named blocks of unknowns, the state that holds their values, and what a term of evidence says of them.

A solver knows blocks and terms and nothing else: what is measured, on which target, by which robot stays inside the
terms. Nobody outside this file knows at which position of a vector a block stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Block:
    """One named group of unknowns: a pose or a vector, common to all data or with a copy for each of its members.

    Parameters
    ----------
    name : str
        "scp", "robot", "shape", "target" …
    sigma : ndarray (n,)
        Prior σ of every component about its start: 0 where it is known exactly, infinite where nothing is known.
    free : ndarray (n,) of bool
        Which components are estimated. Those that are not and have a finite σ above 0 are *considered*: they keep
        their start, and their σ is carried into every covariance. The rest is fixed.
    members : tuple of str
        Names of the copies ("A", "B" …) of a block that each datum meets one of, such as the place of a target at a
        location. Copies are told apart by no other term, so that the solver eliminates them one by one. Empty for a
        block common to all data.
    is_pose : bool
        A pose (n = 6, tangent T·Exp(ξ), translation [mm] then rotation [rad]) or a plain vector.
    labels : tuple of str
        Names of the components, where they have any.
    """

    name: str
    sigma: Array
    free: Mask
    members: tuple[str, ...] = ()
    is_pose: bool = False
    labels: tuple[str, ...] = ()

    @staticmethod
    def pose(
        name: str, members: tuple[str, ...] = (), sigma: ArrayLike = np.inf, free: ArrayLike = True, copies: int = 1
    ) -> Block:
        """A pose, or ``copies`` poses that go together (two sockets of one base, say), all free unless told."""
        n = 6 * copies
        return Block(name, _filled(sigma, n), _filled(free, n).astype(bool), members, is_pose=copies == 1)

    @staticmethod
    def vector(
        name: str,
        sigma: ArrayLike,
        free: ArrayLike = True,
        members: tuple[str, ...] = (),
        labels: tuple[str, ...] = (),
    ) -> Block:
        """A vector with as many components as ``sigma``; a component known exactly (σ = 0) is never free."""
        s = np.atleast_1d(np.asarray(sigma, dtype=float))
        return Block(name, s, _filled(free, len(s)).astype(bool) & (s > 0), members, labels=labels)

    @property
    def size(self) -> int:
        """The number of components n of one copy."""
        return len(self.sigma)

    @property
    def considered(self) -> Mask:
        """Which components (n,) keep their start and pass their σ on."""
        return ~self.free & (self.sigma > 0) & np.isfinite(self.sigma)

    @cached_property
    def prior_weight(self) -> Array:
        """Information (n,) of the priors of what is free."""
        return prior_weight(self.sigma, self.free)

    def at_rest(self) -> Pose | Array:
        """The block's value before anything is known: identities, zeros."""
        shape = (len(self.members),) if self.members else ()
        if self.is_pose:
            return Pose(np.broadcast_to(np.eye(3), (*shape, 3, 3)).copy(), np.zeros((*shape, 3)))
        return np.zeros((*shape, self.size))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """All blocks of a problem; ``u["robot"]`` is the slice of a block among the common unknowns."""

    blocks: tuple[Block, ...]

    def __post_init__(self) -> None:
        """InputError where two blocks bear one name."""
        names = [b.name for b in self.blocks]
        if len(set(names)) != len(names):
            raise InputError(f"two blocks of unknowns are called {max(names, key=names.count)}")

    @cached_property
    def common(self) -> tuple[Block, ...]:
        """The blocks that all data share, in their order."""
        return tuple(b for b in self.blocks if not b.members)

    @cached_property
    def separate(self) -> tuple[Block, ...]:
        """The blocks of which every datum meets one copy."""
        return tuple(b for b in self.blocks if b.members)

    @cached_property
    def _slices(self) -> dict[str, slice]:
        ends = np.cumsum([0, *(b.size for b in self.common)])
        return {b.name: slice(int(i), int(j)) for b, i, j in zip(self.common, ends[:-1], ends[1:], strict=True)}

    def __getitem__(self, name: str) -> slice:
        """Where a common block stands."""
        return self._slices[name]

    def __contains__(self, name: object) -> bool:
        """Whether there is a block of this name."""
        return any(b.name == name for b in self.blocks)

    def block(self, name: str) -> Block:
        """The block of a name."""
        return next(b for b in self.blocks if b.name == name)

    @cached_property
    def size(self) -> int:
        """The number C of common unknowns."""
        return sum(b.size for b in self.common)

    @cached_property
    def sigma(self) -> Array:
        """Prior σ (C,) of the common unknowns."""
        return np.concatenate([np.zeros(0), *(b.sigma for b in self.common)])

    @cached_property
    def free(self) -> Mask:
        """Which common unknowns (C,) are estimated."""
        return np.concatenate([np.zeros(0, dtype=bool), *(b.free for b in self.common)])

    @cached_property
    def considered(self) -> Mask:
        """Which common unknowns (C,) are considered."""
        return np.concatenate([np.zeros(0, dtype=bool), *(b.considered for b in self.common)])

    @cached_property
    def prior_weight(self) -> Array:
        """Information (C,) of the priors of what is free; none where nothing is known."""
        return prior_weight(self.sigma, self.free)

    def indices(self, name: str, chosen: Mask | None = None) -> Index:
        """Positions of a common block among the common unknowns, or of its ``chosen`` (n,) components."""
        every = np.arange(self.size)[self[name]]
        return every if chosen is None else every[chosen]

    def with_free(self, **free: ArrayLike) -> Unknowns:
        """The unknowns with other components of some blocks free; what is known exactly stays fixed."""
        return Unknowns(
            tuple(
                replace(b, free=_filled(free[b.name], b.size).astype(bool) & (b.sigma > 0)) if b.name in free else b
                for b in self.blocks
            )
        )


@dataclass(frozen=True, eq=False)
class State:
    """Values of all blocks by name: a Pose or a vector, with a leading axis (L) for a block that has L members."""

    values: Mapping[str, Pose | Array]

    def pose(self, name: str) -> Pose:
        """The value of a block of poses."""
        value = self.values[name]
        if not isinstance(value, Pose):
            raise InputError(f"the block {name} holds numbers, not a pose")
        return value

    def vector(self, name: str) -> Array:
        """The value of a block of numbers."""
        value = self.values[name]
        if isinstance(value, Pose):
            raise InputError(f"the block {name} holds a pose, not numbers")
        return value

    def moved(self, unknowns: Unknowns, step: Step) -> State:
        """The state after a step: T·Exp(ξ) of poses, sums of vectors."""
        steps = {b.name: step.common[unknowns[b.name]] for b in unknowns.common} | dict(step.separate)
        return State({name: _moved(value, steps[name]) for name, value in self.values.items()})

    def with_value(self, name: str, value: Pose | Array) -> State:
        """The state with another value of one block."""
        return State({**self.values, name: value})


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the common unknowns (C,) and of the members of each separate block (L, n), by name.

    decrement: its squared length in units of σ.
    """

    common: Array
    separate: Mapping[str, Array]
    decrement: float


@dataclass(frozen=True, eq=False)
class Linearised:
    """A term at one state: G groups of r residuals; groups are independent of one another.

    Parameters
    ----------
    residual : ndarray (G, r)
        Zero where there is no evidence.
    jacobian : mapping of str to ndarray (G, r, n)
        By the tangent of each block that the term depends on; blocks left out have no influence.
    covariance : ndarray (G, r, r)
        Of the residuals.
    member : mapping of str to ndarray (G,) of int
        Which copy of each separate block a group meets.
    """

    residual: Array
    jacobian: Mapping[str, Array]
    covariance: Array
    member: Mapping[str, Index] = field(default_factory=dict)


class Term(Protocol):
    """One kind of evidence. A solver sums terms and never asks what they are."""

    def linearise(self, state: State) -> Linearised:
        """Residuals at a state, with their Jacobians and covariance."""


def prior_weight(sigma: Array, free: Mask) -> Array:
    """1/σ² of what is free and has a prior, else 0."""
    known = free & (sigma > 0)
    return np.where(known, 1 / np.where(known, sigma, 1.0) ** 2, 0.0)


def _moved(value: Pose | Array, step: Array) -> Pose | Array:
    if not isinstance(value, Pose):
        return np.asarray(value + step)
    return value @ Pose.exp(step) if np.any(step) else value


def _filled(values: ArrayLike, n: int) -> Array:
    return np.array(np.broadcast_to(np.asarray(values, dtype=float), n))
