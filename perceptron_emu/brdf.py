"""How a surface sends the laser's light to the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from perceptron_emu.scene import Material

Array = NDArray[np.float64]


def brdf(material: Material, normal: Array, to_light: Array, to_camera: Array) -> Array:
    """Bidirectional reflectance (...) [1/sr] for unit vectors (..., 3).

    Lambert's ρ/π and a microfacet lobe D·G·F/(4 cos θᵢ cos θₒ): GGX distribution, Smith's separable shadowing,
    Schlick's Fresnel.
    Source: Walter, Marschner, Li & Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007.
    """
    diffuse = np.full(normal.shape[:-1], material.diffuse / np.pi)
    if material.specular == 0:
        return diffuse
    cos_i, cos_o = _dot(normal, to_light), _dot(normal, to_camera)
    half = to_light + to_camera
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
    cos_h, cos_d = np.maximum(_dot(normal, half), 0), np.clip(_dot(to_light, half), 0, 1)
    alpha2 = material.roughness**2
    distribution = alpha2 / (np.pi * (cos_h**2 * (alpha2 - 1) + 1) ** 2)
    fresnel = material.specular + (1 - material.specular) * (1 - cos_d) ** 5
    # D·F·G1(i)·G1(o)/(4 cos cos) with G1(c) = 2c/(c + √(α² + (1 − α²)c²)): the cosines cancel
    lobe = distribution * fresnel / (_smith(np.maximum(cos_i, 0), alpha2) * _smith(np.maximum(cos_o, 0), alpha2))
    return np.where((cos_i > 0) & (cos_o > 0), diffuse + lobe, 0.0)


def _smith(cosine: Array, alpha2: float) -> Array:
    return np.asarray(cosine + np.sqrt(alpha2 + (1 - alpha2) * cosine**2))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", a, b))
