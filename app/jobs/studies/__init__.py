"""Studies beside the frames: which there are, their runs, and the reports that stay."""
