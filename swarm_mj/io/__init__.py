"""Files that appear whole, and where numbers come from."""
