"""The reference of the command `lidarcore`, from the declarations that make its --help."""

from collections.abc import Iterator
from typing import Any

import typer.main
from generated import cell, install, table


def write() -> str:
    """Every command with its arguments and options."""
    from lidarcore_app.cli.main import cli

    return "".join(_command(name, command) for name, command in _commands(typer.main.get_command(cli)))


def _commands(group: Any, prefix: str = "lidarcore") -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        full = f"{prefix} {name}"
        yield full, command
        if hasattr(command, "commands"):
            yield from _commands(command, full)


def _command(name: str, command: Any) -> str:
    level = "#" * name.count(" ")
    rows = [_row(p) for p in command.params if not p.hidden] if not hasattr(command, "commands") else []
    if name == "lidarcore emulate":
        rows = _emulator_rows()
    usage = " ".join([name, *(_usage(p) for p in command.params if not p.opts[0].startswith("-"))])
    return f"#{level} `{usage}`\n\n{command.help}\n\n" + table(("option", "meaning", "default"), rows)


def _usage(argument: Any) -> str:
    return argument.name.upper() if argument.required else f"[{argument.name.upper()}]"


def _row(p: Any) -> tuple[str, str, str]:
    name = ", ".join(f"`{o}`" for o in (*p.opts, *p.secondary_opts))
    if not p.opts[0].startswith("-"):
        name = f"`{p.name.upper()}`"
    notes = [p.help or "", "required" if p.required else "", f"environment: {p.envvar}" if p.envvar else ""]
    default = "" if p.default in (None, False, [], ()) or callable(p.default) else f"`{p.default}`"
    return name, cell("; ".join(note for note in notes if note)), default


def _emulator_rows() -> list[tuple[str, str, str]]:
    """`lidarcore emulate` passes its arguments on to the emulator, which declares them itself."""
    from lidarcore.rplidar.emulation.options import EmulatorOptions

    fields: Any = EmulatorOptions.__pydantic_fields__  # type: ignore[attr-defined]
    return [
        (
            f"`--{name.replace('_', '-')}`",
            cell(field.description),
            "" if field.default in (None, False) else f"`{field.default}`",
        )
        for name, field in fields.items()
    ]


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    return install(app, "command-line", write)
