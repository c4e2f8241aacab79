"""Bias and matrix over temperature, from stations in a climatic chamber or a known field."""
