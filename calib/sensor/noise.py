"""What the residuals say of the noise: of corners and stripes over their stated σ, along a stripe, and of whole views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.bundle import SensorBundle
from calib.sensor.left_out import BOARD_FREEDOM, left_out
from calib.sensor.terms import StripeNoise

Array = NDArray[np.float64]

_ROUNDS = 2  # the scale of one kind of evidence moves the residuals of the other a little
_LINE_FREEDOM = 2
_MAX_ALIKE = 0.98  # correlation of neighbours: beyond it the line's own fit has eaten it
_QUIET = 0.15  # correlation of neighbours below which it is taken as none


def with_noise(bundle: SensorBundle, result: Result, offsets: bool = True) -> SensorBundle:
    """The bundle with the noise that the residuals of a solution show; χ² per degree of freedom is then near 1."""
    white = bundle.corner_term.independent_rows(result.state).residual
    dof = white.size - BOARD_FREEDOM * len(bundle.views) - int(result.unknowns.free.sum())
    scale = bundle.corner_scale * float(np.sqrt(np.sum(white**2) / max(dof, 1)))
    bundle = replace(bundle, corner_scale=max(scale, 1e-6))
    if not bundle.has_plane:
        return bundle
    noise = _along_stripes(bundle, result)
    bundle = replace(bundle, stripe_noise=noise)
    return replace(bundle, stripe_noise=replace(noise, offset_mm=_offset(bundle, result))) if offsets else bundle


def _along_stripes(bundle: SensorBundle, result: Result) -> StripeNoise:
    """Scale and length of likeness within the views, each freed of a straight line."""
    rows = bundle.stripe_term.rows(result.state)
    uv, member = bundle.views.stripe.uv_px, bundle.views.view_of_stripe
    square = pairs = apart = count = 0.0
    steps: list[Array] = []
    for v in range(len(bundle.views)):
        mine = member == v
        if mine.sum() <= 3 * _LINE_FREEDOM:
            continue
        along = np.linalg.norm(uv[mine] - uv[mine][0], axis=1)
        basis = np.stack([np.ones_like(along), along], 1) / rows.sigma[mine, None]
        z = rows.residual[mine] / rows.sigma[mine]
        z = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
        near = np.diff(along) < 2.0  # neighbours, not across a gap
        square += float(z @ z)
        count += len(z) - _LINE_FREEDOM
        pairs += float(np.sum((z[1:] * z[:-1])[near]))
        apart += float(near.sum())
        steps.append(np.diff(along)[near])
    if count < 1:
        return bundle.stripe_noise
    variance = square / count
    alike = min(pairs / max(apart, 1.0) / max(variance, 1e-300), _MAX_ALIKE)
    step = float(np.mean(np.concatenate(steps))) if steps and apart else 1.0
    length = 0.0 if alike < _QUIET else -step / float(np.log(alike))
    return StripeNoise(float(np.sqrt(variance)), length)


def _offset(bundle: SensorBundle, result: Result) -> float:
    """σ [mm] of what a view's points have in common, beyond what the views' own noise makes of their left-out means.

    References
    ----------
    The moment estimator of Paule & Mandel, J. Res. NBS 87 (1982) 377: Σ mean² / (σ² + offset²) = degrees of freedom.
    """
    alone = replace(bundle, stripe_noise=replace(bundle.stripe_noise, offset_mm=0.0))
    out = left_out(alone, alone.solve(result.state))
    seen = np.isfinite(out.offset_mm)
    means, sigma, dof = out.offset_mm[seen], out.offset_sigma_mm[seen], int(seen.sum()) - 3
    if dof < 1:
        return 0.0
    excess = lambda t: float(np.sum(means**2 / (sigma**2 + t**2))) - dof  # noqa: E731
    if excess(0.0) <= 2 * np.sqrt(2 * dof):  # chance alone
        return 0.0
    low, high = 0.0, float(np.max(np.abs(means))) * np.sqrt(len(means))
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high

