"""What a decoder has seen."""

from collections import Counter
from dataclasses import dataclass, field, fields


@dataclass
class Counts:
    """Sums since the decoder was made.

    bytes        received
    packets      intact ones: capsules, or nodes of a legacy scan
    samples      in the revolutions given out
    revolutions  given out
    dropped      by reason, those that occurred:
                 garbage_bytes    bytes that belonged to no intact packet
                 damaged_packets  packets that were in their place, but their checksum or check bit was wrong
                 missing_packets  capsules that never came intact, damaged ones too, by angle and arrival of the next
                 unfit_packets    intact capsules and nodes whose angle does not fit those around
    partial_samples  of turns whose beginning is unknown, after a start or an interruption: left out
    """

    bytes: int = 0
    packets: int = 0
    samples: int = 0
    revolutions: int = 0
    partial_samples: int = 0
    dropped: Counter[str] = field(default_factory=Counter)

    def drop(self, reason: str, count: int = 1) -> None:
        """Count what was not used."""
        if count:
            self.dropped[reason] += count

    def __add__(self, other: "Counts") -> "Counts":
        return Counts(*(getattr(self, each.name) + getattr(other, each.name) for each in fields(self)))
