"""The robot of the example `scanner.xml`, as keywords of a mission and of what flies it."""

from pathlib import Path

SCANNER = Path(__file__).parents[1] / "training" / "examples" / "scanner.xml"
SCANNERS = {"robot": str(SCANNER), "pilot": "training.examples.scanning:Scanning"}
