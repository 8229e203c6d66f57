"""The dashboard and the command line around lidarcore: one server, one port, one settings object."""
