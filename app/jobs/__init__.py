"""Work beside the frames: recorder, maps, calibration, studies, profiles."""
