"""Frequency responses and Fourier coefficients of records, without a model."""
