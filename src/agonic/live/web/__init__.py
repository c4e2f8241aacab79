"""The live page: sensors being turned, in a browser."""
