"""The command `batten`: a thin shell around the library."""
