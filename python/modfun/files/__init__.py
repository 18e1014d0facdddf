"""Bytes on disk: text tables, MATLAB files, and files that are written whole or not at all."""
