"""Speckle: the interference pattern that multiplies the mean light on the chip."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from geometry import Sensor
from geometry.compiled import kernel
from perceptron_emu.chip import white_noise
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import working_f_number

Float32 = NDArray[np.float32]

SIZE_STEP = 8  # boxes are made of these many cells, or twice as many, so that few pupils serve them all
MIN_CONTRAST = 0.1  # of drawn patterns, which take their number; weaker ones are this one beside steady light
SPARE = 0.05  # of a pattern: not drawn for at most 1.3 % of contrast
HALO = 2.5  # grains beyond the box over which the amplitude's point spread is not cut


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
    Goodman, Speckle Phenomena in Optics, 2007; Dorsch, Häusler & Herrmann, "Laser triangulation: fundamental
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
    Goodman, Speckle Phenomena in Optics, 2007, section 6.3; Parry 1974.
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


def speckle_field(origin: tuple[int, int], shape: tuple[int, int], grain: float, strength: float, key: int) -> Float32:
    """Speckle intensity of mean 1 on a part of an endless sub-pixel grid.

    origin: (row, column) of the part's first cell on the grid, shape: its (rows, columns); parts that overlap agree.
    grain: λF#(1 + m) in cells. strength: contrast. Each pattern is |white complex noise seen through a circular
    pupil|²; their weights w add up to 1 and their squares to strength². Source: Goodman 2007, section 3.2 and 3.3.
    """
    if strength <= 0:
        return np.ones(shape, np.float32)
    if strength < MIN_CONTRAST:
        share = np.float32(strength / MIN_CONTRAST)
        return 1 - share + share * speckle_field(origin, shape, grain, MIN_CONTRAST, key)
    step = 2 if grain >= 2 else 1  # the pupil passes nothing that white noise on every second cell lacks
    halo = math.ceil(HALO * grain)
    first = [step * ((o - halo) // step) for o in origin]
    skip = [o - f for o, f in zip(origin, first, strict=True)]
    rows, columns = (step * _cells(-(-(n + s + halo) // step)) for n, s in zip(shape, skip, strict=True))
    weights = _weights(strength)
    keys = [key + 0x51_7C_C1 * (number + 1) for number in range(len(weights))]
    noise = white_noise(first[0] // step, first[1] // step, rows // step, columns // step, keys)
    spectrum = scipy.fft.fft2(noise, overwrite_x=True)
    spectrum *= _pupil(rows, columns, step, grain)
    # a spectrum's place among the frequencies turns the amplitude's phase alone: zeros at its end make the grid finer
    across = scipy.fft.ifft(spectrum, rows, axis=1, overwrite_x=True)[:, skip[0] : skip[0] + shape[0]]
    field = scipy.fft.ifft(across, columns, axis=2)[..., skip[1] : skip[1] + shape[1]]
    return np.asarray(_power(field, np.array(weights, np.float32) * np.float32(step * step)))


def _cells(least: int) -> int:
    """Cells of a box's side: at least as many, of few different numbers, quick to transform."""
    return int(scipy.fft.next_fast_len(SIZE_STEP * -(-least // SIZE_STEP)))


@kernel(fastmath=True)
def _power(field: NDArray[np.complex64], weights: Float32) -> Float32:
    """Σ weight · |field|² (H, W) over the fields (n, H, W)."""
    _, height, width = field.shape
    total = np.zeros((height, width), np.float32)
    for k in range(len(weights)):
        for j in range(height):
            row, sum_ = field[k, j], total[j]
            for i in range(len(sum_)):
                sum_[i] += weights[k] * (row[i].real * row[i].real + row[i].imag * row[i].imag)
    return total


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


@lru_cache(maxsize=256)
def _pupil(rows: int, columns: int, step: int, grain: float) -> Float32:
    """Transfer function (rows/step, columns/step) of a circular pupil of diameter 1/grain cycles a cell, scaled to mean
    power 1 on the fine grid; frequency 0 in the middle.
    """
    fy, fx = ((np.arange(n // step) - n // step // 2) / n for n in (rows, columns))
    # a soft rim one frequency cell wide, so that the pupil's area does not jump with the box's size
    radius, cell = 0.5 / grain, 0.5 * (1 / rows + 1 / columns)
    pupil = np.clip((radius - np.hypot(fy[:, None], fx)) / cell + 0.5, 0, 1)
    return np.asarray(pupil * math.sqrt(rows * columns / np.sum(pupil**2)), np.float32)
