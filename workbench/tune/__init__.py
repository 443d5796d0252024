"""Automatic tuning: a search over extraction's parameters, judged on images that it has not seen."""
