"""The command line: one module per command, found and imported only when it is asked for."""
