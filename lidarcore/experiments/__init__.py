"""Experiments of papers, run again: each is one function that returns its result, its claims and a report of it.

What is public are these modules; each is imported on demand.
"""

__all__ = [
    "claim_rules",
    "clustering_ekf",
    "clustering_ekf_report",
    "cwlf",
    "cwlf_claims",
    "cwlf_report",
    "environments",
    "wctls",
    "wctls_claims",
    "wctls_report",
]
