"""The judgement on the data and on the answer, with advice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.judge.words import accusation
from calib.result import Code, Culprit, Verdict
from geometry import Frame, Pose, log_so3, stack_poses
from geometry.special import chdtri

Array = NDArray[np.float64]

# benchmarks/calib_degenerate.py: every spoilt set of its kinds is refused, none of the sound ones
_SAME_MM, _SAME_DEG = 1.0, 0.1  # configurations nearer than this are one: some hundred times an arm's repeatability
_MISFIT_TAIL = 1e-4  # of sound data are called a misfit by chance
_AS_STATED = 1.5  # χ² per degree of freedom from which it is said that the noise is more than stated
_LEVER_MM = 5.0  # over 300 mm of stand-off a degree: less turns positions by no more than their noise
RIVAL_CHI2 = 12.0  # a likelihood ratio of 400: what is nearer is called ambiguous
_GROSS_CHI2 = 30.0  # with all robot errors free within their priors; sound cells stay below 2
_UNOBSERVABLE_MM, _UNOBSERVABLE_DEG = 20.0, 5.0  # σ from noise alone: worse than any mounting drawing
REST_SLACK = 1.0  # σ that the largest of all other pulls may be beyond the limit once a number is allowed for
_WEAK_MM, _WEAK_DEG = 1.0, 0.3  # σ from noise alone: ten times that of seven ordinary views at three places


@dataclass(frozen=True, eq=False)
class Motion:
    """How the hand moved between the frames of a location (the largest location counts).

    frames, pairs: used frames, and frames beyond each location's first. distinct: that many differ by more than a
    millimetre or a tenth of a degree. rotation_deg: largest relative rotation; second_deg: rms rotation about the
    axis at right angles to the main one; lever_mm: spread of the jig's origin in the sensor frame.
    """

    frames: int
    pairs: int
    distinct: int
    rotation_deg: float
    second_deg: float
    lever_mm: float


def frames_motion(used: Sequence[Frame]) -> Motion:
    """How the hand moved between labelled frames."""
    names = list(dict.fromkeys(f.location for f in used))
    place = np.array([names.index(f.location) for f in used], dtype=np.intp)
    firsts = stack_poses([f.candidates[0] for f in used])
    return motion(stack_poses([f.at for f in used]), firsts, place)


def motion(Ts_base_hand: Pose, Ts_sensor_jig: Pose, location: NDArray[np.intp]) -> Motion:
    """Summarise the relative motions of the used frames."""
    pairs = distinct = 0
    vectors, lever = [np.zeros((0, 3))], 0.0
    for name in np.unique(location):
        index = np.flatnonzero(location == name)
        hands = Ts_base_hand[index]
        relative = hands[:1].inverse() @ hands
        different = _distinct(relative)
        pairs, distinct = pairs + len(index) - 1, distinct + different - 1
        i, j = np.triu_indices(len(index), 1)
        if len(i):
            vectors.append(log_so3(np.swapaxes(hands.R[i], -1, -2) @ hands.R[j]))
        origins = Ts_sensor_jig[index].t
        lever = max(lever, float(np.max(np.linalg.norm(origins - origins.mean(axis=0), axis=-1))))
    every = np.concatenate(vectors)
    if not len(every):
        return Motion(len(location), pairs, distinct, 0.0, 0.0, lever)
    rms = np.linalg.svd(every / np.sqrt(len(every)), compute_uv=False)
    largest = np.max(np.linalg.norm(every, axis=-1))
    second = rms[1] if len(rms) > 1 else 0.0
    return Motion(len(location), pairs, distinct, float(np.rad2deg(largest)), float(np.rad2deg(second)), lever)


def _distinct(relative: Pose) -> int:
    """How many of the poses differ from all before them."""
    apart = np.linalg.norm(relative.t[:, None] - relative.t, axis=-1)
    chord = np.linalg.norm(relative.R[:, None] - relative.R, axis=(-1, -2))  # 2√2 sin(angle / 2)
    far = (apart > _SAME_MM) | (chord > 2 * np.sqrt(2) * np.sin(np.deg2rad(_SAME_DEG) / 2))
    kept: list[int] = []
    for i in range(len(relative)):
        if np.all(far[i, kept]):
            kept.append(i)
    return len(kept)


def judge_motion(m: Motion, config: CalibConfig) -> Verdict | None:
    """What can be said before solving: too few, too alike, too little rotation; None where nothing is wrong."""
    if m.pairs < 2:
        return Verdict(
            "too_few_poses",
            f"{m.frames} usable calibrate frames give {m.pairs} relative motions: at least 2 are needed, that is "
            "3 frames of one jig location, and 7 or more are advised; take more configurations",
        )
    if m.distinct < 2:
        return Verdict(
            "poses_not_distinct",
            f"only {m.distinct + 1} of {m.frames} configurations differ by more than {_SAME_MM:g} mm or "
            f"{_SAME_DEG:g}°: move the robot between the frames of a location",
        )
    if m.rotation_deg < config.min_rotation_deg or m.second_deg < config.min_rotation_deg / 6:
        return Verdict(
            "rotation_too_small",
            f"the hand turns by at most {m.rotation_deg:.2g}° between the frames of a location, and by "
            f"{m.second_deg:.2g}° rms about a second axis: turn it by 20° or more about two axes "
            "(joints given in radians under a degree header look like this, too)",
        )
    return None


def misfit_limit(dof: int, least: float) -> float:
    """χ² per degree of freedom above which chance is no explanation, and never below ``least``."""
    return max(least, float(chdtri(max(dof, 1), _MISFIT_TAIL)) / max(dof, 1))


@dataclass(frozen=True)
class Contradiction:
    """A number of the files that does not go with the data.

    rest: the largest pull once it is allowed for. gross: it is off by more than typing errors and mounts account for.
    """

    culprit: Culprit
    rest: float
    gross: bool = False


@dataclass(frozen=True, eq=False)
class Facts:
    """What a solved calibration is judged by.

    explained: χ² per degree of freedom with all robot errors free within their priors.
    noise_covariance (6, 6): of the SCP from noise alone. outlier_share: of the points. outlying_strings: whose points
    are mostly outliers. rival: how much larger the χ² of another answer is. contradiction: what of the files does not
    go with the data; largest_pull: of all other numbers. inferred: the joints follow from hand poses.
    """

    converged: bool
    iterations: int
    chi2_per_dof: float
    explained: float
    dof: int
    condition: float
    noise_covariance: Array
    outlier_share: float
    outlying_strings: tuple[str, ...]
    rival: float
    locations: int
    contradiction: Contradiction | None = None
    largest_pull: float = 0.0
    inferred: bool = False


def judge(f: Facts, moved: Motion, config: CalibConfig) -> Verdict:
    """The verdict on a solved calibration, the gravest first."""
    return (
        _lever(moved, config)  # also why the paper's iteration would not settle
        or _not_converged(f)
        or _outliers(f, config)
        or _ambiguous(f)
        or _not_observable(f)
        or _contradiction(f, config)
        or _misfit(f, config)
        or _weak(f, config)
        or Verdict("ok", _ok_text(f, moved, config))
    )


def _not_converged(f: Facts) -> Verdict | None:
    if f.converged and np.all(np.isfinite(f.noise_covariance)):
        return None
    return Verdict(
        "not_converged",
        f"the iteration did not settle in {f.iterations} steps: check that the robot's table is this arm's, "
        "scp_initial, the jig's size, the labels, which location each frame names, and the joint columns (order, sign, "
        "degrees)",
    )


def _outliers(f: Facts, config: CalibConfig) -> Verdict | None:
    if f.outlier_share > config.max_outlier_share:
        return Verdict(
            "outliers",
            f"{f.outlier_share:.0%} of the points contradict the rest (limit {config.max_outlier_share:.0%}): check "
            "the labels, the jig's size, which location each frame names, and the joint columns (order, sign, degrees)",
        )
    if f.outlying_strings:
        return Verdict(
            "outliers",
            f"the points of string {', '.join(f.outlying_strings)} contradict the others in most frames: check the "
            "labels, the jig's strings and its anchors",
        )
    if f.explained > _GROSS_CHI2:
        return Verdict(
            "outliers",
            "the frames contradict one another far beyond all noise and the robot's stated uncertainty (χ² "
            f"{f.explained:.3g} per degree of freedom even with all DH parameters free within their priors): check "
            "the DH table, the jig's size, the labels, the locations and the joint columns",
        )
    return None


def _ambiguous(f: Facts) -> Verdict | None:
    if f.rival > RIVAL_CHI2:
        return None
    return Verdict(
        "ambiguous_pose",
        f"two jig poses explain the points about equally well (χ² differs by {f.rival:.2g}), with different "
        "answers: take frames with another tilt, or a jig with the sixth string",
    )


def _lever(moved: Motion, config: CalibConfig) -> Verdict | None:
    """Positions alone lose the rotation where the jig's origin stands still in the sensor; whole points do not."""
    if config.method != "paper" or moved.lever_mm > _LEVER_MM:
        return None
    return Verdict(
        "lever_constant",
        f"the jig's origin stays within {moved.lever_mm:.2g} mm of one point of the sensor, where positions alone "
        "can not show the rotation: vary where the sensor sees the jig by some centimetres, or use --method bundle",
    )


def _not_observable(f: Facts) -> Verdict | None:
    sigma_mm, sigma_deg = _largest_sigmas(f.noise_covariance)
    if np.isfinite(f.condition) and sigma_mm < _UNOBSERVABLE_MM and sigma_deg < _UNOBSERVABLE_DEG:
        return None
    return Verdict(
        "not_observable",
        f"the frames leave a direction of the SCP open (σ {sigma_mm:.3g} mm, {sigma_deg:.3g}° from noise alone, "
        f"condition {f.condition:.3g}): {direction_in_words(f.noise_covariance)}; turn the hand about a second axis "
        "and vary the views",
    )


def _contradiction(f: Facts, config: CalibConfig) -> Verdict | None:
    """What of the files is contradicted, and whether allowing for it explains the data."""
    if f.contradiction is None:
        return None
    c, rest = f.contradiction.culprit, f.contradiction.rest
    code: Code = "sensor_suspect" if c.block == "sensor" else "priors_contradict"
    words = accusation(c)
    if f.contradiction.gross:
        return Verdict(
            code,
            f"{words}. An error of that size is none that σ can be given for: correct it and calibrate again",
            withheld=True,
        )
    if f.explained > misfit_limit(f.dof, config.misfit_chi2) or rest > config.pull_limit + REST_SLACK:
        return Verdict(
            code,
            f"{words}. Even so the data do not fit together (χ² {f.explained:.3g} per degree of freedom, another "
            f"number is pulled by {rest:.1f} σ): more than one number is wrong, so no σ can be given, and none is",
            withheld=True,
        )
    return Verdict(code, f"{words}. The σ given allow for it; correct the number and calibrate again for smaller ones")


def _misfit(f: Facts, config: CalibConfig) -> Verdict | None:
    limit = misfit_limit(f.dof, config.misfit_chi2)
    paper = config.method == "paper"
    if paper and f.chi2_per_dof > limit:
        return Verdict(
            "model_misfit",
            f"χ² per degree of freedom is {f.chi2_per_dof:.3g}, far from 1: the residuals exceed the noise of points "
            "and joints; with --method bundle robot errors can be told from noise. The σ given carry the robot's "
            "uncertainty",
        )
    fits = f.explained <= limit and f.largest_pull <= config.pull_limit + REST_SLACK
    if f.inferred and f.chi2_per_dof > limit and not fits:
        return Verdict(
            "model_misfit",
            f"χ² per degree of freedom is {f.chi2_per_dof:.3g}, far from 1: the residuals exceed the noise of points "
            "and joints, and errors of the robot's table of the stated size do not explain them; with joint readings "
            "in frames.csv robot errors can be told from noise. No σ can be given, and none is",
            withheld=True,
        )
    if paper or f.inferred or fits:
        return None
    return Verdict(
        "model_misfit",
        f"χ² per degree of freedom is {f.explained:.3g} even with every number of the robot's table free within its "
        f"prior (the largest pull is {f.largest_pull:.1f} σ), and no single number of the files explains it: check the "
        "noise given, then the frames with the largest residuals. No σ can be given, and none is",
        withheld=True,
    )


def _weak(f: Facts, config: CalibConfig) -> Verdict | None:
    sigma_mm, sigma_deg = _largest_sigmas(f.noise_covariance)
    if f.condition < config.weak_condition and sigma_mm < _WEAK_MM and sigma_deg < _WEAK_DEG:
        return None
    return Verdict(
        "weak",
        f"a direction of the SCP is poorly determined (σ {sigma_mm:.2g} mm, {sigma_deg:.2g}° from noise alone, "
        f"condition {f.condition:.3g}): {direction_in_words(f.noise_covariance)}; add frames with larger rotations "
        "about other axes",
    )


def _ok_text(f: Facts, moved: Motion, config: CalibConfig) -> str:
    larger = f.explained > misfit_limit(f.dof, _AS_STATED)
    residuals = (
        f"the residuals are {np.sqrt(f.explained):.1f} times what σ of points and joints say, and the σ given follow"
        if larger
        else "the residuals agree with the noise"
    )
    text = (
        f"{moved.frames} frames at {f.locations} locations, rotations up to {moved.rotation_deg:.0f}°: "
        f"{residuals} (χ² {f.explained:.2f} per degree of freedom)"
    )
    if f.chi2_per_dof <= misfit_limit(f.dof, config.misfit_chi2):
        return text
    return (
        f"{text} once errors of the robot's table of the stated size are allowed for; with the model asked for it is "
        f"{f.chi2_per_dof:.3g}, and the σ carry these errors"
    )


def _largest_sigmas(covariance: Array) -> tuple[float, float]:
    """Largest σ of the translation [mm] and the rotation [deg] in any direction."""
    return (
        float(np.sqrt(np.linalg.eigvalsh(covariance[:3, :3])[-1])),
        float(np.rad2deg(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))),
    )


def direction_in_words(covariance: Array) -> str:
    """The weakest direction of the SCP (covariance (6, 6), sensor axes) by its largest parts."""
    scale = np.array([1.0] * 3 + [300.0] * 3)  # a rotation moves what the sensor sees, some 300 mm away
    values, vectors = np.linalg.eigh(covariance * scale[:, None] * scale)
    weakest = vectors[:, -1]
    names = ("x", "y", "z")
    parts = [
        f"{'translation along' if i < 3 else 'rotation about'} {names[i % 3]} of the sensor"
        for i in np.argsort(-np.abs(weakest))
        if abs(weakest[i]) > 0.4
    ]
    return "mostly " + " with ".join(parts) + f" (σ {np.sqrt(max(values[-1], 0.0)):.2g} mm at 300 mm)"
