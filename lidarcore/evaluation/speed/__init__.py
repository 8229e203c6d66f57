"""What extraction, filter, front end and landmark maps cost, beside yardsticks.

What is public are these modules; each is imported on demand.
"""

__all__ = ["extraction", "filter", "landmarks", "mapping", "repeatability"]
