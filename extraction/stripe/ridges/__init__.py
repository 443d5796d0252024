"""Ridges of an image: what is brighter than both its flanks, at every scale, followed from section to section."""

from extraction.stripe.ridges.chain import Chain, each_once, together
from extraction.stripe.ridges.pyramid import Pyramid, RidgeSearch, search, search_faint
from extraction.stripe.ridges.ridge import FLANK

__all__ = ["FLANK", "Chain", "Pyramid", "RidgeSearch", "each_once", "search", "search_faint", "together"]
