"""Are the ellipses true in simulated rooms: trials, coverage, ANEES, RMS error against the Cramér-Rao bound.

What is public are these modules; each is imported on demand.
"""

__all__ = ["cells", "figures", "report", "study", "tables", "trials", "verdicts"]
