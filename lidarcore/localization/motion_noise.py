"""How far the motion between scans may be off: the noise of odometry, and of a velocity that is taken as constant."""

import numpy as np

from lidarcore.arrays import Array
from lidarcore.fields import number, settings
from lidarcore.localization.ekf.motion_kernels import odometry_variances
