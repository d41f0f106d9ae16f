"""Immutable plane curves under one protocol."""
