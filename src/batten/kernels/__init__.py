"""Compiled functions of floats and arrays: no objects, no errors, a value and a status."""
