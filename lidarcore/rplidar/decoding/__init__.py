"""From the bytes of a scan to revolutions."""
