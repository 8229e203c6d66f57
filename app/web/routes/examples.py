"""Examples for the documentation; the tests check that each is what its schema says."""

from typing import Any

Json = dict[str, Any]
MEDIA_TYPES = {
    "json": "application/json",
    "csv": "text/csv",
    "geojson": "application/geo+json",
    "png": "image/png",
    "zip": "application/zip",
}

MEASURED = {
    "x": 3.1042,
    "y": 1.9873,
    "sigma_x": 0.0041,
    "sigma_y": 0.0037,
    "area": 4.3e-05,
    "covariance": [[1.68e-05, -3.1e-06], [-3.1e-06, 1.37e-05]],
    "angle": 1.5694,
}
SEGMENT = {
    "id": 0,
    "alpha": 0.0021,
    "r": 3.1007,
    "start": [3.1049, -1.9012],
    "end": [3.0965, 1.9866],
    "length": 3.8878,
    "n_points": 141,
    "rms": 0.0192,
    "covariance": [[2.1e-06, -1.0e-07], [-1.0e-07, 2.9e-06]],
}
CORNER = {"id": 12, "segments": [0, 1], "selected": True, "by_method": {"ml": MEASURED}}
DEVICE_FOUND = {
    "path": "/dev/ttyUSB0",
    "description": "CP2102 USB to UART Bridge Controller",
    "vid_pid": "10c4:ea60",
    "looks_like": True,
    "name": "RPLIDAR S1",
    "serial": "A1B2C3D4E5F60718293A4B5C6D7E8F90",
    "error": None,
    "in_use": False,
}
RECORDER = {
    "state": "recording",
    "name": "2026-11-21_10-00-00.mcap",
    "raw": False,
    "size": 812331,
    "duration": 30.1,
    "scans": 301,
    "rate": 27000.0,
    "dropped": 0,
    "error": None,
}
POSITION = {"kind": "recording", "index": 41, "count": 278, "time": 4.1}
CLUSTER = {
    "x": 2.104,
    "y": 0.371,
    "covariance": [[2.1e-06, 3.0e-07], [3.0e-07, 4.4e-06]],
    "scatter": [[0.0031, 0.0002], [0.0002, 0.0108]],
    "count": 41,
}
LOCALIZATION = {
    "mode": "slam",
    "state": "tracking",
    "message": None,
    "session": 3,
    "pose": {"x": 1.204, "y": -0.311, "heading": 0.52},
    "covariance": [[0.0004, 0.0, 0.0], [0.0, 0.0004, 0.0], [0.0, 0.0, 0.0001]],
    "velocity": [0.31, 0.02],
    "dead_reckoned": {"x": 1.251, "y": -0.302, "heading": 0.54},
    "truth": [1.203, -0.309, 0.5192],
    "landmarks": 24,
    "confirmed": 19,
    "tentative": [[1.2031, -0.8714]],
    "observed": 13,
    "ambiguous": 0,
    "unmatched": 2,
    "innovations": [{"landmark": 7, "dx": 0.0041, "dy": -0.0017, "squared_distance": 1.4}],
    "nis": 1.4,
    "dof": 2,
    "nis_band": [0.051, 7.378],
}
FRAME: Json = {
    "sequence": 1042,
    "stamp": 1321462573.81,
    "source": POSITION,
    "n_beams": 920,
    "n_valid": 903,
    "completeness": 0.957,
    "gaps": [[1.204, 1.475]],
    "noise_seen": 0.0187,
    "noise_remark": None,
    "fitter": "ml",
    "covariance": "consistent",
    "methods": ["ml"],
    "timings": {
        "extract_us": 131.0,
        "cluster_us": 310.0,
        "locate_us": 640.0,
        "draw_us": 690.0,
        "age_ms": 1.2,
    },
    "extent": [[-2.61, 3.52], [-1.83, 2.24]],
    "colour_scale": None,
    "rate_hz": 10.0,
    "dropped": 0,
    "segments": {"ml": [SEGMENT]},
    "corners": [CORNER],
    "rejections": [
        {
            "kind": "segment",
            "reason": "too few points",
            "message": "4 points in a row; min_points is 6.",
            "xy": [1.21, -0.4],
            "first_beam": 311,
            "last_beam": 314,
        }
    ],
    "summary": {"ml": {"corners": 1, "median_area": 4.3e-05}},
    "clusters": [CLUSTER],
    "localization": LOCALIZATION,
}
SOURCE = {
    "kind": "recording",
    "live": False,
    "device": None,
    "recording": "demo.bag",
    "topic": "/scan",
    "topics": ["/scan"],
    "format": "ROS 1 bag",
    "notes": [],
    "state": "playing",
    "error": "demo.bag ends in the middle of a record: what comes before it is played.",
    "index": 41,
    "count": 278,
    "complete": True,
    "time": 4.1,
    "duration": 27.7,
    "speed": 1.0,
    "loop": True,
}
RECORDING = {
    "name": "demo.bag",
    "size": 10485760,
    "modified": "2025-04-01T10:00:00+00:00",
    "builtin": False,
}
LANDMARK = {
    "id": 41,
    "x": 3.502,
    "y": -1.798,
    "var_x": 2.1e-05,
    "cov_xy": -3.4e-06,
    "var_y": 1.8e-05,
    "kind": "corner",
    "method": "ml",
    "count": 212,
    "first_seen": 1795255000.1,
    "last_seen": 1795255031.4,
}
SESSION = {
    "id": 3,
    "source": "emulated RPLIDAR S1",
    "mode": "slam",
    "started": 1795255000.0,
    "ended": None,
    "landmarks": 27,
    "walls": 0,
    "grid": False,
}
SUGGESTION = {"mask": [{"first": 2.93, "last": -3.07, "reach": 0.31}]}
SETTINGS_PATCH = {"extraction": {"fitter": "wctls", "min_points": 8}, "view": {"compare": True}}


def ok(example: object, description: str, status: int = 200, **others: object) -> dict[int | str, Json]:
    """The OpenAPI entry of a good answer with its example; `others` are in other formats: csv=..."""
    content = {MEDIA_TYPES[name]: {"example": sample} for name, sample in {"json": example, **others}.items()}
    return {status: {"description": description, "content": content}}
