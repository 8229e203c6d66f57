"""One turn of the sensor, as it was measured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarcore.arrays import Array, Ints
from lidarcore.scan import Scan

TURN = 360 << 16  # 1/65536 degree


@dataclass(frozen=True, eq=False)
class Revolution:
    """Samples of one turn, in the order they were measured.

    angles     (N,) 1/65536 degree, clockwise from the front, within the turn
    distances  (N,) 1/4 mm; 0: no return
    times      (N,) s, when measured, on the clock of `arrival`
    quality    (N,) as transmitted; None for dense, express and ultra capsules, which carry none
    gaps       (G, 2) 1/65536 degree, from and to, clockwise: sectors that were lost on the way
    arrival    s, when the bytes that completed it arrived
    """

    angles: Ints
    distances: Ints
    times: Array
    quality: NDArray[np.uint8] | None
    gaps: Ints
    arrival: float

    def __len__(self) -> int:
        return len(self.angles)

    @property
    def complete(self) -> bool:
        """Nothing of the turn was lost."""
        return not len(self.gaps)

    def scan(self, stamp_offset: float = 0.0) -> Scan:
        """This revolution as a Scan: metres, radians counter-clockwise, its stamp that of the sample measured first.

        stamp_offset  s, added to the stamp: from the clock of `arrival` to Unix time
        """
        return Scan(
            self.distances[::-1] / 4000,
            _counter_clockwise(self.angles[::-1]),
            stamp=float(self.times[0] + stamp_offset),
            quality=None if self.quality is None else self.quality[::-1].astype(np.float64),
            beam_times=self.times[::-1] - self.times[0],
            gaps=_counter_clockwise(self.gaps[:, ::-1]),
        )


def _counter_clockwise(angles: Ints) -> Array:
    """Radians counter-clockwise, above -pi up to pi, from 1/65536 degree clockwise."""
    return np.where(angles < TURN // 2, -angles, TURN - angles) * (2 * np.pi / TURN)
