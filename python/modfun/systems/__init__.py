"""Linear systems with numbers, and gains as data."""
