"""Synthetic cells and views with known truth, without images: for tests, benchmarks and the paper's ensemble."""
