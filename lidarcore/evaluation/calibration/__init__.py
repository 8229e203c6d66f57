"""The noise of a sensor from a recording in which it stands.

What is public are these modules; each is imported on demand.
"""

__all__ = ["calibrate", "design", "noise_check", "result", "study", "tables", "variances"]
