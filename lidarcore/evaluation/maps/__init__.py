"""Maps against their truth: poses, walls, relocation.

What is public are these modules; each is imported on demand.
"""

__all__ = ["accuracy", "relocation", "study", "walls"]
