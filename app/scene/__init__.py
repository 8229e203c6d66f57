"""From a frame to the picture that viser shows."""
