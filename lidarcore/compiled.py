"""How the kernels are compiled, in one place."""

import hashlib
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

_STALE = 7 * 24 * 3600  # s after which a folder of compiled kernels that is not this version's is removed
# Sums may be reordered and fused, so that they vectorise; NaN and inf keep their meaning.
_FAST = {"reassoc", "contract", "arcp", "nsz"}


def kernel(function: Function) -> Function:
    """Compile on first call, keep on disk, run without the GIL; division by zero gives inf or NaN as in numpy."""
    return _compile(function, fastmath=_FAST)


def inlined(function: Function) -> Function:
    """The same for small kernels that others call: passing arrays costs more than short loops over them."""
    return _compile(function, fastmath=_FAST, inline="always")


def ordered_kernel(function: Function) -> Function:
    """The same where the order of operations is what makes the result exact."""
    return _compile(function, fastmath=_FAST - {"reassoc"})


def finite_kernel(function: Function) -> Function:
    """The same for kernels that only ever see finite numbers: maxima vectorise too."""
    return _compile(function, fastmath=_FAST | {"nnan", "ninf"})


def _compile(function: Function, **options: Any) -> Function:
    compiled: Function = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    return compiled


def _use_own_cache() -> None:
    """Keep compiled kernels in a folder named by a digest of their sources.

    Numba looks at the file of the outermost kernel only, and would go on using it after a kernel it calls changed.
    Where the package's folder cannot be written, numba falls back to the user's cache by itself.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    package = Path(__file__).parent
    sources = (path.read_bytes() for path in sorted(package.rglob("*.py")))
    digest = hashlib.sha256(b"".join(source for source in sources if b"lidarcore.compiled" in source))
    folder = package / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}"
    for other in folder.parent.glob("kernels-*"):
        if other != folder and time.time() - other.stat().st_mtime > _STALE:  # a younger one may be in use
            shutil.rmtree(other, ignore_errors=True)
    numba.config.CACHE_DIR = str(folder)


_use_own_cache()
