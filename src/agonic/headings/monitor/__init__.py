"""A monitor of two whole compasses, each a magnetometer with an inclinometer of its own."""
