"""The limits of rod, block and blade, one file each."""
