"""Studies: the papers' experiments done again, with the papers' numbers beside ours."""
