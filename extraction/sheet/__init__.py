"""Pixels → points of the laser sheet: the lens inverted, the ray met with the plane, and both as a look-up table."""

from extraction.sheet.lens import undistort
from extraction.sheet.rectify import image_to_sheet, propagate
from extraction.sheet.table import SheetTable, sheet_table

__all__ = ["SheetTable", "image_to_sheet", "propagate", "sheet_table", "undistort"]
