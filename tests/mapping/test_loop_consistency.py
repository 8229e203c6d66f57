"""Which loops may support each other: only those whose way around tells whether they are true."""

import numpy as np

from lidarcore.geometry import chi_square_gate, compose, relative
from lidarcore.mapping import Loop, PoseGraph
from lidarcore.mapping.loops.consistency import Consistency, support

GATE = float(chi_square_gate(0.999, 3))
TIGHT = np.diag([0.02, 0.02, 0.005]) ** 2
# Out for 20 nodes and back beside the same way: 40 steps, which leave 1.3 m open between the passes.
WAY = np.array([[k, 0.0, 0.0] for k in range(20)] + [[19.0 - k, 0.5, np.pi] for k in range(20)])


def graph(bend=0.0):
    """The way there and back, as odometry has it: turned by `bend` rad at the far end."""
    built, z = PoseGraph(WAY[0]), relative(WAY[:-1], WAY[1:])
    z[19, 2] += bend
    for k, step in enumerate(z):
        node = built.add(compose(built.poses[k], step))
        built.connect(k, node, step, np.diag([0.05, 0.05, 0.02 if k != 19 else 0.15]) ** 2)
    return built


def loop(i, j, off=(0.0, 0.0, 0.0), quality=0.8):
    return Loop(i, j, relative(WAY[i], WAY[j]) + np.array(off), TIGHT, quality)


def test_true_loops_of_two_passes_agree_however_wrong_the_graph_is():
    bent = graph(0.2)
    assert Consistency(bent, GATE).agree(loop(5, 34), loop(3, 36))
    assert Consistency(bent, GATE).agree(loop(3, 36), loop(5, 34))


def test_a_wrong_loop_does_not_agree_with_true_ones():
    """One room along the corridor too far, as a match may have it that mistook one door for another."""
    assert not Consistency(graph(), GATE).agree(loop(5, 34), loop(3, 36, (3.0, 0, 0)))


def test_a_loop_within_one_pass_supports_no_tie_to_another():
    """Both fit within what the graph leaves open, and so would any wrong one: that is no agreement."""
    vague = graph()
    within = loop(34, 37)
    for wrong in (loop(3, 36), loop(3, 36, (1.0, 0.3, 0.0))):
        assert not Consistency(vague, GATE).agree(within, wrong)
    assert Consistency(vague, GATE).agreeing(loop(3, 36), [within, loop(5, 34)])[1:] != [within]


def test_support_counts_the_best_loop_of_each_node():
    assert support([loop(5, 34, quality=0.6), loop(6, 34, quality=0.9), loop(3, 36, quality=0.5)]) == 1.4
