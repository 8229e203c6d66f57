"""Where scans come from, live or recorded, and the player that hands them over."""
