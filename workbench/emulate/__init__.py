"""Cells recorded in emulation: what is true of them, what is rendered, and the truth beside it."""
