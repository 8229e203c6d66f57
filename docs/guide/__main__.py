"""The command `python -m docs.guide FILE.html` (`make guide`): measure, draw and write the guide."""

import argparse
import os
from pathlib import Path

from lidarcore.files import write

from .measurement import GuideDesign, measure
from .page import html

if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m docs.guide", description="Measure, draw and write the guide."
    )
    parser.add_argument("output", type=Path, help="FILE.html, replaced if it exists")
    output = parser.parse_args().output
    write(output, html(measure(GuideDesign(), os.cpu_count() or 1)))
