"""The sections of a stripe: each fitted, alone, with its neighbours or with another stripe's, and its σ made true."""

from extraction.stripe.sections.faint import NEIGHBOURS, fit_faint
from extraction.stripe.sections.fit import SECTION, SectionPlaces, fit_sections
from extraction.stripe.sections.ground import Ground, ground_slopes, learn_ground, level_ground
from extraction.stripe.sections.held_to_course import off_course
from extraction.stripe.sections.model import FitLimits, Records
from extraction.stripe.sections.noise import estimate_noise
from extraction.stripe.sections.normal import localise_along_normal
from extraction.stripe.sections.pair import fit_pairs
from extraction.stripe.sections.sigma import STEP_PX, SigmaPlaces, true_sigma
from extraction.stripe.sections.tails import SectionPoints, tails_kept, walk_tails

__all__ = [
    "NEIGHBOURS",
    "SECTION",
    "STEP_PX",
    "FitLimits",
    "Ground",
    "Records",
    "SectionPlaces",
    "SectionPoints",
    "SigmaPlaces",
    "estimate_noise",
    "fit_faint",
    "fit_pairs",
    "fit_sections",
    "ground_slopes",
    "learn_ground",
    "level_ground",
    "localise_along_normal",
    "off_course",
    "tails_kept",
    "true_sigma",
    "walk_tails",
]
