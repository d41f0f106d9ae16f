"""Elastic splines: designed by a proxy of cubics, found by interpolation."""
