"""What is to be closed."""

from abc import ABC, abstractmethod
from typing import Self


class Closing(ABC):
    """Something that `with` closes at its end."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Let go of what is held."""
