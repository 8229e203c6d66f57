"""How the sensor moved while it took each scan: as the scan comes, and smoothed once those after it are there."""
