"""Words and small tools for every other part: tables, HTML, arguments, progress, plot axes."""
