"""Requests that the OpenAPI document allows, and others, by schemathesis; at the end in sequences that depend."""

import subprocess
import sys
from pathlib import Path

from findings import Findings

PATIENCE = 10.0  # s for an answer
CHECKS = "not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance"
MARGIN = 300.0  # s beyond its time that schemathesis may take to end


def fuzz(address: str, seconds: float, findings: Findings, folder: Path) -> None:
    """All operations, stateful too, for so long; what it finds is printed by it, and how to ask that again."""
    command = [sys.executable, "-m", "schemathesis.cli", "run", f"{address}/openapi.json"]
    command += ["--checks", CHECKS, "--max-time", f"{max(seconds, 1):.0f}", "--seed", str(findings.seed)]
    command += [
        "--max-response-time",
        str(PATIENCE),
        "--continue-on-failure",
        "--no-color",
        "--warnings",
        "off",
    ]
    findings.tried["rest"] += 1
    try:
        run = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=seconds + MARGIN, check=False
        )
    except subprocess.TimeoutExpired:
        findings.add("rest", "schemathesis", f"did not end within {seconds + MARGIN:.0f} s")
    else:
        print(run.stdout[-20_000:], run.stderr[-2000:])
        if run.returncode:
            findings.add("rest", "schemathesis", f"exit code {run.returncode}: see what it printed")
