"""The command `python -m lidarcore.guide FILE.html`: measure, draw and write the guide."""

import argparse
import os
from pathlib import Path

from lidarcore.files import write
from lidarcore.guide.measurement import GuideDesign, measure
from lidarcore.guide.page import html

if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="python -m lidarcore.guide", description="Measure, draw and write the guide."
    )
    parser.add_argument("output", type=Path, help="FILE.html, replaced if it exists")
    output = parser.parse_args().output
    write(output, html(measure(GuideDesign(), os.cpu_count() or 1)))
