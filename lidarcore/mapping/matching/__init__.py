"""Where a scan lies on the map around it: surfaces of scans, searched and registered."""
