"""How the kernels are compiled and where their machine code is kept, in one place."""

import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import registry
from numba.core.caching import Cache, CompileResultCacheImpl, _CacheLocator

Function = TypeVar("Function", bound=Callable[..., Any])

# Sums may be reordered and fused, so that they vectorise; NaN and inf keep their meaning.
_FAST = {"reassoc", "contract", "arcp", "nsz"}
_OPTIONS: dict[Any, dict[str, Any]] = {}  # of each function that is compiled


def kernel(function: Function) -> Function:
    """Compile on first call, keep on disk, run without the GIL; division by zero gives inf or NaN as in numpy."""
    return _compile(function, fastmath=_FAST)


def inlined(function: Function) -> Function:
    """As `kernel`, for small kernels that others call: passing arrays costs more than short loops over them.

    LLVM inlines them. Numba's own inlining would infer the types of every copy anew: three times as long to compile.
    """
    return _compile(function, fastmath=_FAST, forceinline=True)


def ordered_kernel(function: Function) -> Function:
    """As `kernel`, where the order of operations is what makes the result exact."""
    return _compile(function, fastmath=_FAST - {"reassoc"})


def finite_kernel(function: Function) -> Function:
    """As `kernel`, for kernels that only ever see finite numbers: maxima vectorise too."""
    return _compile(function, fastmath=_FAST | {"nnan", "ninf"})


def _compile(function: Function, **options: Any) -> Function:
    compiled = numba.njit(nogil=True, error_model="numpy", **options)(function)
    _OPTIONS[function] = options
    compiled._cache = _LazyCache(function)
    return compiled


class _LazyCache:
    """The cache of one kernel, made at its first call: importing the library computes and touches nothing."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def __getattr__(self, name: str) -> Any:
        self.__dict__["_cache"] = made = self.__dict__.get("_cache") or _KernelCache(self._function)
        return getattr(made, name)


class _Locator(_CacheLocator):  # type: ignore[misc]
    """A kernel's file, valid while the kernel and all that it calls are what they were.

    Numba looks at the file of the outermost kernel only, and would go on using it after a kernel it calls changed.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def get_cache_path(self) -> str:
        return str(folder())

    def get_source_stamp(self) -> str:
        return _fingerprint(self._function)

    def get_disambiguator(self) -> str:
        return hashlib.sha256(self._function.__module__.encode()).hexdigest()[:8]

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> "_Locator":
        return cls(py_func)


class _KernelCacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _KernelCache(Cache):  # type: ignore[misc]
    _impl_class = _KernelCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept, or None if it was made with a module or a type that has another name now."""
        try:
            return super().load_overload(sig, target_context)
        except (ImportError, AttributeError):
            self.flush()
            return None


@cache
def _fingerprint(function: FunctionType) -> str:
    """A digest of a kernel's bytecode, its options, and the kernels and constants that it uses."""
    digest = hashlib.sha256()
    options = _OPTIONS.get(function, {})
    for name, value in sorted(options.items()):
        digest.update(repr((name, sorted(value) if isinstance(value, set) else value)).encode())
    for code in _codes(function.__code__):
        digest.update(code.co_code)
        constants = [
            one for one in code.co_consts if not isinstance(one, CodeType) and one != function.__doc__
        ]
        digest.update(repr(constants).encode())
        digest.update(repr(code.co_names).encode())
        for value in _used(code, function.__globals__):
            if (
                getattr(value, "py_func", None) is not function
            ):  # it may have the name of what it calls elsewhere
                digest.update(_described(value))
    return digest.hexdigest()


def _codes(code: CodeType) -> Iterator[CodeType]:
    """A function's code and that of the functions and comprehensions inside of it."""
    yield code
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield from _codes(one)


def _used(code: CodeType, names: dict[str, Any]) -> Iterator[Any]:
    """The global values that a code mentions, also as attributes of modules of its own package."""
    package = names["__name__"].partition(".")[0]
    for name in code.co_names:
        value = names.get(name)
        if isinstance(value, ModuleType):
            if value.__name__.partition(".")[0] == package:
                yield from (getattr(value, inner) for inner in code.co_names if hasattr(value, inner))
        else:
            yield value


def _described(value: Any) -> bytes:
    if isinstance(value, registry.CPUDispatcher):
        return _fingerprint(value.py_func).encode()
    if isinstance(value, np.ndarray):
        return repr((value.dtype.str, value.shape)).encode() + value.tobytes()
    if isinstance(value, type | FunctionType):
        return repr((value.__qualname__, getattr(value, "_fields", None))).encode()
    return repr(value).encode()


@cache
def folder() -> Path:
    """Where compiled kernels are kept: beside the package, else in the user's cache, else for this process only."""
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR)
    for folder in _candidates():
        if _is_writable(folder):
            return folder
    temporary = tempfile.TemporaryDirectory(prefix="lidarcore-kernels-", ignore_cleanup_errors=True)
    _TEMPORARY.append(temporary)
    warnings.warn(
        "Compiled kernels cannot be kept, neither beside the package nor in the user's cache folder: every start "
        "takes a minute longer. Set NUMBA_CACHE_DIR to a folder that can be written.",
        RuntimeWarning,
        stacklevel=2,
    )
    return Path(temporary.name)


def is_kept() -> bool:
    """Whether what is compiled outlives this process."""
    folder()
    return not _TEMPORARY


_TEMPORARY: list[tempfile.TemporaryDirectory[str]] = []  # removed when the process ends


def _candidates() -> Iterator[Path]:
    package = Path(__file__).resolve().parent
    yield package / "__pycache__" / "kernels"
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    yield Path(caches) / "lidarcore" / hashlib.sha256(str(package).encode()).hexdigest()[:16]


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False
