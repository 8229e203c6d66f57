"""A map's poses against relations between scans: of a drive along a circle, whose relative poses are known."""

import gzip

import numpy as np
import pytest

from lidarcore.errors import EvaluationError
from lidarcore.evaluation.maps.accuracy import (
    Relations,
    close_pairs,
    read_relations,
    relation_errors,
    relative_errors,
)

STAMPS = 0.5 * np.arange(80)
TURN = 0.2  # rad/s on a circle of 5 m


def on_circle(stamps):
    """Poses (N, 3) of a robot that looks along its way."""
    phi = TURN * np.asarray(stamps)
    return np.stack([5 * np.cos(phi), 5 * np.sin(phi), phi + np.pi / 2], -1)


def between(first, second):
    """The relative pose on the circle: a chord, half turned."""
    turned = TURN * (second - first)
    chord = 10 * np.sin(turned / 2)
    return [chord * np.cos(turned / 2), chord * np.sin(turned / 2), turned]


def moved(poses, x, y, heading):
    """The same drive in another frame."""
    z = np.exp(1j * heading) * (poses[:, 0] + 1j * poses[:, 1])
    return np.stack([z.real + x, z.imag + y, poses[:, 2] + heading], -1)


TIMES = np.array([[0.0, 3.0], [2.5, 10.0], [31.5, 4.0]])


@pytest.mark.parametrize("name", ["drive.relations", "drive.relations.gz"])
def test_of_a_true_map_in_any_frame_nothing_is_off_and_of_another_what_it_is_off_by(tmp_path, name):
    rows = []
    for first, second in TIMES:
        x, y, turned = between(first, second)
        rows.append(
            f"{first} {second} {x:.9f} {y:.9f} 0.3 0.1 0.2 {turned:.9f}\n"
        )  # z, roll, pitch: as a sensor tilts
    opened = gzip.open if name.endswith("gz") else open
    with opened(tmp_path / name, "wt") as file:
        file.writelines(rows)
    relations = read_relations(tmp_path / name)
    poses = moved(on_circle(STAMPS), 3.0, -7.0, 1.2)
    np.testing.assert_allclose(relation_errors(relations, STAMPS, poses), np.zeros((3, 3)), atol=1e-8)
    poses[np.searchsorted(STAMPS, 10.0)] += [0.3, 0.4, 0.02]
    errors = relation_errors(relations, STAMPS, poses)
    np.testing.assert_allclose(errors[1], [0.5, 0.02, 0.0], atol=1e-8)
    np.testing.assert_allclose(errors[[0, 2]], np.zeros((2, 3)), atol=1e-8)


def test_what_no_pose_is_near_to_is_left_out():
    kept = (STAMPS < 8) | (STAMPS > 12)
    relations = Relations(TIMES, np.array([between(*times) for times in TIMES]))
    errors = relation_errors(relations, STAMPS[kept], on_circle(STAMPS[kept]))
    assert len(errors) == 2


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("1 2 3\n", "eight numbers"),
        ("", "eight numbers"),
        ("a b\n", "not a file"),
        ("1 b\n", r"column 2\.$"),
        (8 * "nan ", "eight numbers"),
    ],
)
def test_what_is_no_file_of_relations_is_refused(tmp_path, text, word):
    (tmp_path / "wrong").write_text(text)
    with pytest.raises(EvaluationError, match=word):
        read_relations(tmp_path / "wrong")


def test_places_seen_again_are_paired_and_judged_by_where_they_are_from_each_other():
    """The circle takes 31.4 s: later poses come by again. Half a step is 0.5 m."""
    reference = on_circle(STAMPS)
    pairs = close_pairs(reference)
    wanted = {
        (i, j)
        for i in range(80)
        for j in range(i + 31, 80)
        if abs(10 * np.sin(TURN * (STAMPS[j] - STAMPS[i]) / 2)) < 3
    }
    assert {tuple(pair) for pair in pairs.tolist()} == wanted
    assert len(wanted) > 100
    np.testing.assert_allclose(
        relative_errors(moved(reference, 1.0, 2.0, -0.7), reference, pairs),
        np.zeros((len(pairs), 3)),
        atol=1e-8,
    )
    drifted = reference + np.linspace(0, 1, 80)[:, None] * [0.4, 0.0, 0.0]
    off = relative_errors(drifted, reference, pairs)
    np.testing.assert_allclose(np.hypot(off[:, 0], off[:, 1]), 0.4 * np.diff(pairs)[:, 0] / 79, atol=1e-8)
