"""Noise as residuals and scores show it: its size, its memory, its drift."""
