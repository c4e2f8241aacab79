"""What is said of plans: calibrations, what disturbs on board, where to put a second sensor."""
