"""Noise profiles: files NAME.json of settings that hold the noise of one sensor, in one folder."""

import threading
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from typing_extensions import TypedDict

from app.calibration_wire import NoiseJson
from app.library import checked_name
from app.problems import ProblemError, explained, pointed_out
from lidarcore import SensorNoise, files
from lidarcore.noise import Metres, Radians

SUFFIX = ".json"
MAX_BYTES = 1 << 16


class _Noise(BaseModel):
    model_config = ConfigDict(extra="forbid")
    sigma_range: Metres
    sigma_bearing: Radians


class _Extraction(BaseModel):
    model_config = ConfigDict(extra="forbid")
    noise: _Noise


class Profile(BaseModel):
    """Settings that set the noise and nothing else: any command takes them as --settings."""

    model_config = ConfigDict(extra="forbid")
    extraction: _Extraction

    @classmethod
    def of(cls, noise: SensorNoise) -> "Profile":
        """The profile of that noise."""
        both = _Noise(sigma_range=noise.sigma_range, sigma_bearing=noise.sigma_bearing)
        return cls(extraction=_Extraction(noise=both))

    @property
    def noise(self) -> NoiseJson:
        """m and rad."""
        both = self.extraction.noise
        return {"sigma_range": both.sigma_range, "sigma_bearing": both.sigma_bearing}

    @property
    def text(self) -> str:
        """What is in the file."""
        return self.model_dump_json(indent=1) + "\n"


class ProfileEntryJson(TypedDict):
    """`noise` is null where the file is damaged, and `problem` says how."""

    name: str
    noise: NoiseJson | None
    problem: str | None


@dataclass(frozen=True)
class Profiles:
    """Those in one folder, which is made when the first is written. Nothing is written outside."""

    folder: Path
    _writing: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    def list(self) -> list[ProfileEntryJson]:
        """All that are there, by name; what cannot be read is listed with its problem."""
        paths = self.folder.glob(f"*{SUFFIX}") if self.folder.is_dir() else ()
        names = (path.stem for path in paths if not path.name.startswith("."))
        return [self._entry(name) for name in sorted(names, key=str.lower)]

    def read(self, name: str) -> Profile:
        """Raises ProblemError 404 if there is none, 422 if that is no plain name or the file is damaged."""
        path = self._path(name)
        try:
            with path.open("rb") as file:
                content = file.read(MAX_BYTES + 1)
        except FileNotFoundError as error:
            raise ProblemError(404, f"There is no profile {name!r}.") from error
        except OSError as error:
            raise ProblemError(422, f"The profile cannot be read: {error.strerror}.") from error
        if len(content) > MAX_BYTES:
            raise ProblemError(422, f"The file is larger than {MAX_BYTES} bytes: it is no profile.")
        try:
            return Profile.model_validate_json(content)
        except ValidationError as error:
            problem = explained(pointed_out(error)).removeprefix("/: ")  # of the whole file
            raise ProblemError(422, f"The file is no profile: {problem}.") from error

    def write(self, name: str, profile: Profile, *, overwrite: bool) -> ProfileEntryJson:
        """Raises ProblemError 409 if the name is taken, 422 if it is no plain name, 507 if nothing can be written."""
        path = self._path(name)
        with self._writing:  # nobody takes the name between the look and the file
            if path.exists() and not overwrite:
                raise ProblemError(
                    409, f"There is a profile {name!r} already: replace it or choose another name."
                )
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                files.write(path, profile.text)
            except OSError as error:
                raise ProblemError(507, f"The profile could not be saved: {error.strerror}.") from error
        return {"name": name, "noise": profile.noise, "problem": None}

    def delete(self, name: str) -> None:
        """Raises ProblemError 404 if there is none, 422 if that is no plain name or the file cannot be deleted."""
        try:
            self._path(name).unlink()
        except FileNotFoundError as error:
            raise ProblemError(404, f"There is no profile {name!r}.") from error
        except OSError as error:
            raise ProblemError(422, f"The profile cannot be deleted: {error.strerror}.") from error

    def _path(self, name: str) -> Path:
        return self.folder / checked_name(name + SUFFIX)

    def _entry(self, name: str) -> ProfileEntryJson:
        try:
            return {"name": name, "noise": self.read(name).noise, "problem": None}
        except ProblemError as problem:
            return {"name": name, "noise": None, "problem": problem.detail}
