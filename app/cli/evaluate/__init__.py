"""The command `lidarcore evaluate`: what each method claims, and what is so."""

from .commands import evaluate

__all__ = ["evaluate"]
