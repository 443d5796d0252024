"""What came of it: summary, advice, plots, page."""
