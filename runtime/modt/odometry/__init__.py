"""Where the sensor is: deskew, and registration against what stands still."""
