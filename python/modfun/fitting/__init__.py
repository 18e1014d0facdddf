"""From records to results."""
