"""The noise of known kinds of sensor: where to begin until your own is calibrated."""

from dataclasses import dataclass

from lidarcore.noise import SensorNoise


@dataclass(frozen=True, slots=True)
class SensorKind:
    """A kind of sensor: what it is called, its noise in ordinary rooms, and the evidence for that."""

    title: str
    noise: SensorNoise
    rests_on: str


SENSORS: dict[str, SensorKind] = {
    "rplidar_s1": SensorKind(
        "RPLIDAR S1",
        SensorNoise(0.02, 0.0034, unevenness=0.006, unevenness_length=0.1),
        "No recording of an S1 at rest was at hand: these are cautious defaults, larger than what was measured of the "
        "C1, with walls as the A1 and A2 saw them. Calibrate yours.",
    ),
    "rplidar_a1_a2": SensorKind(
        "RPLIDAR A1 or A2",
        SensorNoise(
            0.0007,
            0.0008,
            range_growth=0.0003,
            unevenness=0.006,
            unevenness_length=0.1,
            tails=0.25,
            renewal=0.1,
            resampling=1.0,
        ),
        "Means of the calibrations of 14 places in three recordings (rplidar_csv_rooms), from 300 scans each of a "
        "sensor of this class at rest: ranges 0.2 to 1.7 mm nearby, bearings 0.5 to 1.1 mrad, walls uneven by 3 to "
        "29 mm (median 3.8, by which walls of cluttered rooms fall apart) over 5 to 17 cm. What is new in the next "
        "scan (renewal) is 0.04; 0.1 is cautious.",
    ),
    "rplidar_c1": SensorKind(
        "RPLIDAR C1",
        SensorNoise(0.0015, 0.001, range_growth=0.00035, unevenness=0.0035, unevenness_length=0.03),
        "70 walls in 25 single scans of one room (tau_rplidar_c1_rooms; ranges that the file repeats left out): "
        "neighbouring beams differ by 1 to 2 mm up to 2 m and by 6 mm at 4 m. What repeats from scan to scan is not "
        "known; the noise of bearings is assumed.",
    ),
    "hokuyo_urg_04lx": SensorKind(
        "Hokuyo URG-04LX",
        SensorNoise(0.002, 0.001, range_growth=0.00025, unevenness=0.005, unevenness_length=0.08),
        "1,115 walls in 150 scans of one moving sensor (ccny_hokuyo_rosbag1): neighbouring beams differ by 2 mm at "
        "1.5 m and 4 mm at 3.7 m. What repeats from scan to scan is not known; the noise of bearings is assumed.",
    ),
}
"""Kinds of sensors, by the names that `--settings` takes."""
