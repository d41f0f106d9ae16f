"""Robot arms that hold the two ends of the rod."""
