"""Work beside the frames: recorder, map store, calibration, studies, profiles."""
