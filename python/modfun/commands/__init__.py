"""The `modfun` command."""
