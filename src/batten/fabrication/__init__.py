"""What a workshop does with it: rods, blocks, checks, robots. Units: mm, N, N·mm, rad, s."""
