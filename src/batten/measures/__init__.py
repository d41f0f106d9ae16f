"""How good a curve is: residuals, energies, distances."""
