"""A map while it is driven: threads behind the front end that close loops, draw grid and walls, or look for a pose."""
