"""Models of lower order, and rational functions fitted to gains."""
