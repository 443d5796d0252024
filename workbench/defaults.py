"""Presets that stand where the user names none; without imports, so that help comes at once."""

ROBOT = "abb_irb6640_180_255"  # a six-axis arm of 2.55 m reach, whose table ships with the package
SENSOR = "nominal"
JIG = "paper"
DRAWN_SENSORS = 20  # that `validate` draws from a sensor's uncertainty: their σ is then known to a sixth
