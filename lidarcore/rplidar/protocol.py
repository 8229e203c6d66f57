"""The serial protocol of an RPLIDAR: bytes to values and back, without any I/O.

Requests and short answers are in `commands` and `answers`. Measurements come as a stream: `packets` finds whole
packets in it, `capsules` and `turns`, or `nodes`, put what they hold into revolutions; `decoder` calls them all.
"""

from lidarcore.rplidar.answers import S1_MODES, Answer, Descriptor, DeviceInfo, Health, ScanMode
from lidarcore.rplidar.commands import Command, Conf, Request, RequestReader, request
from lidarcore.rplidar.decoding.counts import Counts
from lidarcore.rplidar.decoding.decoder import StreamDecoder
from lidarcore.rplidar.decoding.revolution import Revolution
from lidarcore.rplidar.encoding import encode_dense, encode_nodes

__all__ = [
    "S1_MODES",
    "Answer",
    "Command",
    "Conf",
    "Counts",
    "Descriptor",
    "DeviceInfo",
    "Health",
    "Request",
    "RequestReader",
    "Revolution",
    "ScanMode",
    "StreamDecoder",
    "encode_dense",
    "encode_nodes",
    "request",
]
