"""Measured points against their truth."""
