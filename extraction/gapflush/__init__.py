"""Gap and flush of two panels: straight faces and bent edges fitted to a profile, by makers' definitions."""

from extraction.gapflush.definitions import Lengths
from extraction.gapflush.edge import PanelEdge
from extraction.gapflush.measure import GapFlush, measure_gap_flush

__all__ = ["GapFlush", "Lengths", "PanelEdge", "measure_gap_flush"]
