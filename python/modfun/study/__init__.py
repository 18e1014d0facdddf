"""What `MonteCarlo` is made of: the layout of a study, its parts, who computes them, and its results."""
