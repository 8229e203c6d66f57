"""Records made of others: what two of them call the same is not written out."""

from typing import Any, TypeVar

T = TypeVar("T")


def record(kind: type[T], source: object, /, **given: Any) -> T:
    """A dataclass or TypedDict of that kind: each field as it is given, else as the source says.

    Raises AttributeError for one that neither has, unless it may be left out.
    """
    assert given.keys() <= kind.__annotations__.keys(), given.keys() - kind.__annotations__.keys()
    required = getattr(kind, "__required_keys__", kind.__annotations__)
    names = (name for name in kind.__annotations__ if name in required or name in given)
    return kind(**{name: given[name] if name in given else getattr(source, name) for name in names})
