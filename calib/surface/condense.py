"""A frame's many points on a surface condensed to few, which say as much of its place.

A plane cuts a ball in a circle and a face in a line. To first order in the target's place a line's points tell two
numbers and a circle's three: how far the curve is off at two or three of its places. At the right places these are
independent of one another (Gauss's nodes), so that two or three points with a variance each stand for all.

Neighbouring points of a profile share blur and speckle: how much is read from what is left about the curves, and the
variance of the nodes is larger by that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry import AxisPoints, Frame, Surface, Target, target_at

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_FEWEST = {"line": 4, "circle": 6}  # points of a curve that are worth condensing
_STEPS = 20  # of Gauss and Newton on a circle; from the algebraic one it settles in three to five
_SETTLED_MM = 1e-7
_WEIGHED = 2  # of these steps find the weights
_FLAT_ARC = 1e12  # condition of the moments of points that make no arc
_HALF_THE_DIGITS = 1e-4  # pivot of unit columns whose square has lost eight of sixteen
_LARGEST = 1e4  # radius, of the points' spread: a larger circle is a line
_ALONG_MM = 1e-3  # σ of a node along its curve, where it may lie anywhere
_FEWEST_FREE = 40  # residuals that tell the scale of the noise; with fewer the stated one stays
_LAGS = 400  # of the correlation along a profile, at most; never more than a quarter of a curve's points
_ROUNDS = 10
_MOST_LOST = 0.5  # share of the noise that a fit takes away: with more, the profile is one bend and tells none
_MOST_KEPT = 60  # points of a frame that could not be condensed


@dataclass(frozen=True, eq=False)
class Condensed:
    """Frames with their nodes in place of their points, and the noise that was found along the profiles.

    scale: variance of the points over the stated one. inflation: how many neighbours count as one. dof: residuals that
    this rests on.
    """

    frames: tuple[Frame, ...]
    scale: float = 1.0
    inflation: float = 1.0
    dof: int = 0


@dataclass(frozen=True, eq=False)
class _Curve:
    """A fitted curve of one feature: nodes (p, 2), normals there (p, 2), their variance before scale and inflation.

    whitened (M,): residuals over their σ in the order along the curve; p: what was fitted.
    """

    nodes: Array
    normals: Array
    variance: Array
    whitened: Array
    p: int


def condensed(frames: Sequence[Frame], target: Target | Mapping[str, Target]) -> Condensed:
    """The frames with few points in place of many wherever their target's surface has a section that is known."""
    curves: dict[int, dict[str, _Curve]] = {}
    for f in frames:
        own = target_at(target, f.location)
        if isinstance(own, Surface) and own.section is not None:
            curves[f.number] = _curves(f.axis, own)
    scale, inflation, dof = _noise([c for group in curves.values() for c in group.values()])
    out = tuple(
        replace(f, axis=_nodes(f.axis, curves[f.number], scale * inflation)) if f.number in curves else f
        for f in frames
    )
    return Condensed(out, scale, inflation, dof)


def _curves(axis: AxisPoints, target: Surface) -> dict[str, _Curve]:
    out = {}
    for name in target.features:
        count = axis.label.count(name)
        if target.section is not None and count >= _FEWEST[target.section]:
            mine = slice(None) if count == len(axis) else _points_of(axis, name)
            fit = _line if target.section == "line" else _circle
            found = fit(axis.yz_mm[mine], axis.cov_yz_mm2[mine])
            if found is not None:
                out[name] = found
    return out


def _points_of(axis: AxisPoints, name: str) -> Index:
    """Which points lie on a feature; arrays of a thousand words would cost as much as the fit."""
    count = axis.label.count(name)
    if count in (0, len(axis)):
        return np.arange(count)
    return np.flatnonzero(np.fromiter(map(name.__eq__, axis.label), dtype=bool, count=len(axis)))


def _nodes(axis: AxisPoints, curves: Mapping[str, _Curve], factor: float) -> AxisPoints:
    """Nodes of what was fitted, and the points of what was not, thinned."""
    labels: list[str] = []
    yz, cov = [np.zeros((0, 2))], [np.zeros((0, 2, 2))]
    for name in dict.fromkeys(axis.label):
        if name in curves:
            c = curves[name]
            across = c.normals[:, :, None] * c.normals[:, None, :]
            along = np.eye(2) - across
            yz.append(c.nodes)
            cov.append(factor * c.variance[:, None, None] * across + _ALONG_MM**2 * along)
        else:
            mine = _points_of(axis, name)
            mine = mine[np.unique(np.linspace(0, len(mine) - 1, min(len(mine), _MOST_KEPT)).astype(int))]
            yz.append(axis.yz_mm[mine])
            cov.append(axis.cov_yz_mm2[mine])
        labels += [name] * len(yz[-1])
    n = len(labels)
    return AxisPoints(tuple(labels), np.full(n, -1, dtype=np.intp), np.concatenate(yz), np.concatenate(cov), ("",) * n)


def _line(yz: Array, cov: Array) -> _Curve | None:
    """A line by distance, weighted; nodes at the weighted rms to either side of the middle."""
    first = yz[0]
    y, z = np.ascontiguousarray((yz - first).T)
    parts = _parts(cov)
    weight = np.ones(len(y))
    normal = np.array([0.0, 1.0])
    for _ in range(2):  # the weights need the normal
        total = float(weight.sum())
        middle = np.array([weight @ y, weight @ z]) / total
        dy, dz = y - middle[0], z - middle[1]
        wy, wz = weight * dy, weight * dz
        cross = float(wy @ dz)
        normal = np.linalg.eigh(np.array([[wy @ dy, cross], [cross, wz @ dz]]) / total)[1][:, 0]
        weight = _weight(normal[0], normal[1], parts)
    t = normal[1] * dy - normal[0] * dz
    total = float(weight.sum())
    rms = float(np.sqrt(weight @ (t * t) / total))
    if rms <= 0:
        return None
    nodes = first + middle + rms * np.array([[-1.0], [1.0]]) * [normal[1], -normal[0]]
    whitened = _in_order(t, (normal[0] * dy + normal[1] * dz) * np.sqrt(weight))
    return _Curve(nodes, np.tile(normal, (2, 1)), np.full(2, 2 / total), whitened, 2)


def _parts(cov: Array) -> tuple[Array, Array, Array]:
    """Of covariances (M, 2, 2) the parts that a variance across a direction is made of: yy, twice yz, zz."""
    yy, yz, zz = np.ascontiguousarray(cov.reshape(-1, 4)[:, [0, 1, 3]].T)
    return yy, 2 * yz, zz


def _weight(ny: Array | float, nz: Array | float, parts: tuple[Array, Array, Array]) -> Array:
    """One over the variance along normals."""
    yy, yz, zz = parts
    return np.asarray(1 / np.maximum(ny * (ny * yy + nz * yz) + nz * nz * zz, 1e-12))


def _circle(yz: Array, cov: Array) -> _Curve | None:
    """A circle by distance, weighted; three nodes, one in the middle of the arc."""
    found = _fitted_circle(yz, cov)
    if found is None:
        return None
    centre, radius, weight = found
    away = np.ascontiguousarray((yz - centre).T)
    distance = np.sqrt(away[0] * away[0] + away[1] * away[1])
    mean = away @ weight
    turn = np.arctan2(mean[1], mean[0])  # to the middle of the arc, from which angles are counted
    along = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    cos, sin = along @ away / distance
    triangular = _triangular(np.stack([np.ones_like(cos), 1 - cos, sin]), weight)
    if np.min(np.abs(np.diag(triangular))) < 1e-9 * np.max(np.abs(np.diag(triangular))):
        return None
    inverse = np.linalg.inv(triangular)
    at = _circle_basis(np.zeros(1)) @ inverse
    # where an offset is independent of the one at the first node: a·1 + b (1 - cos φ) + c sin φ = 0
    a, b, c = inverse @ at[0]
    size, phase = np.hypot(b, c), np.arctan2(c, b)  # a + b - size cos(φ + phase) = 0
    if size <= abs(a + b):
        return None
    half = np.arccos((a + b) / size)
    nodes = np.array([0.0, *(np.mod(np.array([half, -half]) - phase + np.pi, 2 * np.pi) - np.pi)])
    spread = _circle_basis(nodes) @ inverse
    normals = np.column_stack([np.cos(nodes + turn), np.sin(nodes + turn)])
    whitened = _in_order(sin / np.maximum(1 + cos, 1e-12), (distance - radius) * np.sqrt(weight))  # of tan φ/2
    return _Curve(centre + radius * normals, normals, np.sum(spread**2, axis=1), whitened, 3)


def _circle_basis(angle: Array) -> Array:
    """What a shift of centre and radius moves points at these angles by, well apart also on a short arc (M, 3)."""
    return np.column_stack([np.ones_like(angle), 1 - np.cos(angle), np.sin(angle)])


def _triangular(rows: Array, weight: Array) -> Array:
    """R (3, 3) with RᵀR the weighted moments of rows (3, M).

    By their Cholesky factor, columns scaled to one; where that loses half of the digits, by Householder's reflections.
    """
    moments = (rows * weight) @ rows.T
    scale = np.sqrt(np.diag(moments))
    try:
        factor = np.linalg.cholesky(moments / np.outer(scale, scale))
        if np.min(np.diag(factor)) > _HALF_THE_DIGITS:
            return np.asarray(factor.T * scale)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.qr(rows.T * np.sqrt(weight)[:, None], mode="r"))


def _in_order(place: Array, values: Array) -> Array:
    """The values in the order of their place along a curve, from either end."""
    step = np.diff(place)
    if step.min() >= 0 or step.max() <= 0:  # as a profile mostly has them
        return values
    return values[np.argsort(place, kind="stable")]


def _fitted_circle(yz: Array, cov: Array) -> tuple[Array, float, Array] | None:
    """Centre, radius and the points' weights across the curve; None where the points make no arc."""
    middle = yz.mean(axis=0)
    y, z = np.ascontiguousarray((yz - middle).T)  # contiguous: a third of the time
    square_sum = y * y + z * z
    size = float(np.sqrt(np.mean(square_sum)))
    if size <= 0:
        return None
    y, z = y / size, z / size
    rows = np.ones((3, len(y)))
    rows[0], rows[1] = 2 * y, 2 * z
    moments = rows @ rows.T
    values = np.linalg.eigvalsh(moments)
    if values[-1] > _FLAT_ARC * values[0]:
        return None
    solution = np.linalg.solve(moments, rows @ (square_sum / size**2))
    square = float(solution[2] + solution[:2] @ solution[:2])
    if not 0 < square < _LARGEST**2:
        return None
    centre, radius = solution[:2], float(np.sqrt(square))
    parts = _parts(cov)
    weight = np.ones(len(y))
    for k in range(_STEPS):
        dy, dz = y - centre[0], z - centre[1]
        distance = np.maximum(np.sqrt(dy * dy + dz * dz), 1e-12)
        ny, nz = dy / distance, dz / distance
        if k < _WEIGHED:  # the weights need the normals, and hardly change with them
            weight = _weight(ny, nz, parts)
        rows[0], rows[1] = ny, nz
        weighted = rows * weight
        try:
            step = np.linalg.solve(weighted @ rows.T, weighted @ (distance - radius))
        except np.linalg.LinAlgError:
            return None
        centre, radius = centre + step[:2], radius + float(step[2])
        if not 0 < radius < _LARGEST:
            return None
        if np.max(np.abs(step)) * size < _SETTLED_MM:
            break
    return middle + size * centre, size * radius, weight


def _products(curves: Sequence[_Curve], longest: int, lags: int) -> Array:
    """Sums (lags,) of the products of residuals that stand 1, 2, … places apart, over all curves."""
    size = 1 << (longest + lags).bit_length()  # enough that ends do not meet, and quick whatever the number of points
    padded = np.zeros((len(curves), size))
    for row, c in zip(padded, curves, strict=True):
        row[: len(c.whitened)] = c.whitened
    power = np.sum(np.abs(np.fft.rfft(padded, axis=1)) ** 2, axis=0)
    return np.asarray(np.fft.irfft(power, n=size)[1 : lags + 1])


def _noise(curves: Sequence[_Curve]) -> tuple[float, float, int]:
    """Variance over the stated one, how many neighbours count as one, and the residuals that tell."""
    dof = sum(len(c.whitened) - c.p for c in curves)
    if dof < _FEWEST_FREE:
        return 1.0, 1.0, max(dof, 0)
    total = sum(float(c.whitened @ c.whitened) for c in curves)
    if total <= 0:
        return 1.0, 1.0, dof
    longest = max(len(c.whitened) for c in curves)
    lags = range(1, min(_LAGS, longest // 4) + 1)
    shares = _products(curves, longest, len(lags)) / total
    taken = sum(c.p for c in curves) / sum(len(c.whitened) for c in curves)
    inflation = 1.0
    for _ in range(_ROUNDS):  # what a fit takes away is as much more as neighbours are alike, and hides it
        lost = min(inflation * taken, _MOST_LOST)
        before, inflation = inflation, 1.0
        for share in shares:
            alike = share * (1 - lost) + lost
            if alike <= max(lost, 2 / np.sqrt(dof)):
                break
            inflation += 2 * alike
        if abs(inflation - before) < 1e-3 * before:
            break
    lost = min(inflation * taken, _MOST_LOST)
    return max(total / (dof / (1 - taken) * (1 - lost)), 1e-12), inflation, dof
