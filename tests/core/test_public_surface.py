"""What `import lidarcore` offers, what it loads, and how its objects show themselves."""

import pydoc
import subprocess
import sys

import numpy as np
import pytest

import lidarcore
from lidarcore import Scan, extract, open_recording


@pytest.mark.parametrize("name", lidarcore.__all__)
def test_every_public_name_is_there(name):
    assert getattr(lidarcore, name) is not None


def test_an_unknown_name_is_no_attribute():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = lidarcore.nonsense


def test_importing_loads_neither_http_nor_filters_nor_maps():
    code = "import sys, lidarcore; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    late = {"httpx", "lidarcore.mapping", "lidarcore.localization", "lidarcore.evaluation"}
    assert not late & set(done.stdout.split())


def test_maps_and_filters_load_neither_clustering_nor_statistics():
    """Every command and the server would wait for what hardly any of them needs."""
    code = "import sys, lidarcore.mapping.mapper, lidarcore.localization; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"sklearn", "scipy.stats"} & set(done.stdout.split())


def test_what_was_found_and_read_shows_what_it_is(tmp_path):
    bearings = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ranges = 2 / np.maximum(np.abs(np.cos(bearings)), np.abs(np.sin(bearings)))
    features = extract(Scan(ranges, bearings))
    assert repr(features.corners) == "<4 corners, consistent covariances>"
    assert repr(features.segments) == "<4 segments, consistent covariances>"
    assert repr(features.segments.lines) == "<4 lines>"
    path = tmp_path / "room.npz"
    np.savez(path, ranges=ranges, bearings=bearings)
    assert repr(open_recording(path)) == f"<NumPy .npz {path}>"


@pytest.mark.parametrize("settings", [lidarcore.SensorNoise, lidarcore.ExtractionSettings])
def test_help_on_settings_begins_with_names_and_defaults(settings):
    shown = pydoc.render_doc(settings, renderer=pydoc.plaintext)
    signature = shown.split("\n\n")[1]
    assert "sigma_range=0.02" in signature or "fitter='ml'" in signature
    assert "Annotated" not in signature.splitlines()[1]
