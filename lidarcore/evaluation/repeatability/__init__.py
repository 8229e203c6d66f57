"""What scatters while the sensor stands still, against what each method claims.

What is public are these modules; each is imported on demand.
"""

__all__ = ["scatter", "statistics", "summary", "tables"]
