"""Where in a known map the sensor is, without a guess, and whether that can be told at all."""

from lidarcore.mapping.relocation.query import Query, query_of
from lidarcore.mapping.relocation.relocator import Relocation, Relocator, Verdict
from lidarcore.mapping.relocation.settings import RelocationSettings

__all__ = ["Query", "Relocation", "RelocationSettings", "Relocator", "Verdict", "query_of"]
