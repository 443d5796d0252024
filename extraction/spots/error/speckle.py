"""Contrast and grain of the speckle, as the residuals of fitted spots show them.

The bright pixels' residual r, freed of the fit's terms J, has the covariance of V + (c² + c₀²) · S ρ S: V the camera's
variance, S what speckle multiplies, ρ the correlation of a round pupil's grains, c₀ what a string's shape leaves. Its
restricted likelihood (Patterson & Thompson 1971) asks nothing of the terms: with Q orthogonal to V^-½ J,

    ln L = -½ Σ ln(1 + c² λ) + z²/(1 + c² λ),    Qᵀ V^-½ S ρ S V^-½ Q = Σ λ e eᵀ,    z = eᵀ Qᵀ V^-½ r,

so that one decomposition a grain gives all contrasts. Spots of an image or of a recording multiply their likelihoods;
a spot that is no Gaussian's counts as one that speaks for any speckle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.config import MAX_GRAIN_PX
from extraction.spots.error.influence import CLASSES, DISTANCES2, LAGS
from extraction.spots.frame import Fits
from extraction.spots.noise import PRIOR_CONTRAST
from geometry import Camera, Sensor
from geometry.special import j1

Array = NDArray[np.float64]

# what is expected where images do not tell, with its spread (ln). Contrast: of PRIOR_LOOKS independent fields, two of
# unpolarised light, over a pixel of the grain in question (Goodman 2007, section 4.6), one to four within 1 σ. Grain:
# that of red light by F/3 to F/8 and pixels of 5 µm
PRIOR_LOOKS, PRIOR_CONTRAST_LN = 2.0, 0.35
PRIOR_GRAIN_PX, PRIOR_GRAIN_LN = 0.7, 0.5
NO_SPECKLE = 0.01  # probability before looking that an image has none, or any other contrast
CONTRASTS = np.geomspace(0.003, 1.0, 300)  # of the posterior, 2 % apart; 1 is fully developed
GRAINS_PX = np.geomspace(0.2, MAX_GRAIN_PX, 40)  # of it, 6 % apart; finer ones are averaged out within a pixel
# of them those for which the likelihood is worked out; what lies between is interpolated
CONTRAST_NODES = np.geomspace(0.003, 1.0, 32)
GRAIN_NODES = np.array([0, 8, 14, 18, 22, 26, 30, 33, 36, 39])
NODES = 20  # of a pixel's side
# contrast that strings' departure from a Gaussian leaves in the residuals without any speckle or noise: 0.006 for
# strings of 0.3 mm, 0.02 of 0.5 mm, 0.06 of 1 mm (benchmarks/extraction_model_error.py)
SHAPE_CONTRAST = 0.02
# share of the height above which pixels are looked at: in wings a spot departs from a Gaussian by more than by speckle.
# Where they are less than MANY it is lowered, down to FAINT: spots that the lens draws have so few
BRIGHT, FAINT, MANY = 0.1, 0.03, 30
# powers of x and y: of the terms TAKEN up by a fit, and of the third and fourth moments, which spots of so MANY pixels
# leave to the shape of the string
POWERS = np.array([(a, d - a) for d in range(5) for a in range(d, -1, -1)])
TAKEN = 6
ALIKE = 1e-6  # singular value of terms over the largest, below which they are sums of each other but for rounding
ODD_SPOT = 1e-3  # probability that a spot's residuals are those of something else
MOST_SPOTS = 60  # of an image: each takes half a millisecond


@dataclass(frozen=True)
class Speckle:
    """Speckle of a pixel: its standard deviation over the signal, and the grain λF#(1 + m) on the chip [px]."""

    contrast: float
    grain_px: float

    @property
    def variances(self) -> Array:
        """Contrast² · ρ for the classes of distance of `influence` (CLASSES,)."""
        return np.asarray(self.contrast**2 * correlation(self.grain_px))


def optical_grain_px(sensor: Sensor) -> float | None:
    """The grain λF#(1 + m) on the chip that a sensor's stated optics give.

    Parameters
    ----------
    sensor : Sensor
        With a camera. Its magnification m is that at the stated distance in focus, else where its axis meets the sheet.

    Returns
    -------
    float or None
        Grain [px], no coarser than pixels can tell; None where wavelength, pixel pitch or F-number are not stated.

    References
    ----------
    Goodman, Speckle Phenomena in Optics (2007), section 4.5; Dorsch, Häusler & Herrmann (1994).
    """
    optics = sensor.optics
    if optics is None or optics.wavelength_nm is None or optics.pixel_um is None or optics.f_number is None:
        return None
    camera = sensor.require_camera()
    principal_mm = (camera.fx_px + camera.fy_px) / 2 * optics.pixel_um * 1e-3
    magnification = principal_mm / (optics.focus_distance_mm or _sheet_on_axis_mm(camera))
    grain = optics.wavelength_nm * 1e-3 * optics.f_number * (1 + magnification) / optics.pixel_um
    return min(grain, MAX_GRAIN_PX)


def _sheet_on_axis_mm(camera: Camera) -> float:
    """Distance from the camera's centre along its axis to the sheet [mm]; infinite where they do not meet."""
    towards = float(camera.T_sensor_camera.R[0, 2])
    distance = -float(camera.centre_mm[0]) / towards if towards else math.inf
    return distance if distance > 0 else math.inf


def _pupil_tables() -> tuple[Array, Array, Array]:
    """By grain: correlation (G, CLASSES) of two pixels, variance (G,) of one field over a pixel, WITHIN (G,) of it.

    The speckle's is that of a round pupil, (2 J₁(x)/x)² with x = π r/grain, over both pixels. Two pixels at a lag are
    uniform points whose difference t has a triangle's distribution in u and in v. WITHIN is ⟨x x'⟩ of a pixel's two
    points weighted by it, (1 - |t|)²/12 - t²/4 where t is given. Source: Goodman, Speckle Phenomena in Optics (2007),
    sections 4.4 and 4.6.
    """
    t = (np.arange(-NODES, NODES) + 0.5) / NODES
    triangle = (1.0 - np.abs(t)) / NODES
    lags = np.array([LAGS[LAGS[:, 0] == k][-1, 1:] for k in range(CLASSES)])
    r = np.hypot(lags[:, 0, None, None] + t[:, None], lags[:, 1, None, None] + t)
    x = np.pi * r / GRAINS_PX[:, None, None, None]
    shared = (2.0 * j1(x) / x) ** 2
    covariance = np.einsum("gkij,i,j->gk", shared, triangle, triangle)
    moment = triangle * ((1.0 - np.abs(t)) ** 2 / 3.0 - t**2) / 4.0
    within = np.einsum("gij,i,j->g", shared[:, 0], moment, triangle)
    return covariance / covariance[:, :1], covariance[:, 0], within / covariance[:, 0]


GRAIN_CORRELATIONS, PIXEL_VARIANCES, WITHIN = _pupil_tables()


def correlation(grain_px: float) -> Array:
    """Correlation of the speckle of two pixels by the classes of their distance.

    Parameters
    ----------
    grain_px
        λF#(1 + m) on the chip; grains outside 0.2 to 1.7 px are taken as these ends.

    Returns
    -------
    rho
        (CLASSES,), 1 for a pixel with itself.

    References
    ----------
    Goodman, Speckle Phenomena in Optics (2007), sections 4.4 and 4.6: a round pupil's, integrated over both pixels.
    """
    return _at(GRAIN_CORRELATIONS, grain_px)


def _at(table: Array, grain_px: float) -> Array:
    """A table's row (G, ...) for a grain, between the two nearest."""
    place = float(np.interp(grain_px, GRAINS_PX, np.arange(len(GRAINS_PX))))
    low = min(int(place), len(GRAINS_PX) - 2)
    return np.asarray(table[low] + (place - low) * (table[low + 1] - table[low]))


def estimate_speckle(
    parts: Iterable[Fits], model_error: float, contrast: float | None = None, grain_px: float | None = None
) -> Speckle:
    """Speckle by the residuals of fitted spots; what is given is kept.

    Parameters
    ----------
    parts
        Fits of an image's spots each, the best first: MOST_SPOTS of an image are looked at.
    model_error
        Independent error of every pixel by the model, over the spot's height.
    contrast, grain_px
        What is known of it.

    Returns
    -------
    Speckle
        The mean, over all that the spots leave possible, of contrast² and of contrast² times neighbours' correlation:
        what the covariance of a spot is made of.
    """
    if contrast is not None and grain_px is not None:
        return Speckle(contrast, grain_px)
    contrasts = CONTRAST_NODES if contrast is None else np.array([contrast])
    grains = GRAINS_PX[GRAIN_NODES] if grain_px is None else np.array([grain_px])
    told = [one for fits in parts for one in _likelihoods(fits, model_error, contrasts, grains)]
    if not told:
        return Speckle(
            PRIOR_CONTRAST if contrast is None else contrast, PRIOR_GRAIN_PX if grain_px is None else grain_px
        )
    likely = np.sum(told, axis=0)
    if contrast is None:
        contrasts, likely = CONTRASTS, likely @ BETWEEN_CONTRASTS.T
    if grain_px is None:
        grains, likely = GRAINS_PX, BETWEEN_GRAINS @ likely
    return _mean(likely, contrasts, grains, contrast, grain_px)


def _mean(likely: Array, contrasts: Array, grains: Array, contrast: float | None, grain_px: float | None) -> Speckle:
    """Mean of the posterior, the prior put to the log-likelihood (G, C)."""
    usual = np.sqrt(np.array([float(_at(PIXEL_VARIANCES, g)) for g in grains]) / PRIOR_LOOKS)
    off = np.log(contrasts / usual[:, None]) / PRIOR_CONTRAST_LN
    rare = np.log(grains / PRIOR_GRAIN_PX) / PRIOR_GRAIN_LN
    posterior = likely + np.log(np.exp(-0.5 * off**2) + NO_SPECKLE) - 0.5 * rare[:, None] ** 2
    weight = np.exp(posterior - posterior.max())
    by_grain = weight @ contrasts**2
    variance = float(by_grain.sum() / weight.sum())
    if grain_px is None:
        neighbours = np.array([float(correlation(g)[1]) for g in grains])
        grain_px = float(np.interp(by_grain @ neighbours / by_grain.sum(), GRAIN_CORRELATIONS[:, 1], GRAINS_PX))
    return Speckle(math.sqrt(variance) if contrast is None else contrast, grain_px)


def _likelihoods(fits: Fits, model_error: float, contrasts: Array, grains: Array) -> Iterator[Array]:
    """Log-likelihood (G, C) of every spot that tells anything."""
    rho = np.array([[*correlation(g), 0.0] for g in grains])
    within = np.array([float(_at(WITHIN, g)) for g in grains])
    for k in range(min(len(fits.spot), MOST_SPOTS)):
        bright = _bright(fits, k, model_error)
        freed = bright.freed() if bright is not None else None
        if bright is None or freed is None:
            continue
        grainy = bright.signal * np.sqrt(1.0 + within[:, None] * bright.fall2)
        basis = freed * (bright.weight * grainy)[:, :, None]
        shared = rho[:, CLASS_OF[np.minimum(bright.distance2, len(CLASS_OF) - 1)]]
        size, vectors = np.linalg.eigh(basis.transpose(0, 2, 1) @ (shared @ basis))
        z2 = ((bright.residual * bright.weight) @ freed @ vectors) ** 2
        variance = 1.0 + (contrasts**2 + SHAPE_CONTRAST**2)[:, None] * np.maximum(size, 0.0)[:, None, :]
        one = -0.5 * np.sum(np.log(variance) + z2[:, None, :] / variance, axis=-1)
        yield np.logaddexp(one, one.max() + math.log(ODD_SPOT))


@dataclass(frozen=True, eq=False)
class _BrightPixels:
    """The n pixels of a spot that tell of the speckle.

    signal, residual [DN], weight: 1 over the camera's and the model's standard deviation; fall2: squared slope of the
    light's logarithm; terms (n, P): what the spot may take up; distance2 (n, n) of pixels.
    """

    signal: Array
    residual: Array
    weight: Array
    fall2: Array
    terms: Array
    distance2: NDArray[np.intp]

    def freed(self) -> Array | None:
        """Orthonormal basis (n, n - rank) of what the terms leave of weighted residuals; None where that is nothing.

        On a spot of few columns or rows the high powers are sums of the lower ones.
        """
        if not len(self.signal):
            return None
        weighted = self.terms * self.weight[:, None]
        length = np.maximum(np.linalg.norm(weighted, axis=0), np.finfo(float).tiny)
        left, size, _ = np.linalg.svd(weighted / length)
        rank = int(np.count_nonzero(size > ALIKE * size[0]))
        return left[:, rank:] if rank < len(left) else None


def _bright(fits: Fits, k: int, model_error: float) -> _BrightPixels | None:
    """Those of spot k; None where its light is nowhere."""
    place, spot, noise = fits.place[k], fits.spot[k], fits.noise[k]
    here = (k, slice(place["rows"]), slice(place["columns"]))
    grey, use = fits.windows.grey[here], fits.windows.use[here]
    x, y = np.arange(grey.shape[1]) - spot["u"], np.arange(grey.shape[0])[:, None] - spot["v"]
    bell = np.asarray(np.exp(-0.5 * (spot["a"] * x * x + 2.0 * spot["h"] * x * y + spot["c"] * y * y)))
    level = float(np.sort(bell[use])[-MANY]) if np.count_nonzero(use) >= MANY else 0.0
    chosen = use & (bell >= min(max(level, FAINT), BRIGHT))
    j, i = np.nonzero(chosen)
    many = len(i) >= MANY
    x, y, bell = x[i], y[j, 0], bell[chosen]
    signal = spot["height"] * bell
    mean = signal + spot["level"] + spot["slope_u"] * i + spot["slope_v"] * j
    own = (model_error * spot["height"]) ** 2
    variance = noise["floor"] + noise["gain"] * np.maximum(mean - noise["dark"], 0.0) + own
    powers = POWERS if many else POWERS[:TAKEN]
    x_powers, y_powers = (np.vander(at, 5, increasing=True) for at in (x, y))
    terms = x_powers[:, powers[:, 0]] * y_powers[:, powers[:, 1]] * bell[:, None]
    fall, drop = spot["a"] * x + spot["h"] * y, spot["h"] * x + spot["c"] * y
    return _BrightPixels(
        signal, grey[chosen] - mean, 1.0 / np.sqrt(variance), fall**2 + drop**2, terms,
        (i[:, None] - i) ** 2 + (j[:, None] - j) ** 2,
    )  # fmt: skip


_OTHERS = np.array([[k for k in range(4) if k != m] for m in range(4)])  # of four nodes


def _between(nodes: Array, at: Array) -> Array:
    """Weights (A, N) that interpolate values at nodes by the cubic through the four about a place."""
    out = np.zeros((len(at), len(nodes)))
    first = np.clip(np.searchsorted(nodes, at) - 2, 0, len(nodes) - 4)
    for k, start in enumerate(first):
        four = nodes[start : start + 4]
        others = four[_OTHERS]
        out[k, start : start + 4] = np.prod((at[k] - others) / (four[:, None] - others), axis=1)
    return out


BETWEEN_CONTRASTS = _between(np.log(CONTRAST_NODES), np.log(CONTRASTS))
BETWEEN_GRAINS = _between(np.log(GRAINS_PX[GRAIN_NODES]), np.log(GRAINS_PX))
CLASS_OF = np.full(DISTANCES2[-1] + 2, CLASSES)  # of a squared distance, CLASSES beyond all
CLASS_OF[DISTANCES2] = np.arange(CLASSES)
