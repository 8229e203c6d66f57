"""Maps against their truth: poses and what they claim, walls, relocation.

What is public are these modules; each is imported on demand.
"""

__all__ = ["accuracy", "endurance", "honesty", "relocation", "study", "walls"]
