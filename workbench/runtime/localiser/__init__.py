"""Where the vehicle is, computed on the vehicle: ranges and reports in, localisation sets out."""
