"""Measuring what extraction, filters and maps are worth, each question in a module of its own.

What is public are these modules; each is imported on demand.
"""

__all__ = [
    "accuracy",
    "calibration",
    "consistency",
    "intervals",
    "maps",
    "repeatability",
    "speed",
    "stations",
]
