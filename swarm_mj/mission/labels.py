"""Words that fields of several parts of a mission share: a heading, and a source."""

CHANNEL = "channel"  # a heading of the help: what an effect of the radio reads
NEW = "not the paper's"  # the source of what the paper has not
