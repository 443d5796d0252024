"""From the lit surface that the camera sees to the axis of the string.

Derivation. A point of the string is X = X₀ + s d + r n(φ), with X₀ the axis's crossing of the sheet x = 0, d the
string's unit direction and n(φ) ⊥ d. The sheet's irradiance depends on x alone, so at a fixed φ the light is centred
on x = 0: its centroid along s is the point c(φ) = X₀ + r (n - d nₓ/dₓ), in the sheet whatever the sheet's thickness.
Seen from the camera, φ counts with w(φ) = f(n, l, v) (n·l)₊ (n·v)₊: cosine of incidence, reflectance f,
foreshortening. Over one string the projection is affine to r/distance ≈ 1e-3, so the spot's centroid is the image of
Σ w c / Σ w, and the camera's ray through it meets the sheet in that very point. The offset is that mean less X₀.

What is fitted to a spot is no centroid where the lit arc is long beside the blur: noise that grows with the light
(speckle) makes the fit follow the arc's ridge, its faint ends nearly as much as its bright middle; noise that does not
makes it the centroid. Both are averaged, what lies between them is a σ: 0.02 radii, of thick strings alone to be seen.

A sensor that gives profiles samples the lit arc evenly along y: φ counts with |dy/dφ| wherever the sensor sees it.
Up to which incidence it does is not known; some limits are averaged, their spread is a σ.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig, SurfaceConfig
from geometry import Pose, Sensor, SurfacePoints, cross
from jig_cad import Jig

Array = NDArray[np.float64]

# Plausible threads: weight, albedo, reflectance at normal incidence, GGX α; matte, satin, polished, bare wire. Their
# mean stands between the extremes, a Lambertian thread and a purely specular one.
THREADS = np.array(
    [
        [0.35, 0.60, 0.00, 0.5],
        [0.15, 0.50, 0.05, 0.3],
        [0.10, 0.30, 0.05, 0.15],
        [0.20, 0.10, 0.30, 0.3],
        [0.20, 0.02, 0.60, 0.2],
    ]
)
LEAST_COSINES = np.array([0.15, 0.3, 0.45, 0.6])  # of incidence, down to which a profile sensor may see a thread
# powers of the light that places count with along the arc, a centroid and a fit that follows its ridge: the benchmark
# extraction_pathtraced has spots of both kinds
POWERS = (1.0, 0.5)
NODES = 32  # Gauss-Legendre; the narrowest lobe above spans several nodes
MEAN_COSINE = 0.86  # of the lit and seen arc about its middle, for a matte string


def axis_points(
    surface: SurfacePoints,
    labels: Sequence[str],
    jig: Jig,
    sensor: Sensor,
    T_sensor_jig: Pose,
    config: CalibConfig,
) -> tuple[Array, Array]:
    """Axis crossings (N, 2) [mm] and covariances (N, 2, 2) of labelled spots.

    surface: N spots, one a label. T_sensor_jig: for the strings' directions; 1° moves the axis by 0.01 radius or so.
    """
    index = [jig.strings.index(label) for label in labels]
    directions = jig.directions[index] @ T_sensor_jig.R.T
    radius = jig.string_diameter_mm / 2
    offset, spread = surface_offset(surface.yz_mm, directions, radius, sensor, config.surface)
    return surface.yz_mm - offset, surface.cov_yz_mm2 + spread


def surface_offset(
    yz_mm: Array, directions: Array, radius_mm: float, sensor: Sensor, surface: SurfaceConfig
) -> tuple[Array, Array]:
    """Lit-surface centroid less axis, in the sheet: mean (..., 2) [mm] and covariance (..., 2, 2) over what is unknown.

    yz_mm: spots (..., 2). directions: of the strings in {P} (..., 3), unit length, either sense.
    """
    if sensor.camera is None:
        each = sampled_offsets(yz_mm, directions, sensor) * radius_mm
        weight = np.full(len(LEAST_COSINES), 1 / len(LEAST_COSINES))
    else:
        threads = np.array([[1.0, surface.diffuse, surface.specular, surface.roughness]]) if surface.known else THREADS
        powers = POWERS[:1] if surface.known else POWERS
        each = centroid_offsets(yz_mm, directions, sensor, threads[:, 1:], powers) * radius_mm  # (..., K, 2)
        weight = np.tile(threads[:, 0] / threads[:, 0].sum() / len(powers), len(powers))
    mean = np.einsum("...ki,k->...i", each, weight)
    rest = each - mean[..., None, :]
    spread = np.einsum("...ki,...kj,k->...ij", rest, rest, weight)
    return mean, spread + surface.diameter_sigma**2 * mean[..., :, None] * mean[..., None, :]


def rough_offset(yz_mm: Array, direction: Array, radius_mm: float, sensor: Sensor) -> Array:
    """Lit-surface centroid less axis (..., 2) [mm], to a third of a radius, for a string near ``direction`` (3,)."""
    point = np.concatenate([np.zeros_like(yz_mm[..., :1]), yz_mm], -1)
    across = [_unit(u - u @ direction[:, None] * direction) for u in (eye - point for eye in sensor.viewpoints_mm)]
    middle = _unit(np.sum(across, axis=0))
    slope = direction[1:] / direction[0]
    return np.asarray(MEAN_COSINE * radius_mm * (middle[..., 1:] - slope * middle[..., :1]))


def centroid_offsets(
    yz_mm: Array, directions: Array, sensor: Sensor, threads: Array, powers: Sequence[float] = (1.0,)
) -> Array:
    """Lit-surface centroid less axis (..., P · K, 2) in radii, for each of K threads (albedo, reflectance, GGX α).

    powers (P,): of the light that its places count with, 1 for the centroid.
    """
    point = np.concatenate([np.zeros_like(yz_mm[..., :1]), yz_mm], -1)
    light = _unit(sensor.sheet.origin_mm - point)
    view = _unit(sensor.require_camera().centre_mm - point)
    l_across, v_across = (_unit(u - np.sum(u * directions, -1, keepdims=True) * directions) for u in (light, view))
    middle = _unit(l_across + v_across)
    side = cross(directions, middle)
    half_angle = np.arccos(np.clip(np.sum(l_across * v_across, -1), -1, 1)) / 2
    nodes, weights = _nodes()
    phi = (np.pi / 2 - half_angle)[..., None] * nodes  # lit and seen: within a right angle of both
    n = np.cos(phi)[..., None] * middle[..., None, :] + np.sin(phi)[..., None] * side[..., None, :]  # (..., Q, 3)
    light_sent = _radiance(n, light[..., None, :], view[..., None, :], threads)  # (..., K, Q)
    w = weights * np.concatenate([light_sent**power for power in powers], axis=-2)
    dx = directions[..., :1]
    slope = directions[..., 1:] / np.where(np.abs(dx) < 1e-6, 1e-6, dx)
    in_sheet = n[..., 1:] - slope[..., None, :] * n[..., :1]
    return np.asarray(w @ in_sheet / np.maximum(w.sum(-1)[..., None], 1e-300))


def sampled_offsets(yz_mm: Array, directions: Array, sensor: Sensor) -> Array:
    """Middle of a profile's points on a string less axis (..., K, 2) in radii, for each of LEAST_COSINES."""
    point = np.concatenate([np.zeros_like(yz_mm[..., :1]), yz_mm], -1)
    light = _unit(sensor.sheet.origin_mm - point)
    toward = _unit(light - np.sum(light * directions, -1, keepdims=True) * directions)
    side = cross(directions, toward)
    nodes, weights = _nodes()
    # the light's part across the string makes the incidence: cos = |across| · cos φ
    slant = np.sqrt(np.maximum(1 - np.sum(light * directions, -1) ** 2, 1e-12))
    most = np.arccos(np.minimum(LEAST_COSINES / slant[..., None], 1.0 - 1e-9))  # (..., K)
    phi = most[..., None] * nodes  # (..., K, Q)
    n = np.cos(phi)[..., None] * toward[..., None, None, :] + np.sin(phi)[..., None] * side[..., None, None, :]
    turned = np.cos(phi)[..., None] * side[..., None, None, :] - np.sin(phi)[..., None] * toward[..., None, None, :]
    dx = directions[..., :1]
    slope = (directions[..., 1:] / np.where(np.abs(dx) < 1e-6, 1e-6, dx))[..., None, None, :]
    in_sheet = n[..., 1:] - slope * n[..., :1]
    step = np.abs(turned[..., 1] - slope[..., 0] * turned[..., 0]) * weights  # |dy/dφ|
    return np.asarray(np.sum(step[..., None] * in_sheet, -2) / np.maximum(step.sum(-1)[..., None], 1e-300))


@lru_cache(maxsize=1)
def _nodes() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return nodes, weights


def _radiance(n: Array, light: Array, view: Array, threads: Array) -> Array:
    """Light sent to the camera per unit of arc (..., K, Q).

    Lambert beside a GGX lobe (Walter et al. 2007) with Schlick's Fresnel reflectance.
    """
    albedo, f0, alpha = (threads[:, i][:, None] for i in range(3))
    half = _unit(light + view)
    nl, nv, nh = (np.maximum(np.sum(n * u, -1), 0.0)[..., None, :] for u in (light, view, half))
    a2 = alpha**2
    density = a2 / (np.pi * (nh**2 * (a2 - 1) + 1) ** 2)
    fresnel = f0 + (1 - f0) * (1 - np.sum(half * light, -1)[..., None, :]) ** 5
    glossy = np.where(f0 > 0, density * fresnel * _masking(nl, a2) * _masking(nv, a2) / 4, 0.0)
    return np.asarray(albedo / np.pi * nl * nv + glossy)


def _masking(cosine: Array, a2: Array) -> Array:
    """Smith's G₁ for GGX."""
    return 2 * cosine / np.maximum(cosine + np.sqrt(a2 + (1 - a2) * cosine**2), 1e-300)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-300))
