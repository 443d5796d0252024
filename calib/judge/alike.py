"""The answer of hand poses to a surface with all points weighted alike: no model of noise stands behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, OnTarget, Solution, solve_bundle
from calib.engine import Result
from calib.figures import OffsetsFromTarget
from calib.judge.jackknife import jackknife_covariance
from calib.result import EqualWeights
from calib.surface import condensed
from geometry import Frame, SheetPoints, State, Surface

Array = NDArray[np.float64]

_EXACT_MM, _EXACT_DEG = 1e-4, 1e-6  # of the hand: so much less than any point's that the points alone weigh
_ASLANT = 0.05  # sine of the angle between sheet and surface: flatter ones have no section to speak of
_ROUNDS = 3  # of weights by the slant that the last solution has; they hardly change in the second


def equal_weights(solution: Solution, used: tuple[Frame, ...], raw: Mapping[int, Frame]) -> EqualWeights | None:
    """Every point on the target weighted alike, with the delete-one jackknife's covariance; None where it settles not.

    Of poses at one place: solution, used, raw are those of `left_out`. It is what is compared with figures of others,
    and needs no noise to be known; weights by a noise that holds do better.
    """
    frames = tuple(f for f, out in zip(used, solution.frame_outlier, strict=True) if not out)
    if not isinstance(solution.bundle.terms[0].target, Surface):
        return None
    plain, state = _bundle(solution, frames, raw), solution.result.state
    try:
        for _ in range(_ROUNDS):
            bundle = replace(plain, terms=tuple(_by_distance(t, state) for t in plain.terms))
            whole = _solved(bundle, state)
            state = whole.state
    except np.linalg.LinAlgError:
        return None
    if not whole.converged:
        return None
    every = np.arange(len(frames))
    shifts, left, inside = [], [], []
    for i, f in enumerate(frames):
        inside.append(_squares(bundle, raw[f.number], i, whole.state))
        try:
            part = _solved(bundle.at_frames(every != i), whole.state)
        except np.linalg.LinAlgError:
            return None
        left.append(_squares(bundle, raw[f.number], i, part.state))
        shifts.append((whole.state.pose("scp").inverse() @ part.state.pose("scp")).log())
    rms, left_rms = (float(np.sqrt(np.mean(np.concatenate(s)))) for s in (inside, left))
    return EqualWeights(whole.state.pose("scp"), jackknife_covariance(np.array(shifts)), rms, left_rms)


def _bundle(solution: Solution, frames: tuple[Frame, ...], raw: Mapping[int, Frame]) -> Bundle:
    """The problem of the same frames with points of one variance each, and hands that are exact."""
    alike = []
    for f in frames:
        axis = raw[f.number].axis
        alike.append(replace(f, axis=replace(axis, cov_yz_mm2=np.tile(np.eye(2), (len(axis), 1, 1)))))
    small = condensed(alike, {n: solution.bundle.target_at(n) for n in solution.bundle.locations}).frames
    kept = solution.bundle.at_frames(~solution.frame_outlier).with_axes([f.axis for f in small])
    exact = np.diag(np.square([_EXACT_MM] * 3 + [np.deg2rad(_EXACT_DEG)] * 3))
    return kept.with_noise(1.0, np.broadcast_to(exact, (len(frames), 6, 6)).copy())


def _by_distance(term: OnTarget, state: State) -> OnTarget:
    """The term with variances of points such that it is their distances from the surface that are weighted alike.

    Where the sheet meets the surface aslant, a point in the sheet moves its distance by less than itself.
    """
    by_point = term.linearise(state).by_point
    if by_point is None or by_point.shape[2] != 1:
        return term
    slant = np.maximum(np.sum(by_point[:, :, 0] ** 2, axis=-1), _ASLANT**2)
    cov = term.points.cov_mm2 / np.where(term.points.present, slant, 1.0)[..., None, None]
    return replace(term, points=replace(term.points, cov_mm2=cov))


def _solved(bundle: Bundle, state: State) -> Result:
    return solve_bundle(bundle.estimating(np.zeros(len(bundle.estimated), dtype=bool)), state)


def _squares(bundle: Bundle, frame: Frame, i: int, state: State) -> Array:
    """Squared distances (N,) of all of one frame's points from the target where a solution has it."""
    term = bundle.terms[0]
    target = term.target
    if isinstance(target, Surface):
        target = target.shaped(state.vector(term.shape_block))
    points = SheetPoints.of([frame.axis], target.features)
    hand = bundle.hands.pose(state.vector("robot"))[i : i + 1]
    seen = points.present
    at = (hand @ state.pose("scp") @ points.xyz_mm)[seen]
    term_of = OffsetsFromTarget(at, points.feature[seen], target)
    residual = term_of.residual(State({"target": state.pose(term.place_block)[0]}))
    return np.asarray(np.sum(residual**2, axis=-1))
