import io
import json
import sqlite3
from dataclasses import replace

import numpy as np
import pytest
from landmark_maps import RandomLandmarks, corner
from PIL import Image
from pyarrow import csv as arrow
from ruamel.yaml import YAML

from lidarcore.errors import MapFileError
from lidarcore.landmarks import (
    FORMATS,
    export_map,
    export_picture,
    import_map,
    read_landmarks,
    write_landmarks,
)

HEAD = {"format": "lidarcore landmarks", "version": 1, "unit": "m"}
GOOD = {"x": 1, "y": 2, "var_x": 0.01, "cov_xy": 0, "var_y": 0.01, "kind": "corner"}
CSV_HEAD = "x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,kind"


@pytest.fixture
def filled(landmark_map):
    ids = landmark_map.put(RandomLandmarks(300).landmarks())
    landmark_map.put([corner(0.1 + 0.2, -1e-17, kind='Eck "Süd", 2; 角', method="")])
    landmark_map.remove(ids[4:6])
    return landmark_map


@pytest.mark.parametrize("name", FORMATS)
def test_what_was_exported_is_imported_to_the_last_bit(atlas, filled, tmp_path, name):
    path = tmp_path / f"map.{name}"
    export_map(filled, path)
    other = atlas.begin(path.name, 5.0, "import")
    other.put([corner(-7, -7)])
    ids = import_map(other, path)
    assert len(set(ids)) == len(filled) == 299
    assert ids == [m.id for m in other][1:]
    assert [replace(m, id=None) for m in other] == [replace(m, id=None) for m in (corner(-7, -7), *filled)]
    assert min(ids) > max(m.id for m in filled)


def test_other_programs_read_the_tables(filled, tmp_path):
    for name in FORMATS:
        export_map(filled, tmp_path / f"map.{name}")
    truth = list(filled)
    table = arrow.read_csv(tmp_path / "map.csv").to_pydict()
    assert table["x_m"] == [m.x for m in truth]
    assert table["cov_xy_m2"] == [m.cov_xy for m in truth]
    assert table["kind"] == [m.kind for m in truth]
    points = json.loads((tmp_path / "map.geojson").read_text("utf-8"))
    assert points["type"] == "FeatureCollection"
    assert [f["geometry"] for f in points["features"]] == [
        {"type": "Point", "coordinates": [m.x, m.y]} for m in truth
    ]
    document = json.loads((tmp_path / "map.json").read_text("utf-8"))
    assert [row["var_y"] for row in document["landmarks"]] == [m.var_y for m in truth]


POINT = {"type": "Point", "coordinates": [1, 2]}


def as_json(**changes):
    return json.dumps(HEAD | {"landmarks": [GOOD, GOOD | changes]})


def as_geojson(geometry, **changes):
    """Two features; the second of this geometry, with these properties beside those that are needed."""
    properties = {name: value for name, value in GOOD.items() if name not in "xy"}
    features = [
        {"geometry": POINT, "properties": properties},
        {"geometry": geometry, "properties": properties | changes},
    ]
    return json.dumps(HEAD | {"features": features})


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("json", "", "cannot be read"),
        ("json", "[" * 100_000, "cannot be read"),
        ("json", "[]", "no object with the key landmarks"),
        ("json", json.dumps({"landmarks": [GOOD]}), "unit should be 'm' and is missing"),
        ("json", json.dumps(HEAD | {"unit": "mm", "landmarks": [GOOD]}), "unit should be 'm' and is 'mm'"),
        ("json", json.dumps(HEAD | {"version": 2, "landmarks": [GOOD]}), "version should be 1 and is 2"),
        ("json", json.dumps(HEAD | {"landmarks": {"a": 1}}), "not a list of objects"),
        ("json", as_json(x=float("nan")), "Landmark 2: .*finite"),
        ("json", as_json(x=None), "Landmark 2: .*number"),
        ("json", as_json(var_x=-1), "Landmark 2: .*positive definite"),
        ("json", as_json(colour="red"), "Landmark 2 .*colour"),
        ("json", as_json(first_seen=2, last_seen=1), "Landmark 2: .*after last_seen"),
        ("json", json.dumps(HEAD | {"landmarks": [{"x": 1}]}), "Landmark 1 .*cov_xy"),
        (
            "geojson",
            json.dumps({"type": "FeatureCollection", "features": []}),
            "format should be .* and is missing",
        ),
        ("geojson", json.dumps(HEAD | {"features": [{"geometry": None}]}), "no Point"),
        (
            "geojson",
            json.dumps(HEAD | {"features": [{"geometry": {"coordinates": [1, 2, 3]}, "properties": {}}]}),
            "Landmark 1 is no Point",
        ),
        ("geojson", as_geojson({"type": "Polygon", "coordinates": [1, 2]}), "Landmark 2 is no Point"),
        ("geojson", as_geojson({"type": "Point", "coordinates": [1]}), "Landmark 2 is no Point"),
        ("geojson", as_geojson({"type": "Point", "coordinates": "12"}), "Landmark 2 is no Point"),
        ("geojson", as_geojson(POINT, x=7), "Landmark 2 has x among its properties"),
        ("json", as_json(last_seen=1e300), "Landmark 2: .*give seconds"),
        ("csv", "", "This CSV of landmarks is empty: export"),
        ("csv", CSV_HEAD.replace("x_m,", "x_mm,", 1) + "\n1,2,1,0,1,corner\n", "x_mm"),
        ("csv", f"{CSV_HEAD}\n1,2,1,0,1,corner\n1,2,1,0,corner\n", "Line 3 has 5 values, the header 6"),
        ("csv", f"{CSV_HEAD}\n1,2,1,0,1,corner,7\n", "Line 2 has 7 values, the header 6"),
        ("csv", f"{CSV_HEAD}\n1,2,1,0,1,corner\n1,nan,1,0,1,corner\n", "Landmark 2: .*finite"),
        ("csv", f"{CSV_HEAD}\n1,2,1,0,1,corner\n1,2,1,,1,corner\n", "Landmark 2 .*cov_xy"),
        ("csv", f"{CSV_HEAD}\n1,two,1,0,1,corner\n", "two"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused_and_changes_nothing(filled, tmp_path, name, text, message):
    path, before = tmp_path / f"bad.{name}", list(filled)
    path.write_text(text, "utf-8")
    with pytest.raises(MapFileError, match=message):
        import_map(filled, path)
    assert list(filled) == before


def test_points_in_space_are_taken_by_x_and_y(landmark_map, tmp_path):
    text = as_geojson({"type": "Point", "coordinates": [3, 4, 5]})
    (tmp_path / "map.geojson").write_text(text, "utf-8")
    import_map(landmark_map, tmp_path / "map.geojson")
    assert [(m.x, m.y) for m in landmark_map] == [(1, 2), (3, 4)]


def test_blank_lines_of_a_table_are_no_landmarks(landmark_map, tmp_path):
    (tmp_path / "map.csv").write_text(f"{CSV_HEAD}\n1,2,1,0,1,corner\n\n3,4,1,0,1,post\n\n", "utf-8")
    import_map(landmark_map, tmp_path / "map.csv")
    assert [(m.x, m.y, m.kind) for m in landmark_map] == [(1, 2, "corner"), (3, 4, "post")]


def test_files_that_cannot_be_are_refused(filled, tmp_path):
    (tmp_path / "latin.csv").write_bytes(b"\xff\xfe\xfa")
    for refused in (
        lambda: import_map(filled, tmp_path / "latin.csv"),
        lambda: import_map(filled, tmp_path / "missing.json"),
        lambda: import_map(filled, tmp_path / "map.xml"),
        lambda: export_map(filled, tmp_path / "map"),
        lambda: export_map(filled, tmp_path / "no folder/map.json"),
        lambda: export_picture(filled, tmp_path / "no folder/map.png"),
        lambda: export_picture(filled, tmp_path / "map.jpg"),
        lambda: export_picture(filled, tmp_path / "map.png", 0.0),
        lambda: export_picture(filled, tmp_path / "map.png", float("nan")),
        lambda: export_picture(filled, tmp_path / "map.png", 0.001),
    ):
        with pytest.raises(MapFileError):
            refused()
    assert {path.suffix for path in tmp_path.iterdir()} <= {".db", ".db-wal", ".db-shm", ".csv"}


def test_an_export_that_fails_leaves_the_old_file(atlas, filled, tmp_path):
    path = tmp_path / "map.json"
    export_map(filled, path)
    before = path.read_bytes()
    with sqlite3.connect(atlas.path) as connection:
        connection.execute("UPDATE landmarks SET var_x = -1 WHERE id = ?", (list(filled)[200].id,))
    with pytest.raises(MapFileError, match="positive definite"):
        export_map(filled, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir() if "part" in p.name] == []


def test_tables_go_through_text_in_memory(filled):
    for name in FORMATS:
        file = io.StringIO(newline="")
        write_landmarks(filled, file, name)
        file.seek(0)
        assert list(read_landmarks(file, name)) == list(filled)


@pytest.mark.parametrize("resolution", [0.2, 0.5, 3.0])
def test_the_picture_puts_landmarks_where_ros_looks_for_them(filled, tmp_path, resolution):
    export_picture(filled, tmp_path / "map.png", resolution)
    about = YAML(typ="safe").load(tmp_path / "map.yaml")
    grey = np.asarray(Image.open(tmp_path / about["image"]), float)
    probability = (255 - grey) / 255  # as map_server reads it when negate is 0
    assert about["negate"] == 0
    assert (probability >= about["free_thresh"]).all()  # nothing is claimed to be free
    row, column = np.nonzero(probability > about["occupied_thresh"])
    x = about["origin"][0] + (column + 0.5) * about["resolution"]
    y = about["origin"][1] + (grey.shape[0] - row - 0.5) * about["resolution"]
    cells = np.stack([x, y], 1)
    truth = np.array([m.xy for m in filled])
    off = np.abs(truth[:, None] - cells[None]).max(-1)
    assert off.min(1).max() <= resolution / 2 + 1e-6
    assert off.min(0).max() <= resolution / 2 + 1e-6


def test_an_empty_map_makes_tables_but_no_picture(landmark_map, tmp_path):
    for name in FORMATS:
        export_map(landmark_map, tmp_path / f"map.{name}")
        assert import_map(landmark_map, tmp_path / f"map.{name}") == []
    with pytest.raises(MapFileError, match="nothing to draw"):
        export_picture(landmark_map, tmp_path / "map.png")
