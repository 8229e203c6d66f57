"""Loops: the back end, which recognizes earlier places, and which of its ties are believed."""
