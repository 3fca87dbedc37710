"""Ways out: files other programs read."""
