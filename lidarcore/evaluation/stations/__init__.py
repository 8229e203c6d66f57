"""Recordings of several places: calibrated and judged place by place, and what neighbouring places agree on.

What is public are these modules; each is imported on demand.
"""

__all__ = ["agreement", "agreement_study", "limits", "recording", "study", "tables"]
