"""Centre, spread, lines and spheres that outliers cannot reach."""
