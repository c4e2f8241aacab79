"""Sequential estimation of a bias by how a gyro says that the field turns in the sensor."""
