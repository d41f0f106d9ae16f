"""File formats, one file each. Units are converted here and nowhere else."""
