"""The examples that `workbench new` writes. They are checked like every other module."""
