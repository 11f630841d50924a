"""Files that appear whole, processes and signals, and where numbers come from."""
