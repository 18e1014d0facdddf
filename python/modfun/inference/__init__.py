"""Questions about fits: order, rank, collinearity, comparison, bootstrap."""
