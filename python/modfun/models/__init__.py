"""What may be fitted, how, and under what noise."""
