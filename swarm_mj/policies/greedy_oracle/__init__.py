"""The greedy oracles: schedules by someone who knows everything."""
