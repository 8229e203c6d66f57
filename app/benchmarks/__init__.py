"""What `lidarcore bench` measures of the running server."""
