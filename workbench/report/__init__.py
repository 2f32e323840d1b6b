"""Reports: self-contained HTML pages with plots, tables and a player for decisions."""
