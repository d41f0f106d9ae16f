"""Algorithms that find a curve: initial guess, fit."""
