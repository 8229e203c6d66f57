"""Noise profiles: files NAME.json of settings that hold the noise of one sensor, in one folder."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from lidarcore import LidarError, SensorNoise, files

from ..errors import ConflictError, InvalidNameError, NotFoundError, explained, storing
from ..sources.plain_names import PLAIN_NAME, checked_name

SUFFIX = ".json"
MAX_BYTES = 1 << 16
MEASURED = ("sigma_range", "sigma_bearing")  # what a profile has to say; older ones say no more


def _complete(noise: object) -> object:
    if isinstance(noise, Mapping) and (missing := [name for name in MEASURED if name not in noise]):
        raise ValueError(f"{' and '.join(missing)} missing")
    return noise


class _Extraction(BaseModel):
    model_config = ConfigDict(extra="forbid")
    noise: Annotated[SensorNoise, BeforeValidator(_complete)]


class Profile(BaseModel):
    """Settings that set the noise and nothing else: any command takes them as --settings."""

    model_config = ConfigDict(extra="forbid")
    extraction: _Extraction

    @classmethod
    def of(cls, noise: SensorNoise) -> "Profile":
        """The profile of that noise."""
        return cls(extraction=_Extraction(noise=noise))

    @property
    def noise(self) -> SensorNoise:
        """m and rad."""
        return self.extraction.noise

    @property
    def text(self) -> str:
        """What is in the file."""
        return self.model_dump_json(indent=1) + "\n"


class ProfileError(LidarError):
    """The file is not a profile, or cannot be read."""


@dataclass(frozen=True, slots=True)
class ProfileEntry:
    """`noise` is None where the file is damaged, and `problem` says how."""

    name: str
    noise: SensorNoise | None
    problem: str | None = None


@dataclass(frozen=True)
class Profiles:
    """Profiles in one folder, which is made when the first is written. Nothing is written outside."""

    folder: Path
    _writing: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    def list(self) -> list[ProfileEntry]:
        """All profiles, by name; what cannot be read is listed with its problem."""
        paths = self.folder.glob(f"*{SUFFIX}") if self.folder.is_dir() else ()
        names = (path.stem for path in paths if PLAIN_NAME.fullmatch(path.name))
        return [self._entry(name) for name in sorted(names, key=str.lower)]

    def read(self, name: str) -> Profile:
        """Raises NotFoundError, InvalidNameError, or ProfileError if the file is damaged."""
        path = self._path(name)
        try:
            if path.exists() and not path.is_file():  # to open a FIFO would wait for somebody who writes
                raise ProfileError(f"{path.name} is not a file, so it is not a profile.")
            with path.open("rb") as file:
                content = file.read(MAX_BYTES + 1)
        except FileNotFoundError as error:
            raise NotFoundError(f"There is no profile {name!r}.") from error
        except OSError as error:
            raise ProfileError(f"The profile cannot be read: {error.strerror}.") from error
        if len(content) > MAX_BYTES:
            raise ProfileError(f"The file is larger than {MAX_BYTES} bytes, so it is not a profile.")
        try:
            return Profile.model_validate_json(content)
        except ValidationError as error:
            raise ProfileError(f"The file is not a profile: {explained(error)}.") from error

    def write(self, name: str, profile: Profile, *, overwrite: bool) -> ProfileEntry:
        """Raises ConflictError if the name is taken, InvalidNameError, StorageError if nothing can be written."""
        path = self._path(name)
        with self._writing:  # nobody takes the name between the look and the file
            if path.exists() and not overwrite:
                raise ConflictError(
                    f"A profile named {name!r} already exists: replace it or choose another name."
                )
            with storing("The profile could not be saved"):
                self.folder.mkdir(parents=True, exist_ok=True)
                files.write(path, profile.text)
        return ProfileEntry(name, profile.noise)

    def delete(self, name: str) -> None:
        """Raises NotFoundError, InvalidNameError, ProfileError if the file cannot be deleted."""
        try:
            self._path(name).unlink()
        except FileNotFoundError as error:
            raise NotFoundError(f"There is no profile {name!r}.") from error
        except OSError as error:
            raise ProfileError(f"The profile cannot be deleted: {error.strerror}.") from error

    def _path(self, name: str) -> Path:
        return self.folder / checked_name(name + SUFFIX)

    def _entry(self, name: str) -> ProfileEntry:
        try:
            return ProfileEntry(name, self.read(name).noise)
        except (NotFoundError, InvalidNameError, ProfileError) as error:
            return ProfileEntry(name, None, str(error))
