"""From a scan to a frame: settings, extraction, localization, one immutable frame a scan."""
