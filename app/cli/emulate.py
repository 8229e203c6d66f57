"""The command `lidarcore emulate`: its options are those of the emulator, declared once in EmulatorOptions."""

import typer

# The emulator reads its options, and explains them, itself.
PASS_ON = {"ignore_unknown_options": True, "allow_extra_args": True}


def emulate(context: typer.Context) -> None:
    """Emulate an RPLIDAR S1 on a pseudo-terminal; --help lists what can be set."""
    from lidarcore.rplidar.emulator import main

    main(context.args, program="lidarcore emulate")
