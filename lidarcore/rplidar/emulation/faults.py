"""What goes wrong on the way from the sensor: bits that flip, packets and bytes that get lost."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(slots=True)
class Faults:
    """Shares, 0 to 1, that may be changed at any time."""

    flip: float = 0.0  # of the packets have one bit flipped
    lose: float = 0.0  # of the packets are lost
    lose_bytes: float = 0.0  # of the bytes are lost
    rng: np.random.Generator = field(default_factory=np.random.default_rng)

    def damage(self, data: bytes, size: int) -> bytes:
        """Packets of that many bytes each, as they arrive; 0: it is all one packet."""
        if not (self.flip or self.lose or self.lose_bytes):
            return data
        packets = np.frombuffer(data, np.uint8).reshape(-1, size or len(data))
        packets = packets[self.rng.random(len(packets)) >= self.lose]
        flipped = np.flatnonzero(self.rng.random(len(packets)) < self.flip)
        where = self.rng.integers(packets.shape[1], size=len(flipped))
        packets[flipped, where] ^= (1 << self.rng.integers(8, size=len(flipped))).astype(np.uint8)
        kept = self.rng.random(packets.size) >= self.lose_bytes
        return packets.ravel()[kept].tobytes()
