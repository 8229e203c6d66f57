"""Measuring what extraction is worth, against simulated truth."""
