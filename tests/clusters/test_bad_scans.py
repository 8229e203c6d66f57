"""Settings out of range and impossible scans are refused, with a word on what to do."""

import dataclasses
import math

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from lidarcore import Scan, ScanError
from lidarcore.clusters import CLUSTERERS, ClusterSettings, cluster


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("method", "meanshift"),
        *[
            (name, value)
            for name in ("distance", "eps")
            for value in (0, -1, math.nan, math.inf, None, "far")
        ],
        *[("min_points", value) for value in (0, 1, -3, 2.5, None, 10**6)],
        *[("k", value) for value in (0, -1, 1.5, 10**6, "many")],
        *[("k_max", value) for value in (0, 1000, None)],
        *[("max_range", value) for value in (0, -8, math.nan, math.inf)],
        ("noise", None),
        ("epsilon", 0.3),
    ],
)
def test_settings_out_of_range_are_refused_by_name(field, value):
    with pytest.raises(ValidationError, match=field):
        ClusterSettings(**{field: value})


def test_settings_cannot_be_changed_halfway():
    with pytest.raises(dataclasses.FrozenInstanceError):
        ClusterSettings().method = "gmm"


def test_every_setting_says_what_it_means_and_in_which_unit():
    schema = TypeAdapter(ClusterSettings).json_schema()["properties"]
    assert schema["method"]["enum"] == list(CLUSTERERS)
    assert {name for name, field in schema.items() if field.get("unit") == "m"} == {
        "distance",
        "eps",
        "max_range",
    }
    assert all("description" in field for name, field in schema.items() if name != "noise")


def test_every_parameter_of_a_method_is_a_setting():
    names = {field.name for field in dataclasses.fields(ClusterSettings)}
    assert names >= {name for clusterer in CLUSTERERS.values() for name in clusterer.parameters}


@pytest.mark.parametrize("method", CLUSTERERS)
def test_ranges_beyond_any_lidar_are_refused_or_left_out(method):
    scan = Scan([1.0, 1.0, 1.0, 1e200], np.array([0.0, 0.01, 0.02, 0.03]))
    with pytest.raises(ScanError, match="max_range"):
        cluster(scan, ClusterSettings(method=method))
    assert cluster(scan, ClusterSettings(method=method, max_range=50)).labels.tolist() == [0, 0, 0, -1]
