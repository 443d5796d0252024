"""Columns of a fitted section, as the kernels write them: one row of 12 per candidate."""

CENTRE, AMPLITUDE, WIDTH, BACKGROUND, VARIANCE, SNR, CHI2, DOF, CLIPPED, CONVERGED, LOW, HIGH = range(12)
