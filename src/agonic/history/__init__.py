"""What was known of each sensor, and when."""
