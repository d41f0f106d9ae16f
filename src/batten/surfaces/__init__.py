"""Surfaces, and the leaves that planes cut from them."""
