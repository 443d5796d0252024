"""Light that a lit surface sends on to another: the stripe as a lamp, and the radiance that it gives what it lights.

What the sheet lights is a thin line of small lamps, each with the flux that falls on it and the surface's own BRDF. A
point elsewhere is lit by all of them and scatters that light on to the camera by its own BRDF: laser → glossy → diffuse
(the mirrored sheet's second line), laser → diffuse → glossy (the stripe's mirror image) and laser → diffuse → diffuse
(a broad glow) are one sum. Far lamps are taken together, near ones one by one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from geometry.compiled import kernel
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.light.sheet import density_at, width_at
from perceptron_emu.light.sheet_faces import faces_in_sheet, widest_mm
from perceptron_emu.light.strings import Cylinders
from perceptron_emu.light.stripes import lit_pieces
from perceptron_emu.light.transport import Cosines, Light, LightPath, Surfaces, brdf, surfaces_of
from perceptron_emu.scene import Material, Scene
from perceptron_emu.solids import SheetPieces, World, between, hidden_by_solids, into_solids

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SIDE = math.sqrt(3)  # σ of the sheet, where it is widest, of the two outer of three planes: with their weights the
# sheet's moments up to the fifth are right there (Gauss and Hermite), up to the third where it is thinner
FINEST_MM, FINE_MM, FINE_LOBE = 0.05, 0.25, 1.0  # length of a lamp: of the narrowest lobe α [mm], within these limits
TOGETHER = 5  # lamps along the stripe that may be taken together
# sums over a lobe or over 1/r² converge like exp(−2π · width/step): steps may be as wide as what they sample
TURN_OF_LOBE, TURN_MATTE = 0.8, 0.3  # by which normals of lamps taken together may differ: of α, without gloss [rad]
NEAR, NEAR_LOBE = 1.5, 0.5  # extents, and extents over α; what is nearer than both counts one by one
IN_A_GROUP, GROUP_MM = 48, 20.0  # of what is asked together whether it is in sight
STRING_NODES = 12  # lamps around a string's lit half
MOST_SENT_BACK = 0.99  # of the light that falls on a surface; white paint sends back 0.9
MIRROR, MIRROR_LOBE, MIRRORED_SHARE = 0.5, 0.05, 0.5  # reflectance and α of a mirror; part of its light that is thrown
FAR_MM = 1e6  # of a lamp whose light comes from one direction
OFF_MM = 1e-4  # where a ray from a surface starts
SAME_PLANE_MM = 1e-6  # height of one element over another's plane up to which rounding alone lifts it
NEGLIGIBLE = 1e-4  # part of the light so far below which a group's is not asked for
SMALL = 0.02  # part of the light so far up to which a group is in sight, or not, as its brightest is
SMALLEST = 1e-4  # of the largest lamp: what brings less is left out


class Lamps(NamedTuple):
    """Lit surface elements (N,).

    Parameters
    ----------
    xyz, normal : Array
        (N, 3) [mm] in {P}, unit normals towards the laser.
    flux : Array
        (N,) electrons that the light which falls on each would bring to the chip, all of it.
    area : Array
        (N,) [mm²].
    surface : NDArray
        (N,) number of the material.
    clear : NDArray
        (N,) number of the solid that hides nothing of what faces a lamp, its own, or -1.
    """

    xyz: Array
    normal: Array
    flux: Array
    area: Array
    surface: Index
    clear: Index

    def part(self, which: Index) -> Lamps:
        """Some of them, in that order."""
        return Lamps(
            self.xyz[which],
            self.normal[which],
            self.flux[which],
            self.area[which],
            self.surface[which],
            self.clear[which],
        )


# a lamp in one row: point, normal, unit way (y, z) to the laser, flux, area, material, solid that hides nothing of it
LAMP = np.dtype(
    [
        ("xyz", float, 3),
        ("normal", float, 3),
        ("towards", float, 2),
        ("flux", float),
        ("area", float),
        ("surface", np.int64),
        ("clear", np.int64),
    ]
)
Table = NDArray[np.void]


def _table(lamps: Lamps, origin: Array) -> Table:
    out = np.empty(len(lamps.flux), LAMP)
    for name in ("xyz", "normal", "flux", "area", "surface", "clear"):
        out[name] = getattr(lamps, name)
    towards = origin[1:] - lamps.xyz[:, 1:]
    out["towards"] = towards / np.sqrt(towards[:, :1] ** 2 + towards[:, 1:] ** 2)
    return out


class Sources(NamedTuple):
    """Lamps, and what of them is taken together.

    Parameters
    ----------
    lamps : NDArray
        (N,) of LAMP: one by one, in the order of bunches.
    bunches : NDArray
        (B,) of LAMP: taken together.
    begin : NDArray
        (B + 1,) where each bunch's lamps begin.
    near : Array
        (B,) [mm] distance below which a bunch's lamps count one by one.
    groups : NDArray
        (G + 1,) where each group of bunches begins.
    surfaces : Surfaces
        Materials of all solids, then of the strings.
    """

    lamps: Table
    bunches: Table
    begin: Index
    near: Array
    groups: Index
    surfaces: Surfaces


def bounce_sources(scene: Scene, strings: Cylinders | None, thread: Material, config: EmulatorConfig) -> Sources | None:
    """All that the laser lights, seen by the camera or not, as lamps.

    Parameters
    ----------
    scene : Scene
        A sensor with a camera, and what stands before it.
    strings : Cylinders or None
        The jig's.
    thread : Material
        Theirs.
    config : EmulatorConfig
        The laser.

    Returns
    -------
    Sources or None
        None where nothing is lit.
    """
    if not scene.solids:
        return None
    _check_materials(scene)
    path = Light(scene.sensor, config).path
    materials = [*(s.material for s in scene.solids), thread]
    lobe = min((m.roughness for m in materials[:-1] if m.specular > 0), default=1.0)
    length = min(max(FINE_LOBE * lobe, FINEST_MM), FINE_MM)
    parts = [_on_solids(scene, strings, config, path, length)]
    if strings is not None:
        parts.append(_on_strings(scene, strings, path, len(scene.solids)))
    lamps = Lamps(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    lamps = lamps.part(np.flatnonzero(lamps.flux > SMALLEST * lamps.flux.max(initial=0.0)))
    if len(lamps.flux) == 0:
        return None
    _check_mirrors(scene, lamps, path)
    angle = np.round(np.arctan2(lamps.xyz[:, 1] - path.origin[1], lamps.xyz[:, 2] - path.origin[2]), 9)
    lamps = lamps.part(np.lexsort((lamps.xyz[:, 0], angle, lamps.surface)))
    surfaces = surfaces_of(materials)
    begin = _bunches(lamps, surfaces, TOGETHER * length)
    bunches, near = _together(lamps, begin, surfaces)
    groups, (one, many) = _groups(bunches), (_table(of, path.origin) for of in (lamps, bunches))
    return Sources(one, many, begin, near, groups, surfaces)


def far_lamp(materials: Sequence[Material], direction: Array, irradiance: float) -> Sources:
    """One lamp so far away that its light comes from one direction everywhere.

    Parameters
    ----------
    materials : sequence of Material
        Of all solids.
    direction : Array
        (3,) unit, along which its light travels in {P}.
    irradiance : float
        On a surface that faces it.

    Returns
    -------
    Sources
        For `radiance`.
    """
    flux = math.pi * FAR_MM * FAR_MM * irradiance
    white, none = np.array([len(materials)]), np.array([-1])
    one = Lamps(-FAR_MM * direction[None], direction[None], np.array([flux]), np.zeros(1), white, none)
    table = _table(one, -2 * FAR_MM * direction)
    each = np.array([0, 1])
    return Sources(table, table, each, np.zeros(1), each, surfaces_of([*materials, Material(1.0)]))


def _check_materials(scene: Scene) -> None:
    """InputError for surfaces between which light would never die down."""
    for k, solid in enumerate(scene.solids):
        material, name = solid.material, solid.name or f"number {k}"
        if material.diffuse + material.specular > MOST_SENT_BACK:
            raise InputError(
                f"solid {name}: diffuse + specular = {material.diffuse + material.specular:g} sends back all light, "
                f"which would bounce without end; with [light] bounces keep it at {MOST_SENT_BACK:g} or less"
            )


def _check_mirrors(scene: Scene, lamps: Lamps, path: LightPath) -> None:
    """InputError where a nearly perfect mirror throws the sheet straight back at the emitter or into the camera."""
    for k, solid in enumerate(scene.solids):
        material = solid.material
        if material.specular < MIRROR or material.roughness > MIRROR_LOBE:
            continue
        mine = lamps.surface == k
        if not np.any(mine):
            continue
        xyz, normal = lamps.xyz[mine], lamps.normal[mine]
        way = xyz - path.origin
        way[:, 0] = 0
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        mirrored = way - 2 * np.sum(way * normal, 1, keepdims=True) * normal
        for target, what in ((path.origin, "back at the laser"), (path.camera, "into the camera")):
            towards = target - xyz
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
            share = lamps.flux[mine][np.sum(mirrored * towards, 1) > np.cos(2 * material.roughness)].sum()
            if share > MIRRORED_SHARE * lamps.flux[mine].sum():
                raise InputError(
                    f"solid {solid.name or f'number {k}'}: a mirror (specular {material.specular:g}, roughness "
                    f"{material.roughness:g}) that throws the laser {what}; turn it, or give it a roughness above "
                    f"{MIRROR_LOBE:g}"
                )


def _on_solids(
    scene: Scene, strings: Cylinders | None, config: EmulatorConfig, path: LightPath, length: float
) -> Lamps:
    faces, sensor = faces_in_sheet(scene, config), scene.sensor
    if len(faces.triangles) == 0:
        return _none()
    sigma = min(float(width_at(_farthest(faces.triangles, path), path.beam)), widest_mm(sensor, config)) / 2
    planes = SIDE * sigma * np.array([-1.0, 0.0, 1.0])
    pieces = lit_pieces(faces, strings, planes, sensor)
    slant = np.sqrt(np.maximum(1 - faces.facing[pieces.face, 0] ** 2, 1e-12))
    solid = faces.solid[pieces.face]
    clear = np.where(faces.bare[pieces.face], solid, -1)
    return _lamps(pieces, 1 / slant, (solid, clear), float(planes[2]), path, length)


def _farthest(triangles: Array, path: LightPath) -> Array:
    """Distance [mm] from the emitter at which the sheet is widest on the triangles."""
    distance = np.linalg.norm(triangles[..., 1:] - path.origin[1:], axis=-1)
    ends = np.array([distance.min(), distance.max()])
    return np.asarray(ends[np.argmax(np.abs(ends - path.beam.at_mm))])


@kernel
def _lamps(
    pieces: SheetPieces, slant: Array, solids: tuple[Index, Index], side: float, path: LightPath, length: float
) -> Lamps:
    """Middles of equal parts of the pieces; slant: width on each face of 1 mm of the sheet; side: the outer planes;
    solids: each piece's own, and which hides nothing of it.
    """
    parts = np.empty(len(pieces.face), np.int64)
    for p in range(len(parts)):
        size = 0.0
        for a in range(3):
            size += (pieces.ends[p, 1, a] - pieces.ends[p, 0, a]) ** 2
        parts[p] = max(1, math.ceil(math.sqrt(size) / length))
    count = parts.sum()
    xyz, normal = np.empty((count, 3)), np.empty((count, 3))
    flux, area = np.empty(count), np.empty(count)
    surface, clear = np.empty(count, np.int64), np.empty(count, np.int64)
    n = 0
    for p in range(len(parts)):
        size = 0.0
        for a in range(3):
            size += (pieces.ends[p, 1, a] - pieces.ends[p, 0, a]) ** 2
        for k in range(parts[p]):
            s, norm = (k + 0.5) / parts[p], 0.0
            for a in range(3):
                xyz[n, a] = pieces.ends[p, 0, a] + s * (pieces.ends[p, 1, a] - pieces.ends[p, 0, a])
                normal[n, a] = pieces.normals[p, 0, a] + s * (pieces.normals[p, 1, a] - pieces.normals[p, 0, a])
                norm += normal[n, a] * normal[n, a]
            ly, lz = path.origin[1] - xyz[n, 1], path.origin[2] - xyz[n, 2]
            distance = math.sqrt(ly * ly + lz * lz)
            cosine = (normal[n, 1] * ly + normal[n, 2] * lz) / distance
            scale = (-1.0 if cosine < 0 else 1.0) / max(math.sqrt(norm), 1e-12)
            for a in range(3):
                normal[n, a] *= scale
            sigma = width_at(distance, path.beam) / 2
            outer = min(sigma * sigma / (2 * side * side), 0.5)
            share = outer if xyz[n, 0] != 0 else 1 - 2 * outer
            along = math.sqrt(size) / parts[p] * slant[p]
            area[n] = along * side
            power = density_at(math.atan2(-ly, -lz), path.fan) / distance * share
            flux[n] = path.scale * power * abs(cosine) / max(math.sqrt(norm), 1e-12) * along
            surface[n], clear[n] = solids[0][p], solids[1][p]
            n += 1
    return Lamps(xyz, normal, flux, area, surface, clear)


def _on_strings(scene: Scene, strings: Cylinders, path: LightPath, surface: int) -> Lamps:
    """The lit half of every string where it crosses the sheet; its crossing as a whole, which is small."""
    reached = np.flatnonzero(~np.isnan(strings.crossing[:, 0]) & (np.abs(strings.directions[:, 0]) > SMALLEST))
    if len(reached) == 0:
        return _none()
    d, centre = strings.directions[reached], strings.crossing[reached]
    towards = path.origin - centre
    distance = np.linalg.norm(towards, axis=1)
    first = towards - np.sum(towards * d, 1, keepdims=True) * d
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(d, first)
    node, weight = np.polynomial.legendre.leggauss(STRING_NODES)
    psi, weight = np.pi / 2 * node, np.pi / 2 * weight
    normal = np.cos(psi)[:, None] * first[:, None] + np.sin(psi)[:, None] * second[:, None]  # (S, K, 3)
    xyz = centre[:, None] + strings.radius * normal
    cosine = np.maximum(np.sum(normal * (towards / distance[:, None])[:, None], -1), 0)
    arc = strings.radius * weight / np.abs(d[:, :1])
    angle = np.arctan2(-towards[:, 1], -towards[:, 2])
    density = np.array([density_at(a, path.fan) for a in angle]) / distance
    flux = path.scale * density[:, None] * cosine * arc
    area = arc * width_at(distance, path.beam)[:, None]
    points = xyz.reshape(-1, 3) + OFF_MM * normal.reshape(-1, 3)
    emitter = points.copy()
    emitter[:, 1:] = path.origin[1:]
    shaded = hidden_by_solids(scene.solids, points, emitter)
    bright = np.where(shaded, 0.0, flux.ravel())
    numbers = np.full(flux.size, surface), np.full(flux.size, -1)
    return Lamps(xyz.reshape(-1, 3), normal.reshape(-1, 3), bright, area.ravel(), *numbers)


def _none() -> Lamps:
    return Lamps(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), *np.zeros((2, 0), np.int64))


@kernel
def _bunches(lamps: Lamps, surfaces: Surfaces, size: float) -> Index:
    """Where runs of lamps begin that lie close together on one surface and face one way, and the end."""
    begin = np.empty(len(lamps.flux) + 1, np.int64)
    count = 0
    for i in range(len(lamps.flux)):
        which = lamps.surface[i]
        if count > 0 and lamps.surface[begin[count - 1]] == which:
            first, apart, cosine = begin[count - 1], 0.0, 0.0
            for a in range(3):
                apart += (lamps.xyz[i, a] - lamps.xyz[first, a]) ** 2 if a else 0.0
                cosine += lamps.normal[i, a] * lamps.normal[first, a]
            glossy = surfaces[which]["specular"] > 0
            turn = TURN_OF_LOBE * surfaces[which]["roughness"] if glossy else TURN_MATTE
            if apart < size * size and cosine > 1 - turn * turn / 2:
                continue
        begin[count] = i
        count += 1
    begin[count] = len(lamps.flux)
    return begin[: count + 1].copy()


@kernel(inline=True)
def _middle(begin: Index, bunch: int) -> int:
    """The lamp in a bunch's middle: the mean of several lies inside a round solid."""
    return int((begin[bunch] + begin[bunch + 1]) // 2)


@kernel
def _together(lamps: Lamps, begin: Index, surfaces: Surfaces) -> tuple[Lamps, Array]:
    """Bunches as one lamp each, and the distance (B,) below which theirs count one by one."""
    count = len(begin) - 1
    xyz, normal, near = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    flux, area = np.zeros(count), np.zeros(count)
    surface, clear = np.empty(count, np.int64), np.empty(count, np.int64)
    sharp = 1.0
    for m in surfaces:
        if m["specular"] > 0:
            sharp = min(sharp, m["roughness"])
    for b in range(count):
        for i in range(begin[b], begin[b + 1]):
            flux[b] += lamps.flux[i]
            area[b] += lamps.area[i]
            for a in range(3):
                xyz[b, a] += lamps.flux[i] * lamps.xyz[i, a]
                normal[b, a] += lamps.flux[i] * lamps.normal[i, a]
        size, extent = 0.0, 0.0
        for a in range(3):
            xyz[b, a] /= flux[b]
            size += normal[b, a] * normal[b, a]
        for a in range(3):
            normal[b, a] /= max(math.sqrt(size), 1e-12)
        for i in range(begin[b], begin[b + 1]):
            apart = 0.0
            for a in range(3):
                apart += (lamps.xyz[i, a] - xyz[b, a]) ** 2
            extent = max(extent, 2 * math.sqrt(apart))
        surface[b], clear[b] = lamps.surface[begin[b]], lamps.clear[_middle(begin, b)]
        near[b] = extent * max(NEAR, NEAR_LOBE / sharp) if begin[b + 1] - begin[b] > 1 else 0.0
    return Lamps(xyz, normal, flux, area, surface, clear), near


@kernel
def _groups(bunches: Lamps) -> Index:
    begin = np.empty(len(bunches.flux) + 1, np.int64)
    count = 0
    for i in range(len(bunches.flux)):
        if count > 0:
            first, apart = begin[count - 1], 0.0
            for a in range(3):
                apart += (bunches.xyz[i, a] - bunches.xyz[first, a]) ** 2
            alike = bunches.surface[first] == bunches.surface[i]
            if alike and i - first < IN_A_GROUP and apart < GROUP_MM * GROUP_MM:
                continue
        begin[count] = i
        count += 1
    begin[count] = len(bunches.flux)
    return begin[: count + 1].copy()


class BounceRoom(NamedTuple):
    """Arrays to work in: a stack (256,), a point (3,) and its places in the solids' axes (S, 3), what bunches bring
    (IN_A_GROUP,); and a lamp of each bunch in the solids' axes (B, S, 3).
    """

    stack: Index
    point: Array
    own: Array
    part: Array
    lamps: Array


@kernel(inline=True)
def bounce_room(sources: Sources, world: World) -> BounceRoom:
    """Room for `radiance` of these lamps among these solids; the lamp in a bunch's middle stands for all."""
    count, solids = len(sources.bunches), len(world.roots)
    point, lamps = np.empty(3), np.empty((count, solids, 3))
    for b in range(count):
        lamp = sources.lamps[_middle(sources.begin, b)]
        for a in range(3):
            point[a] = lamp["xyz"][a] + OFF_MM * lamp["normal"][a]
        into_solids(world, point, lamps[b])
    return BounceRoom(np.empty(256, np.int64), point, np.empty((solids, 3)), np.empty(IN_A_GROUP), lamps)


@kernel(inline=True)
def radiance(sources: Sources, world: World, element: Array, surface: int, clear: int, room: BounceRoom) -> float:
    """Light per area and solid angle that a surface element lit by lamps sends to the camera.

    L = Σ Φ f_A cos θ_A · cos θ_B f_B / r², Φ the flux on lamp A; r² + A/π in place of r² for lamps as near as they are
    large (a disc's form factor). In electrons per mm² and sr. element: its point, its unit normal on the camera's side
    and the unit way to the camera (3, 3); surface: the number of its material;
    clear: of the solid that hides nothing of what faces it, or -1.
    """
    lamps, bunches, begin, near = sources.lamps, sources.bunches, sources.begin, sources.near
    groups, surfaces, part = sources.groups, sources.surfaces, room.part
    lit = surfaces[surface]
    total = 0.0
    for a in range(3):
        room.point[a] = element[0, a] + OFF_MM * element[1, a]
    into_solids(world, room.point, room.own)
    for g in range(len(groups) - 1):
        first, last = groups[g], groups[g + 1] - 1
        group, bright, low, high = 0.0, first, last, first  # what brings most, the ends of what brings light
        for b in range(first, last + 1):
            apart, brought = 0.0, 0.0
            for a in range(3):
                apart += (bunches[b]["xyz"][a] - element[0, a]) ** 2
            if apart >= near[b] * near[b]:
                brought = _from(bunches[b], surfaces[bunches[b]["surface"]], element, lit)
            else:
                for i in range(begin[b], begin[b + 1]):
                    brought += _from(lamps[i], surfaces[lamps[i]["surface"]], element, lit)
            part[b - first] = brought
            if brought > 0:
                group += brought
                low, high = min(low, b), b
                bright = b if brought > part[bright - first] else bright
        if group <= NEGLIGIBLE * total:
            continue
        seen = _in_sight(sources, world, clear, bright, room)
        if group <= SMALL * total or (
            (low == bright or seen == _in_sight(sources, world, clear, low, room))
            and (high == bright or seen == _in_sight(sources, world, clear, high, room))
        ):
            total += group if seen else 0.0
            continue
        for b in range(first, last + 1):
            if part[b - first] > 0 and _in_sight(sources, world, clear, b, room):
                total += part[b - first]
    return total


@kernel(inline=True)
def _in_sight(sources: Sources, world: World, clear: int, bunch: int, room: BounceRoom) -> bool:
    """Whether nothing stands between an element and a bunch that face each other."""
    return not between(world, room.own, room.lamps[bunch], (clear, sources.bunches[bunch]["clear"]), room.stack)


@kernel(fastmath=True, inline=True)
def _from(lamp: np.void, material: np.void, element: Array, lit: np.void) -> float:
    """What one lamp brings, nothing being in the way."""
    rx, ry, rz = lamp["xyz"][0] - element[0, 0], lamp["xyz"][1] - element[0, 1], lamp["xyz"][2] - element[0, 2]
    nx, ny, nz = lamp["normal"][0], lamp["normal"][1], lamp["normal"][2]
    cos_b = element[1, 0] * rx + element[1, 1] * ry + element[1, 2] * rz
    cos_a = -(nx * rx + ny * ry + nz * rz)
    if cos_a <= SAME_PLANE_MM or cos_b <= SAME_PLANE_MM:
        return 0.0
    r2 = rx * rx + ry * ry + rz * rz
    r = math.sqrt(r2)
    if r < OFF_MM:
        return 0.0
    rx, ry, rz, cos_a, cos_b = rx / r, ry / r, rz / r, cos_a / r, cos_b / r
    f_a, f_b = material["diffuse"] / math.pi, lit["diffuse"] / math.pi
    if material["specular"] > 0:
        ly, lz = lamp["towards"][0], lamp["towards"][1]
        hy, hz = ly - ry, lz - rz  # halfway between the laser and the way to the element
        size = max(math.sqrt(rx * rx + hy * hy + hz * hz), 1e-12)
        cos_h = (-nx * rx + ny * hy + nz * hz) / size
        f_a = brdf(material, Cosines(ny * ly + nz * lz, cos_a, cos_h, (ly * hy + lz * hz) / size))
    if lit["specular"] > 0:
        cx, cy, cz = element[2, 0] + rx, element[2, 1] + ry, element[2, 2] + rz
        size = max(math.sqrt(cx * cx + cy * cy + cz * cz), 1e-12)
        cos_o = element[1, 0] * element[2, 0] + element[1, 1] * element[2, 1] + element[1, 2] * element[2, 2]
        cos_h = (element[1, 0] * cx + element[1, 1] * cy + element[1, 2] * cz) / size
        f_b = brdf(lit, Cosines(cos_b, cos_o, cos_h, (rx * cx + ry * cy + rz * cz) / size))
    brought: float = lamp["flux"] * f_a * cos_a * cos_b * f_b / (r2 + lamp["area"] / math.pi)
    return brought
