"""Speckle: the interference pattern that multiplies the mean light on the chip."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.chip import mix, white_noise
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import working_f_number

Float32 = NDArray[np.float32]

FIELD_GRAINS, MAX_FIELD = 384, 2048  # side of the field that tiles are cut from, in grains; at most so many cells
TILE_CELLS, SEAM_GRAINS, SEAMS_A_TILE = 256, 3.0, 4  # a tile's side; its seam is at most a quarter of it
SEAM_STEP, FIELD_STEP = 8, 256  # cells
_FIELD_KEY = 0x5EED
_FAR = 0x40000000  # added to rows and columns of tiles: the grid reaches as far before its origin as behind
MIN_CONTRAST = 0.1  # of drawn patterns, which take their number; weaker ones are this one beside steady light
SPARE = 0.05  # of a pattern: not drawn for at most 1.3 % of contrast


def grain_px(config: EmulatorConfig, sensor: Sensor) -> float:
    """Size of the speckle's grain on the chip, λ F# (1 + m).

    Parameters
    ----------
    config : EmulatorConfig
        Its laser and lens.
    sensor : Sensor
        With a camera.

    Returns
    -------
    float
        [px].

    References
    ----------
    Goodman, SpeckleField Phenomena in Optics, 2007; Dorsch, Häusler & Herrmann, "Laser triangulation: fundamental
    uncertainty in distance measurement", 1994.
    """
    working = working_f_number(config.optics, sensor)
    return config.laser.wavelength_nm * 1e-3 * working / config.optics.pixel_um


def contrast(config: EmulatorConfig) -> float:
    """Contrast σ_I/⟨I⟩ of the pattern before the pixel averages it.

    1/√2 where the surface depolarises (two independent patterns), times [1 + (4π σ_h Δλ/λ²)²]^(−1/4) for light of
    bandwidth Δλ (its σ) scattered over the rms depth σ_h.

    Parameters
    ----------
    config : EmulatorConfig
        Its speckle and laser; [speckle] contrast, where given, is the answer.

    Returns
    -------
    float
        In [0, 1].

    References
    ----------
    Goodman, SpeckleField Phenomena in Optics, 2007, section 6.3; Parry 1974.
    """
    speckle, laser = config.speckle, config.laser
    if speckle.contrast is not None:
        return speckle.contrast
    sigma_nm = laser.bandwidth_nm / math.sqrt(8 * math.log(2))
    phase = 4 * math.pi * speckle.roughness_um * 1e3 * sigma_nm / laser.wavelength_nm**2
    polarisation = 1.0 if speckle.polarised else math.sqrt(0.5)
    return float(polarisation * (1 + 2 * phase**2) ** -0.25)


def oversampling(config: EmulatorConfig, sensor: Sensor) -> int:
    """Sub-pixels a pixel's side needs: the pattern's intensity is band-limited at two samples a grain, and a pixel
    averages it.
    """
    return min(max(math.ceil(2 / grain_px(config, sensor)), 2), 8)


class SpeckleField(NamedTuple):
    """The speckle of one frame: amplitudes of a field of it in numbers, and how the endless grid is laid with them.

    Parameters
    ----------
    real, imaginary : Float32
        (S, S) amplitude, of mean power 1: circular Gaussian noise through a circular pupil.
    tile : int
        The endless grid is laid with squares of so many cells, each cut from the field at a place of its own.
    rise : Float32
        (seam,) share of a tile's amplitude from its edge on, where it takes over from the one before.
    weights : Float32
        (n,) of the independent patterns, which add up to 1.
    keys : NDArray
        (n,) of their tiles' places.
    steady : float
        Light without speckle: weaker contrasts than MIN_CONTRAST are that one beside it.
    """

    real: Float32
    imaginary: Float32
    tile: int
    rise: Float32
    weights: Float32
    keys: NDArray[np.uint64]
    steady: float


def speckle_of(grain: float, strength: float, key: int) -> SpeckleField:
    """The speckle of a key.

    The pattern is Gaussian noise by example: a field of amplitudes is made once for a grain; tiles cut from it at
    random places cover the grid, blended over a seam so that the amplitude's power stays 1 (a sum of independent
    circular Gaussian amplitudes whose squared shares add up to 1 is one).

    Parameters
    ----------
    grain : float
        λF#(1 + m) in cells.
    strength : float
        Contrast of the intensity. Patterns' weights w add up to 1 and their squares to strength².
    key : int
        64 random bits.

    Returns
    -------
    SpeckleField
        For `add_grains`.

    References
    ----------
    Goodman, SpeckleField Phenomena in Optics, 2007, sections 3.2 and 3.3; Heitz & Neyret, "High-performance by-example
    noise using a histogram-preserving blending operator", 2018.
    """
    field = _field(round(grain, 3))
    drawn = max(strength, MIN_CONTRAST)
    share = strength / drawn
    weights = _weights(min(drawn / field.contrast, 1.0)) if strength > 0 else []
    keys = np.array([(key + 0x51_7C_C1 * (n + 1)) & 0xFFFFFFFFFFFFFFFF for n in range(len(weights))], np.uint64)
    each = (share * np.array(weights)).astype(np.float32)
    return SpeckleField(field.real, field.imaginary, field.tile, field.rise, each, keys, 1 - share)


def speckle_field(origin: tuple[int, int], shape: tuple[int, int], speckle: SpeckleField) -> Float32:
    """Speckle intensity of mean 1 on a part of an endless sub-pixel grid.

    Parameters
    ----------
    origin : tuple of int
        (row, column) of the part's first cell on the grid; parts that overlap agree.
    shape : tuple of int
        Its rows and columns.
    speckle : SpeckleField
        The pattern.

    Returns
    -------
    Float32
        (rows, columns).
    """
    out = np.empty(shape, np.float32)
    _grains(speckle, origin[0], origin[1], out)
    return out


@kernel(fastmath=True)
def _grains(speckle: SpeckleField, row: int, column: int, out: Float32) -> None:
    real, imaginary = np.empty(out.shape[1], np.float32), np.empty(out.shape[1], np.float32)
    for j in range(len(out)):
        row_of_grains(speckle, row + j, column, real, imaginary, out[j])


@kernel(fastmath=True)
def row_of_grains(
    speckle: SpeckleField, row: int, column: int, real: Float32, imaginary: Float32, out: Float32
) -> None:
    """Fill out (W,) with the intensity in a row of the grid from a column on; two more (W,) are room to work in."""
    tile, seam = speckle.tile, len(speckle.rise)
    places = np.uint64(len(speckle.real) - tile - seam + 1)
    own = row // tile
    above = 2 if row - own * tile < seam else 1  # tiles that this row has a share in
    first = column // tile
    first -= 1 if column - first * tile < seam else 0
    last = (column + len(out) - 1) // tile
    out[:] = np.float32(speckle.steady)
    for n in range(len(speckle.weights)):
        real[:] = 0
        imaginary[:] = 0
        for up in range(above):
            y = row - (own - up) * tile
            for across in range(first, last + 1):
                bits = mix((np.uint64(own - up + _FAR) << np.uint64(32)) | np.uint64(across + _FAR), speckle.keys[n])
                top = np.int64(((bits & np.uint64(0xFFFFFFFF)) * places) >> np.uint64(32))
                left = np.int64(((bits >> np.uint64(32)) * places) >> np.uint64(32))
                _add_tile(
                    speckle, (int(top) + y, int(left)), _share(speckle, y), across * tile - column, real, imaginary
                )
        weight = speckle.weights[n]
        for i in range(len(out)):
            out[i] += weight * (real[i] * real[i] + imaginary[i] * imaginary[i])


@kernel
def _share(speckle: SpeckleField, y: int) -> np.float32:
    """Of the amplitude, in row y of a tile."""
    seam = len(speckle.rise)
    share: np.float32 = np.float32(1)
    if y < seam:
        share = speckle.rise[y]
    elif y >= speckle.tile:
        share = speckle.rise[seam - 1 - (y - speckle.tile)]
    return share


@kernel(fastmath=True)
def _add_tile(
    speckle: SpeckleField, cut: tuple[int, int], share: np.float32, at: int, re: Float32, im: Float32
) -> None:
    """Add a row of one tile, cut from the field at (row, column), to amplitudes, in whose cell ``at`` it begins."""
    (row, left), tile, rise = cut, speckle.tile, speckle.rise
    seam, width = len(rise), len(re)
    field_re, field_im = speckle.real[row], speckle.imaginary[row]
    for part in range(3):  # rising, whole, falling
        begin = max(at + (0, seam, tile)[part], 0)
        end = min(at + (seam, tile, tile + seam)[part], width)
        if begin >= end:
            continue
        x = begin - at
        from_re, from_im = field_re[left + x : left + x + end - begin], field_im[left + x : left + x + end - begin]
        to_re, to_im = re[begin:end], im[begin:end]
        for i in range(len(to_re)):
            own = share
            if part == 0:
                own = share * rise[x + i]
            elif part == 2:
                own = share * rise[seam - 1 - (x + i - tile)]
            to_re[i] += own * from_re[i]
            to_im[i] += own * from_im[i]


class _Field(NamedTuple):
    """A field's amplitudes (S, S), its tile, its seam's shares, and the contrast of its intensity."""

    real: Float32
    imaginary: Float32
    tile: int
    rise: Float32
    contrast: float


@lru_cache(maxsize=8)
def _field(grain: float) -> _Field:
    # sizes go in steps: a lens a little wider has the same pattern, a little finer
    seam = SEAM_STEP * math.ceil(SEAM_GRAINS * grain / SEAM_STEP)
    tile = max(TILE_CELLS, SEAMS_A_TILE * seam)
    side = FIELD_STEP * math.ceil(max(2 * (tile + seam), min(FIELD_GRAINS * grain, MAX_FIELD)) / FIELD_STEP)
    spectrum = white_noise(0, 0, side, side, [_FIELD_KEY])[0]
    spectrum *= _pupil(side, grain)
    amplitude = scipy.fft.ifft2(spectrum, overwrite_x=True)
    power, square = _moments(amplitude)
    amplitude *= np.float32(1 / math.sqrt(power))
    t = (np.arange(seam) + 0.5) / seam
    rise = t / np.sqrt(t * t + (1 - t) * (1 - t))  # the squares of a tile's and the one before's add up to 1
    real, imaginary = (np.ascontiguousarray(part) for part in (amplitude.real, amplitude.imag))
    return _Field(real, imaginary, tile, rise.astype(np.float32), math.sqrt(square / power**2 - 1))


@kernel
def _moments(amplitude: NDArray[np.complex64]) -> tuple[float, float]:
    """Mean intensity, and mean of its square; summed in one order on every machine."""
    total, square = 0.0, 0.0
    for j in range(amplitude.shape[0]):
        for i in range(amplitude.shape[1]):
            a = amplitude[j, i]
            power = float(a.real) * float(a.real) + float(a.imag) * float(a.imag)
            total += power
            square += power * power
    return total / amplitude.size, square / amplitude.size


def _weights(strength: float) -> list[float]:
    """Non-negative weights of the fewest independent patterns whose sum has the contrast: Σw = 1, Σw² = strength²."""
    n = max(1, math.ceil(1 / strength**2 - SPARE))
    if n == 1:
        return [1.0]
    # n − 1 weights a and one b = 1 − (n − 1)a
    m = n - 1
    root = math.sqrt(max(m * ((m + 1) * strength**2 - 1), 0.0))
    a = (m + root) / (m * (m + 1))
    return [a] * m + [max(0.0, 1 - m * a)]


def _pupil(side: int, grain: float) -> Float32:
    """Transfer function (side, side) of a circular pupil of diameter 1/grain cycles a cell, frequency 0 first."""
    f = np.minimum(np.arange(side), side - np.arange(side)) / side
    # a soft rim one frequency cell wide, so that the pupil's area does not jump with the field's size
    inside = (0.5 / grain - np.sqrt(f[:, None] * f[:, None] + f * f)) * side + 0.5
    return np.asarray(np.clip(inside, 0, 1), np.float32)
