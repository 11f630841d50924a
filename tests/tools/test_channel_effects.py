"""The list of channel effects in the docs is that of the classes."""

import tomllib
from pathlib import Path

import channel_effects

from swarm_mj.radio.effects import EFFECTS

ROOT = Path(__file__).parents[2]


def test_every_effect_has_a_row_with_its_options():
    rows = channel_effects.table(ROOT).splitlines()[2:]
    assert len(rows) == len(EFFECTS)
    assert rows[0].startswith("| path loss | `--path-loss`, `--loss-exponent`, ")
    assert any(row.startswith("| high power | `--high-power-fraction`, ") for row in rows)


def test_the_docs_have_the_list():
    spec = tomllib.loads((ROOT / "tools/tables.toml").read_text("utf-8"))["channel-effects"]
    assert spec["function"] == "channel_effects:table"
    listed = f"<!-- table: channel-effects -->\n\n{channel_effects.table(ROOT)}\n\n<!-- end -->"
    assert listed in (ROOT / "docs/channels.md").read_text("utf-8")
