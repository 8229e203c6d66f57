"""Why a file cannot be read or written, in plain words: libraries tell of their insides."""

import re
import struct
import sys
import zlib
from gzip import BadGzipFile
from zipfile import BadZipFile

if sys.version_info >= (3, 14):
    from compression import zstd as zstd
else:
    from backports import zstd as zstd

UNPACKING = (zlib.error, zstd.ZstdError, BadZipFile)
"""What packed data lead to that are damaged; gzip and bz2 raise OSError without a number, or EOFError."""

_NUMBER = re.compile(r"\[Errno -?\d+\] ")  # of an error of the system, in the words of another one
_DAMAGED = "it is damaged or cut short, copy it anew"


def reason(error: BaseException) -> str:
    """Why reading or writing a file has failed, without a full stop; what lidarcore says itself stays as it is."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, UnicodeDecodeError):
        return "it is not text in UTF-8"
    return _DAMAGED if _is_of_damage(error) else _NUMBER.sub("", str(error)) or _DAMAGED


def _is_of_damage(error: BaseException) -> bool:
    is_plain = type(error) in (OSError, BadGzipFile)  # others have words of their own
    return is_plain or isinstance(error, (*UNPACKING, EOFError, KeyError, SyntaxError, struct.error))
