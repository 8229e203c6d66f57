"""Each method against its definition, written out independently of scikit-learn."""

import numpy as np
import pytest
from post_scenes import NOISE, same_partition, scenes
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from lidarcore import Scan
from lidarcore.clusters import ClusterSettings, cluster
from lidarcore.clusters.kmeans import HALVED_WALL
from lidarcore.simulation import SimulatedSensor, furnished_room, random_pose

ROOM = furnished_room()


def room_scans(count, seed):
    rng = np.random.default_rng(seed)
    sensor = SimulatedSensor(ROOM, NOISE, beams=400)
    return [sensor.scan(random_pose(ROOM, rng), rng)[0] for _ in range(count)]


def connected(linked):
    return connected_components(coo_array(linked))[1]


def scan_of(xy):
    """A scan of points given in the sensor frame, and the order in which it has them."""
    bearings = np.arctan2(xy[:, 1], xy[:, 0])
    order = np.argsort(bearings)
    return Scan(np.hypot(*xy.T)[order], bearings[order]), order


def silhouette(points, labels):
    """Mean of (b - a) / max(a, b): a to the others of its own cluster, b to the nearest other one (Rousseeuw 1987)."""
    distances, values = cdist(points, points), []
    for i, own in enumerate(labels):
        if (labels == own).sum() == 1:
            values.append(0.0)
            continue
        a = distances[i, labels == own].sum() / ((labels == own).sum() - 1)
        b = min(distances[i, labels == other].mean() for other in np.unique(labels) if other != own)
        values.append((b - a) / max(a, b))
    return np.mean(values)


@pytest.mark.parametrize("distance", [0.1, 0.3, 1.0])
def test_heuristic_objects_are_runs_of_the_ring_without_a_gap(distance):
    for scan in room_scans(5, seed=1):
        points = scan.xy[scan.valid]
        n = len(points)
        near = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1) <= distance
        linked = np.zeros((n, n))
        linked[np.arange(n), (np.arange(n) + 1) % n] = near
        found = cluster(scan, ClusterSettings(distance=distance, min_points=2)).labels[scan.valid]
        expected = connected(linked)
        expected[np.bincount(expected)[expected] < 2] = -1
        assert same_partition(found, expected)


@pytest.mark.parametrize(("eps", "min_points"), [(0.1, 3), (0.2, 6), (0.5, 10)])
def test_dbscan_connects_dense_points_and_what_is_near_them(eps, min_points):
    for scan in room_scans(5, seed=2):
        points = scan.xy[scan.valid]
        near = cdist(points, points) <= eps  # [EKF 13]
        dense = near.sum(axis=1) >= min_points
        found = cluster(scan, ClusterSettings(method="dbscan", eps=eps, min_points=min_points)).labels[
            scan.valid
        ]
        assert same_partition(found[dense], connected(near[np.ix_(dense, dense)]))
        for i in np.flatnonzero(~dense):
            within = set(found[dense & near[i]])
            assert found[i] in within if within else found[i] == -1


def test_kmeans_gives_each_point_to_the_nearest_mean():
    for scan in room_scans(5, seed=3):
        found = cluster(scan, ClusterSettings(method="kmeans", k=9, min_points=2))
        assert len(found) == 9
        assert (found.labels[scan.valid] == cdist(scan.xy[scan.valid], found.means).argmin(axis=1)).all()


def test_kmeans_chooses_the_number_with_the_largest_silhouette():
    for scan, _ in scenes(4, 4, seed=4):
        points = scan.xy[scan.valid]
        chosen = cluster(scan, ClusterSettings(method="kmeans", min_points=2))
        scores = {
            k: silhouette(
                points, cluster(scan, ClusterSettings(method="kmeans", k=k, min_points=2)).labels[scan.valid]
            )
            for k in range(2, 7)
        }
        assert len(chosen) == max(scores, key=scores.get) == 4
        assert scores[4] > HALVED_WALL


def test_the_halves_of_a_straight_wall_have_the_silhouette_they_are_said_to_have():
    along = (np.arange(2000) + 0.5) / 2000
    wall = np.stack([along, np.ones(2000)], axis=1)
    assert silhouette(wall, (along > 0.5).astype(int)) == pytest.approx(HALVED_WALL, abs=1e-3)


@pytest.mark.parametrize("length", [0.3, 1.0, 3.0])
def test_kmeans_leaves_a_straight_wall_whole(length):
    wall = np.stack([np.full(60, 2.0), np.linspace(-length / 2, length / 2, 60)], axis=1)
    assert cluster(scan_of(wall)[0], ClusterSettings(method="kmeans")).counts.tolist() == [60]


@pytest.mark.parametrize("length", [3.0, 4.0, 6.0])
def test_a_gaussian_mixture_tells_long_walls_apart_that_kmeans_cuts_across(length):
    wall = np.stack([np.full(120, 3.0), np.linspace(-length / 2, length / 2, 120)], axis=1)
    across = np.stack([np.linspace(1.0, 2.9, 60), np.full(60, length / 2 + 0.7)], axis=1)
    scan, order = scan_of(np.concatenate([wall, across]) + np.random.default_rng(5).normal(0, 0.01, (180, 2)))
    truth = np.repeat([0, 1], [120, 60])[order]
    assert same_partition(cluster(scan, ClusterSettings(method="gmm")).labels, truth)
    assert not same_partition(cluster(scan, ClusterSettings(method="kmeans", k=2)).labels, truth)


def test_a_gaussian_mixture_is_a_fixed_point_of_expectation_maximisation():
    for scan, _ in scenes(4, 5, seed=6):
        points = scan.xy[scan.valid]
        found = cluster(scan, ClusterSettings(method="gmm", noise=NOISE, min_points=2))
        floor = (2 * NOISE.sigma_range) ** 2 * np.eye(2)
        density = []
        for count, mean, scatter in zip(found.counts, found.means, found.scatters, strict=True):
            C, d = scatter + floor, points - mean
            exponent = -0.5 * np.einsum("ni,ij,nj->n", d, np.linalg.inv(C), d)
            density.append(count * np.exp(exponent) / np.sqrt(np.linalg.det(C)))
        share = np.array(density) / np.sum(density, axis=0)  # [EKF 8]
        n = share.sum(axis=1)
        means = share @ points / n[:, None]  # [EKF 11]
        assert means == pytest.approx(found.means, abs=1e-3)
        assert n == pytest.approx(found.counts, abs=1e-2)  # [EKF 10]
        assert (share.argmax(axis=0) == found.labels[scan.valid]).all()


@pytest.mark.parametrize("method", ["kmeans", "gmm"])
@pytest.mark.parametrize("k", [1, 3, 6])
def test_as_many_clusters_as_asked_for(method, k):
    for scan, _ in scenes(3, 6, seed=7):
        assert len(cluster(scan, ClusterSettings(method=method, k=k, min_points=2))) == k


@pytest.mark.parametrize("method", ["kmeans", "gmm"])
def test_no_more_clusters_than_the_most_to_choose_from(method):
    for scan, _ in scenes(3, 8, seed=8):
        assert len(cluster(scan, ClusterSettings(method=method, k_max=5, min_points=2))) <= 5


@pytest.mark.parametrize("method", ["kmeans", "gmm"])
def test_no_more_clusters_than_there_are_points(method):
    scan = Scan(np.full(8, 3.0), np.repeat([-0.5, 0.5], 4))
    found = cluster(scan, ClusterSettings(method=method, k=100, min_points=2))
    assert found.labels.tolist() == [1, 1, 1, 1, 0, 0, 0, 0]


@pytest.mark.parametrize("method", ["kmeans", "gmm"])
@pytest.mark.parametrize(("left", "right"), [(4, 4), (2, 2)])
def test_two_places_are_two_clusters_however_few_points(method, left, right):
    scan = Scan(np.full(left + right, 3.0), np.repeat([-0.5, 0.5], [left, right]))
    assert cluster(scan, ClusterSettings(method=method, min_points=2)).counts.tolist() == [right, left]


def test_kmeans_chooses_two_clusters_of_three_points():
    scan = Scan([3.0, 3.0, 3.0], np.array([-0.5, 0.5, 0.51]))
    assert cluster(scan, ClusterSettings(method="kmeans", min_points=2)).labels.tolist() == [-1, 0, 0]
