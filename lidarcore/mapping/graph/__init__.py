"""The pose graph: poses tied by odometry and loops, their adjustment, and what is known of them."""
