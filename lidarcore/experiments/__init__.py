"""Experiments of papers, run again: each is one function that returns its result, and a report of it."""
