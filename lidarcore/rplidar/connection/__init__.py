"""One sensor at one port: opening, asking, following, and finding it again."""
