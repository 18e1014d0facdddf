"""The closed text language of inputs and equations: from text to trees to numbers."""
