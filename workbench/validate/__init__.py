"""Extraction against truth: detection, false alarms, labels, bias, scatter, honest σ, and the statistical bound."""
