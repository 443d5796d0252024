"""How a surface sends the laser's light to the camera."""

from __future__ import annotations

import math

from geometry.compiled import kernel


@kernel(inline=True)
def brdf(diffuse, specular, roughness, cos_i, cos_o, cos_h, cos_d):  # type: ignore[no-untyped-def]
    """Bidirectional reflectance [1/sr] of one surface element.

    cos_i, cos_o: of the angles between its normal and light, and camera; cos_h: normal and halfway vector; cos_d: light
    and halfway vector.
    Lambert's ρ/π and a microfacet lobe D·G·F/(4 cos θᵢ cos θₒ): GGX distribution, Smith's separable shadowing,
    Schlick's Fresnel.
    Source: Walter, Marschner, Li & Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007.
    """
    if specular == 0:
        return diffuse / math.pi
    if cos_i <= 0 or cos_o <= 0:
        return 0.0
    alpha2 = roughness * roughness
    cos_h, cos_d = max(cos_h, 0.0), min(max(cos_d, 0.0), 1.0)
    spread = cos_h * cos_h * (alpha2 - 1) + 1
    distribution = alpha2 / (math.pi * spread * spread)
    fresnel = specular + (1 - specular) * (1 - cos_d) ** 5
    # D·F·G1(i)·G1(o)/(4 cos cos) with G1(c) = 2c/(c + √(α² + (1 − α²)c²)): the cosines cancel
    return diffuse / math.pi + distribution * fresnel / (_smith(cos_i, alpha2) * _smith(cos_o, alpha2))


@kernel(inline=True)
def _smith(cosine, alpha2):  # type: ignore[no-untyped-def]
    return cosine + math.sqrt(alpha2 + (1 - alpha2) * cosine * cosine)
