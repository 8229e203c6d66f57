"""The command line: one library call for each command."""
