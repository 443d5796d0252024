"""What recorded and emulated stripes differ by, figure by figure, with the covariance that their parts show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.twin.seen import NAMES, ImageSeen

Array = NDArray[np.float64]

UNKNOWN = 0.05  # σ of a figure where single parts tell no scatter
EXPECTED = 12  # degrees of freedom that the scatter of an emulated part from draw to draw counts for


@dataclass(frozen=True, eq=False)
class FigureDifference:
    """Means (K,) of recorded less emulated figures over all parts, NaN where none tells; their covariance (K, K)."""

    mean: Array
    covariance: Array


def difference(recorded: Sequence[ImageSeen], draws: Sequence[Sequence[ImageSeen]]) -> FigureDifference:
    """Recorded less emulated, of which there may be several draws.

    Part by part: what a surface does to both is in neither the mean nor the scatter. Where there are draws, their
    scatter is what the parts' is expected to be, and counts beside it: a variance of few parts is small by chance, and
    would then have most of the weight. Images that differ by more than their parts' scatter explains (room light, a
    wall behind) have a variance of their own, that of random effects.

    References
    ----------
    DerSimonian & Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7 (1986).
    """
    emulated = [_mean_of([d[k].parts for d in draws]) for k in range(len(recorded))]
    apart = [r.parts - e for r, e in zip(recorded, emulated, strict=True)]
    count = np.isfinite(np.concatenate(apart)).sum(0)
    scatter, freedom = _scatter(
        [a - mean_of_rows(a) for a in apart], [np.isfinite(a).any(0).astype(int) for a in apart]
    )
    if len(draws) > 1:
        left = [d[k].parts - e for d in draws for k, e in enumerate(emulated)]
        drawn, ways = _scatter(left, [np.isfinite(e).sum(0) for e in emulated])
        share = np.where(ways > 0, EXPECTED / (EXPECTED + freedom), 0.0)
        mixed = np.sqrt(np.outer(share, share)) * drawn * (1 + 1 / len(draws))
        scatter = np.sqrt(np.outer(1 - share, 1 - share)) * scatter + mixed
        freedom = freedom + EXPECTED * (ways > 0)
    alone = freedom < 1
    scatter[alone, alone] = UNKNOWN**2
    own = scatter / np.sqrt(np.outer(np.maximum(count, 1), np.maximum(count, 1)))
    mean = mean_of_rows(np.concatenate(apart))
    return FigureDifference(mean, own + np.diag(_between(apart, np.diag(scatter))))


def _scatter(left: Sequence[Array], means: Sequence[NDArray[np.int64]]) -> tuple[Array, Array]:
    """Covariance of the rows that are left (K, K), and their degrees of freedom (K,), when so many means were taken
    off.
    """
    rows = np.concatenate(left)
    freedom = np.isfinite(rows).sum(0) - np.sum(means, 0)
    scaled = np.nan_to_num(rows) / np.sqrt(np.maximum(freedom, 1))
    return np.asarray(scaled.T @ scaled), freedom


def _between(apart: Sequence[Array], variance: Array) -> Array:
    """What images' own differences add to the variances of the means (K,)."""
    out = np.zeros(len(NAMES))
    for k in range(len(NAMES)):
        parts = [a[np.isfinite(a[:, k]), k] for a in apart]
        parts = [p for p in parts if len(p)]
        if len(parts) < 2 or variance[k] <= 0:
            continue
        counts = np.array([len(p) for p in parts], float)
        means = np.array([p.mean() for p in parts])
        total = counts.sum()
        q = float(np.sum(counts * (means - counts @ means / total) ** 2)) / variance[k]
        own = max(q - (len(parts) - 1), 0.0) * variance[k] / (total - counts @ counts / total)
        out[k] = own * (counts @ counts) / total**2
    return out


def change(before: Sequence[ImageSeen], after: Sequence[ImageSeen]) -> tuple[Array, Array]:
    """Mean change of the figures (K,) and its variance, by parts that both show; none and zero where none does."""
    rows = np.concatenate([b.parts - a.parts for a, b in zip(before, after, strict=True)])
    count = np.isfinite(rows).sum(0)
    mean = np.nan_to_num(mean_of_rows(rows))
    scatter = np.nansum((rows - mean) ** 2, 0) / np.maximum(count - 1, 1)
    return np.where(count > 1, mean, 0.0), scatter / np.maximum(count, 1)


def figures(seen: Sequence[ImageSeen]) -> Array:
    """Means (K,) over all parts."""
    return mean_of_rows(np.concatenate([s.parts for s in seen]))


def mean_of_rows(rows: Array) -> Array:
    """Means of columns (N, K), NaN left out; NaN where there is nothing else."""
    count = np.isfinite(rows).sum(0)
    return np.asarray(np.where(count > 0, np.nansum(rows, 0) / np.maximum(count, 1), np.nan))


def _mean_of(tables: Sequence[Array]) -> Array:
    """Mean of tables of one shape, entry by entry, NaN left out."""
    stack = np.stack(tables)
    return mean_of_rows(stack.reshape(len(tables), -1)).reshape(stack.shape[1:])
